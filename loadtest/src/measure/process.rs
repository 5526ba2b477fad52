//! Resources of this process. They show whether the client was too slow.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System};

/// Resources of the load tester, all of its processes together.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OwnUse {
    /// Processor time over the measured time, seconds.
    pub cpu_s: f64,
    /// Number of processes.
    pub processes: u32,
    /// Readings, about one a second.
    pub looks: Vec<OwnLook>,
}

/// A reading of the load tester's resources.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OwnLook {
    /// Seconds from the start of the load.
    pub at_s: f64,
    /// Processor time so far, seconds.
    pub cpu_s: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
}

impl OwnUse {
    /// Adds a reading.
    pub fn note(&mut self, at_s: f64, cpu_s: f64, rss_bytes: u64) {
        self.looks.push(OwnLook {
            at_s,
            cpu_s,
            rss_bytes,
        });
    }

    /// Maximum memory over all readings, bytes.
    pub fn peak_rss_bytes(&self) -> u64 {
        self.looks.iter().map(|l| l.rss_bytes).max().unwrap_or(0)
    }

    /// The last reading up to `at_s`. Readings and scrapes are due at the same times, so this
    /// accepts a reading up to 0.05 s later.
    pub fn look_at(&self, at_s: f64) -> Option<&OwnLook> {
        self.looks.iter().rev().find(|look| look.at_s <= at_s + 0.05)
    }

    /// Adds the resources of another process. All processes take readings at the same times.
    pub fn merge(&mut self, other: &Self) {
        self.cpu_s += other.cpu_s;
        self.processes += other.processes;
        if self.looks.is_empty() {
            self.looks.clone_from(&other.looks);
            return;
        }
        for (look, other) in self.looks.iter_mut().zip(&other.looks) {
            look.cpu_s += other.cpu_s;
            look.rss_bytes += other.rss_bytes;
        }
    }
}

/// Reads the resources of this process.
#[derive(Debug)]
pub struct ProcessWatch {
    system: System,
    pid: Option<Pid>,
}

impl Default for ProcessWatch {
    fn default() -> Self {
        Self {
            system: System::new(),
            pid: sysinfo::get_current_pid().ok(),
        }
    }
}

impl ProcessWatch {
    /// Processor time so far, and resident memory in bytes. Both are 0 if the system does not
    /// report them.
    pub fn look(&mut self) -> (Duration, u64) {
        let Some(pid) = self.pid else {
            return (Duration::ZERO, 0);
        };
        let what = ProcessRefreshKind::nothing().with_cpu().with_memory();
        self.system
            .refresh_processes_specifics(ProcessesToUpdate::Some(&[pid]), false, what);
        self.system.process(pid).map_or((Duration::ZERO, 0), |process| {
            (
                Duration::from_millis(process.accumulated_cpu_time()),
                process.memory(),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_and_memory_are_seen() {
        let mut watch = ProcessWatch::default();
        let (before, memory) = watch.look();
        let mut sum = 0_u64;
        let begin = std::time::Instant::now();
        while begin.elapsed() < Duration::from_millis(150) {
            sum = std::hint::black_box(sum.wrapping_add(1));
        }
        let (after, _) = watch.look();
        assert!(memory > 1 << 20, "{memory}");
        assert!(after > before, "{before:?} {after:?}");
    }
}

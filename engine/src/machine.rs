//! What this machine offers for inference: CPU, cores, memory.

use std::path::Path;

use serde::Serialize;

use crate::gpu::{Gpu, gpus};

/// The properties of the machine that engines and their sizes depend on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Name of the CPU model.
    pub cpu: String,
    /// CPU features that decide the speed of networks.
    pub features: Vec<&'static str>,
    /// Cores that this process may use, within its affinity and its container's limits.
    pub cores: usize,
    /// Cores of the machine.
    pub host_cores: usize,
    /// Memory that this process may use, bytes: the container's limit, or all of the machine's.
    pub memory_bytes: u64,
    /// Memory of the whole machine, bytes.
    pub host_memory_bytes: u64,
    /// NVIDIA GPUs, if there is a driver.
    pub gpus: Vec<Gpu>,
}

/// CPU features for computing in bf16.
const BF16: [&str; 2] = ["avx512_bf16", "amx_bf16"];

impl Machine {
    /// Detects this machine.
    pub fn detect() -> Self {
        use sysinfo::{CpuRefreshKind, MemoryRefreshKind, RefreshKind, System};
        let what = RefreshKind::nothing()
            .with_cpu(CpuRefreshKind::nothing())
            .with_memory(MemoryRefreshKind::nothing().with_ram());
        let system = System::new_with_specifics(what);
        let host_memory_bytes = system.total_memory();
        let limit = system
            .cgroup_limits()
            .map_or(u64::MAX, |limits| limits.total_memory);
        Self {
            cpu: system
                .cpus()
                .first()
                .map(|cpu| cpu.brand().trim().to_owned())
                .unwrap_or_default(),
            features: features(),
            cores: available_cores(),
            host_cores: online_cores().unwrap_or(system.cpus().len()),
            memory_bytes: limit.min(host_memory_bytes),
            host_memory_bytes,
            gpus: gpus(),
        }
    }

    /// Whether the CPU computes in bf16.
    pub fn has_bf16(&self) -> bool {
        self.features.iter().any(|feature| BF16.contains(feature))
    }
}

/// Memory that this process can still take, bytes: what the machine has available, within the
/// container's limit. None if the system does not say.
pub fn free_memory_bytes() -> Option<u64> {
    use sysinfo::{MemoryRefreshKind, RefreshKind, System};
    let what = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(what);
    let limit = system
        .cgroup_limits()
        .map_or(u64::MAX, |limits| limits.total_memory.saturating_sub(limits.rss));
    let free = system.available_memory().min(limit);
    (free > 0).then_some(free)
}

/// Memory of this process, bytes. None where the system does not say.
pub fn resident_bytes() -> Option<u64> {
    resident_in(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The line `VmRSS` of `/proc/PID/status`, in bytes.
fn resident_in(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

/// Cores that this process may use, within its affinity and its container's limits.
pub fn available_cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Cores that are online, for any process. A container sees all of them.
fn online_cores() -> Option<usize> {
    parse_ranges(&std::fs::read_to_string(Path::new("/sys/devices/system/cpu/online")).ok()?)
}

/// Count of numbers in a list such as `0-3,8`.
fn parse_ranges(list: &str) -> Option<usize> {
    let count = |range: &str| -> Option<usize> {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        Some(last.checked_sub(first)? + 1)
    };
    list.trim().split(',').map(count).sum()
}

#[cfg(target_arch = "x86_64")]
fn features() -> Vec<&'static str> {
    use std::is_x86_feature_detected as has;
    let cpuid = raw_cpuid::CpuId::new();
    let extended = cpuid.get_extended_feature_info();
    let amx = |found: fn(&raw_cpuid::ExtendedFeatures) -> bool| extended.as_ref().is_some_and(found);
    let all = [
        ("avx2", has!("avx2")),
        ("fma", has!("fma")),
        ("avx512f", has!("avx512f")),
        ("avx512_vnni", has!("avx512vnni")),
        (BF16[0], has!("avx512bf16")),
        (BF16[1], amx(raw_cpuid::ExtendedFeatures::has_amx_bf16)),
        ("amx_int8", amx(raw_cpuid::ExtendedFeatures::has_amx_int8)),
    ];
    all.into_iter()
        .filter(|(_, found)| *found)
        .map(|(name, _)| name)
        .collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> Vec<&'static str> {
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_counted() {
        assert_eq!(parse_ranges("0\n"), Some(1));
        assert_eq!(parse_ranges("0-3,8,10-11\n"), Some(7));
        assert_eq!(parse_ranges(""), None);
        assert_eq!(parse_ranges("3-0"), None);
    }

    #[test]
    fn resident_memory_is_read_in_bytes() {
        let status = "VmPeak:\t  900 kB\nVmRSS:\t   12 kB\nRssAnon:\t 4 kB\n";
        assert_eq!(resident_in(status), Some(12 << 10));
        assert_eq!(resident_in("VmPeak:\t  900 kB\n"), None);
        assert_eq!(resident_in("VmRSS:\t many kB\n"), None);
    }

    #[test]
    fn this_machine_has_cores_and_memory() {
        let machine = Machine::detect();
        assert!(
            machine.cores >= 1 && machine.cores <= machine.host_cores,
            "{machine:?}"
        );
        assert!(machine.memory_bytes > 0 && machine.memory_bytes <= machine.host_memory_bytes);
        assert!(free_memory_bytes().unwrap() <= machine.host_memory_bytes);
    }

    #[test]
    fn either_feature_is_bf16() {
        let machine = |features| Machine {
            features,
            ..Machine::detect()
        };
        assert!(machine(vec!["avx2", "amx_bf16"]).has_bf16());
        assert!(machine(vec!["avx512_bf16"]).has_bf16());
        assert!(!machine(vec!["avx2", "avx512f"]).has_bf16());
    }
}

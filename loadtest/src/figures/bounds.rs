//! Bounds of a run, for scripts and CI.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::types::{Figures, Run};

/// The bounds of all runs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Bounds {
    /// Maximum p99 of latencies, milliseconds.
    pub p99_ms: Option<f64>,
    /// Whether no character may slow down or miss a frame.
    pub zero_underruns: bool,
    /// Whether no request may fail or be dropped by the client.
    pub zero_failures: bool,
    /// Minimum number of right answers a second.
    pub min_rate: Option<f64>,
}

/// A bound and its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoundResult {
    /// The option that states it.
    pub bound: String,
    /// The allowed value.
    pub allowed: f64,
    /// The measured value. For times and counts it is that of the worst repetition, for a rate it
    /// is the median.
    pub found: f64,
    /// Whether it was kept.
    pub kept: bool,
}

impl Bounds {
    /// Checks the bounds on all repetitions.
    pub fn check(&self, runs: &[Run], median: &Figures) -> Vec<BoundResult> {
        let most = |of: fn(&Figures) -> f64| runs.iter().map(|run| of(&run.figures)).fold(0.0, f64::max);
        let at_most = |bound: &str, allowed: f64, found: f64| BoundResult {
            bound: bound.to_owned(),
            allowed,
            found,
            kept: found <= allowed,
        };
        let mut results = Vec::new();
        if let Some(p99) = self.p99_ms {
            let mut result = at_most("expect-p99-ms", p99, most(|f| f.latency_ms.p99));
            // A run without right answers misses the bound.
            result.kept &= runs.iter().all(|run| run.figures.counts.right > 0);
            results.push(result);
        }
        if self.zero_underruns {
            results.push(at_most("expect-zero-underruns", 0.0, most(underruns)));
        }
        if self.zero_failures {
            let failures = |f: &Figures| (f.counts.failed + f.counts.dropped) as f64;
            results.push(at_most("expect-zero-failures", 0.0, most(failures)));
        }
        if let Some(rate) = self.min_rate {
            let found = median.throughput.requests_per_s;
            results.push(BoundResult {
                bound: "expect-rate".to_owned(),
                allowed: rate,
                found,
                kept: found >= rate,
            });
        }
        results
    }
}

/// Disturbances of live characters: slowdowns because of late plans, and missing frames.
pub fn underruns(figures: &Figures) -> f64 {
    figures.live.map_or(0.0, |live| {
        (live.plans.underruns.max(live.slowed_frames) + live.missing_frames + live.missed_ticks + live.faults)
            as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::LiveFigures;
    use crate::figures::testing::run;

    #[test]
    fn bounds_hold_for_every_repetition() {
        let mut runs = vec![run(4.0), run(9.0)];
        let bounds = Bounds {
            p99_ms: Some(5.0),
            zero_underruns: true,
            zero_failures: true,
            min_rate: Some(100.0),
        };
        let median = runs[0].figures.clone();
        let results = bounds.check(&runs, &median);
        let kept = results.iter().map(|r| (r.bound.as_str(), r.kept));
        assert_eq!(
            kept.collect::<Vec<_>>(),
            [
                ("expect-p99-ms", false),
                ("expect-zero-underruns", true),
                ("expect-zero-failures", true),
                ("expect-rate", true)
            ]
        );
        assert_eq!(results[0].found.round(), 9.0);

        runs[0].figures.live = Some(LiveFigures {
            missing_frames: 1,
            ..LiveFigures::default()
        });
        runs[1].figures.counts.dropped = 1;
        let results = bounds.check(&runs, &median);
        assert!(!results[1].kept && !results[2].kept);
    }

    #[test]
    fn without_an_answer_no_time_is_kept() {
        let mut silent = run(0.0);
        silent.figures.counts.right = 0;
        let bounds = Bounds {
            p99_ms: Some(5.0),
            ..Bounds::default()
        };
        let results = bounds.check(&[silent.clone()], &silent.figures);
        assert!(!results[0].kept);
    }
}

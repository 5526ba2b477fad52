//! The level that a search raises, and the bounds of each step.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::figures::{Figures, underruns};

/// The level that a search raises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Aim {
    /// Live characters.
    Characters,
    /// Requests a second.
    Rate,
}

/// Bounds of a level.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Goal {
    /// Maximum p99 of latencies, milliseconds.
    pub p99_ms: f64,
    /// Minimum number of plans per second and character; 0 for any number.
    pub min_plans_per_s: f64,
    /// Minimum share of due requests with a right answer.
    pub right_share: f64,
}

impl Goal {
    /// The reasons why a run misses the goal. Empty if it meets the goal.
    pub fn misses(&self, figures: &Figures) -> Vec<String> {
        let mut why = Vec::new();
        let p99 = figures.latency_ms.p99;
        if p99 > self.p99_ms {
            why.push(format!("p99 is {p99:.1} ms"));
        }
        let counts = &figures.counts;
        let due = counts.right + counts.refused + counts.failed + counts.dropped;
        let share = counts.right as f64 / due.max(1) as f64;
        if due == 0 || share < self.right_share {
            why.push(format!("{} of {due} requests have a right answer", counts.right));
        }
        let slowed = underruns(figures);
        if slowed > 0.0 {
            why.push(format!("{slowed} underruns and missing frames"));
        }
        let plans = figures
            .live
            .map_or(f64::INFINITY, |live| live.plans_per_s_and_character);
        if plans < self.min_plans_per_s {
            why.push(format!("{plans:.2} plans a second and character"));
        }
        why
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{Counts, LiveFigures};

    #[test]
    fn every_missed_bound_is_a_reason() {
        let goal = Goal {
            p99_ms: 10.0,
            min_plans_per_s: 1.0,
            right_share: 0.999,
        };
        let mut figures = Figures {
            counts: Counts {
                right: 1000,
                ..Counts::default()
            },
            ..Figures::default()
        };
        figures.latency_ms.p99 = 9.0;
        assert_eq!(goal.misses(&figures), Vec::<String>::new());
        figures.latency_ms.p99 = 12.0;
        figures.counts.dropped = 20;
        figures.live = Some(LiveFigures {
            missed_ticks: 2,
            plans_per_s_and_character: 0.4,
            ..LiveFigures::default()
        });
        let why = goal.misses(&figures).join("; ");
        for wanted in ["12.0 ms", "1000 of 1020", "2 underruns", "0.40 plans"] {
            assert!(why.contains(wanted), "{why}");
        }
        assert!(
            !goal.misses(&Figures::default()).is_empty(),
            "nothing is no proof"
        );
    }
}

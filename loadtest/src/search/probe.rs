//! Tries the levels of a search on a server.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::steps::{Next, Search, SearchLimits};
use super::{SearchReport, SearchStep};
use crate::arrivals::{Stages, StagesError};
use crate::failure::Failure;
use crate::plan::{Load, Plan, Workload};
use crate::report::{Figures, Run, underruns};
use crate::run::once;
use crate::run::progress::Progress;

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Aim {
    /// Live characters.
    Characters,
    /// Requests a second.
    Rate,
}

/// What a level has to keep.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Goal {
    /// 99 % of latencies are at most this, milliseconds.
    pub p99_ms: f64,
    /// Plans a second and character, at least; 0: any.
    pub min_plans_per_s: f64,
    /// Share of what was due that is answered right, at least.
    pub right_share: f64,
}

impl Goal {
    /// Why a run does not keep the goal; empty where it does.
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
            why.push(format!("{} of {due} were answered right", counts.right));
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

/// The plan at a level.
fn at_level(plan: &Plan, level: f64) -> Result<Plan, Failure> {
    let mut plan = plan.clone();
    match &mut plan.workload {
        Workload::Calls {
            load: Load::Open { stages, .. },
            ..
        } => {
            *stages = Stages::hold(level, plan.measured_s)
                .map_err(|e: StagesError| Failure::Input(e.to_string()))?;
        }
        Workload::Drive(live) => live.characters = level as u32,
        Workload::Step(stepping) => stepping.live.characters = level as u32,
        Workload::Calls { .. } | Workload::Idle { .. } => {
            return Err(Failure::Input(
                "this workload has no level to search over; allowed: drive and step, or single requests in an open loop"
                    .to_owned(),
            ));
        }
    }
    Ok(plan)
}

/// Searches, and gives the search with the runs of the level that it found, the confirming ones included.
///
/// # Errors
/// See [`Failure`].
pub async fn search(
    plan: &Plan,
    aim: Aim,
    goal: Goal,
    limits: SearchLimits,
    progress: &Progress,
) -> Result<(SearchReport, Plan, Vec<Run>), Failure> {
    let mut state = Search::new(limits);
    let mut steps = Vec::new();
    let mut runs: Vec<(f64, Run)> = Vec::new();
    let unit = match aim {
        Aim::Characters => "characters",
        Aim::Rate => "requests/s",
    };
    let found = loop {
        let (level, confirms) = match state.next() {
            Next::Try { level, confirms } => (level, confirms),
            Next::Done(found) => break found,
        };
        let run = once(
            &at_level(plan, level)?,
            &progress.named(format!("{level} {unit}")),
        )
        .await?;
        let why = goal.misses(&run.figures);
        let verdict = if why.is_empty() {
            "holds".to_owned()
        } else {
            why.join(", ")
        };
        let again = if confirms { " again" } else { "" };
        let p99 = run.figures.latency_ms.p99;
        progress.note(format!("{level} {unit}{again}: p99 {p99:.1} ms; {verdict}"));
        steps.push(SearchStep {
            level,
            kept: why.is_empty(),
            confirms,
            p99_ms: p99,
            underruns: underruns(&run.figures),
            right_per_s: run.figures.throughput.requests_per_s,
            why,
        });
        state.tell(steps.last().is_some_and(|step| step.kept));
        runs.push((level, run));
    };
    let last = found.or(runs.last().map(|(level, _)| *level)).unwrap_or_default();
    let report = SearchReport {
        aim,
        goal,
        steps,
        found,
        at_limit: found.is_some_and(|found| found >= limits.most),
    };
    let runs = runs.into_iter().filter(|(level, _)| *level == last);
    Ok((report, at_level(plan, last)?, runs.map(|(_, run)| run).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Counts, LiveFigures};

    #[test]
    fn every_reason_is_told() {
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
        for told in ["12.0 ms", "1000 of 1020", "2 underruns", "0.40 plans"] {
            assert!(why.contains(told), "{why}");
        }
        assert!(
            !goal.misses(&Figures::default()).is_empty(),
            "nothing is no proof"
        );
    }
}

//! Tries the levels of a search on a server.

use super::goal::{Aim, Goal};
use super::report::{SearchReport, SearchStep};
use super::steps::{Next, Search, SearchLimits};
use crate::arrivals::{Stages, StagesError};
use crate::failure::Failure;
use crate::figures::{Run, underruns};
use crate::plan::{Load, Plan, Workload};
use crate::run::{Progress, once};

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

/// Searches for the highest level that meets the goal. Returns the report of the search, and the
/// plan and all runs of the level that it found.
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

//! Overload: requests arrive at several times the capacity of a server. The test measures the
//! latency of admitted requests, the server's memory, the underruns of live characters, and the
//! time until the server recovers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::arrivals::{LoadStage, Process, Stages};
use crate::failure::Failure;
use crate::figures::{Run, StageResult};
use crate::measure::FineBin;
use crate::plan::{Live, Load, Plan, Workload};
use crate::run::{Progress, once};

/// Length of the time bins by which recovery is measured, seconds.
pub const BIN_S: f64 = 0.1;
/// The server has recovered after this many normal bins in a row.
const STEADY_BINS: usize = 10;

/// The course of an overload.
#[derive(Debug, Clone, PartialEq)]
pub struct Overload {
    /// Requests a second that the server can answer. `None`: measured with clients that wait for
    /// their answers.
    pub capacity: Option<f64>,
    /// Number of clients that measure the capacity.
    pub clients: u32,
    /// Time to measure the capacity after the warm-up, seconds.
    pub probe_s: f64,
    /// Arrivals as a multiple of the capacity.
    pub factor: f64,
    /// Time at 90 % of capacity, seconds.
    pub before_s: f64,
    /// Time of the overload, seconds.
    pub seconds: f64,
    /// Time after the overload, seconds.
    pub after_s: f64,
    /// Arrivals after the overload, as a share of the capacity.
    pub after_share: f64,
    /// Maximum number of requests in flight per process.
    pub max_in_flight: u32,
    /// Live characters in addition to the requests.
    pub beside: Option<Live>,
}

/// Share of capacity that counts as normal.
const NORMAL: f64 = 0.9;

/// Figures of a server under overload.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OverloadReport {
    /// Requests a second that the server can answer.
    pub capacity_per_s: f64,
    /// Whether this test measured the capacity. Otherwise an option gave it.
    pub capacity_found: bool,
    /// Arrivals as a multiple of the capacity.
    pub factor: f64,
    /// The stage at 90 % of capacity.
    pub before: StageResult,
    /// The overload. Its latencies are those of admitted requests.
    pub during: StageResult,
    /// The stage after the overload.
    pub after: StageResult,
    /// p99 of admitted requests in the overload, divided by the p99 at 90 % of capacity.
    pub p99_ratio: f64,
    /// Share of requests that were refused in the overload.
    pub refused_share: f64,
    /// Time from the end of the overload to the start of the first normal second, in seconds. In a
    /// normal second no request is refused, and 90 % of requests stay below the p99 at 90 % of
    /// capacity. None: there was no such second.
    pub recovery_s: Option<f64>,
    /// The server's resident memory, if it reports it.
    pub memory: Option<OverloadMemory>,
    /// Live characters in addition to the requests.
    pub beside: Option<Beside>,
}

/// The server's resident memory, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct OverloadMemory {
    /// At the start of the overload.
    pub begin: u64,
    /// Maximum during the overload.
    pub peak: u64,
    /// Growth from the second quarter of the overload to the last. Memory that grows without bound
    /// shows here.
    pub growth_late: i64,
    /// At the end of the test.
    pub end: u64,
}

/// Live characters during an overload.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Beside {
    /// Number of characters.
    pub characters: u64,
    /// Frames that were slowed because a plan was late, at 90 % of capacity.
    pub slowed_before: u64,
    /// Slowed frames in the overload.
    pub slowed_during: u64,
    /// Slowed frames after the overload.
    pub slowed_after: u64,
    /// Frames that never came.
    pub missing: u64,
    /// 99th percentile of the delay of ticks, milliseconds.
    pub tick_p99_ms: f64,
}

/// Runs an overload with the single requests and the warm-up of `plan`.
///
/// # Errors
/// See [`Failure`].
pub async fn overload(
    plan: &Plan,
    of: &Overload,
    progress: &Progress,
) -> Result<(OverloadReport, Plan, Run), Failure> {
    let capacity = match of.capacity {
        Some(capacity) => capacity,
        None => find_capacity(plan, of, progress).await?,
    };
    if capacity <= 0.0 {
        return Err(Failure::Other(
            "the server gave no right answer while its capacity was measured".to_owned(),
        ));
    }
    progress.note(format!("capacity: {capacity:.1} requests/s"));
    let plan = overload_plan(plan, of, capacity)?;
    let name = format!("{}x", of.factor);
    let (run, beside) = beside(&plan, of, &progress.named(name)).await?;
    let report = report(&plan, of, capacity, &run, beside.as_ref())?;
    Ok((report, plan, run))
}

/// Runs the load, together with live characters if the plan has some.
async fn beside(plan: &Plan, of: &Overload, progress: &Progress) -> Result<(Run, Option<Run>), Failure> {
    let Some(live) = &of.beside else {
        return Ok((once(plan, progress).await?, None));
    };
    let live = Plan {
        workload: Workload::Drive(live.clone()),
        processes: 1,
        fine: false,
        ..plan.clone()
    };
    let quiet = Progress::quiet();
    let (run, beside) = tokio::join!(once(plan, progress), once(&live, &quiet));
    Ok((run?, Some(beside?)))
}

async fn find_capacity(plan: &Plan, of: &Overload, progress: &Progress) -> Result<f64, Failure> {
    let load = Load::Closed {
        stages: hold(f64::from(of.clients), of.probe_s)?,
        think_s: 0.0,
    };
    let plan = Plan {
        measured_s: of.probe_s,
        fine: false,
        ..with_load(plan, load)?
    };
    let (run, _) = beside(&plan, of, &progress.named("capacity")).await?;
    Ok(run.figures.throughput.requests_per_s)
}

fn hold(level: f64, seconds: f64) -> Result<Stages, Failure> {
    Stages::hold(level, seconds).map_err(|e| Failure::Input(e.to_string()))
}

fn with_load(plan: &Plan, new: Load) -> Result<Plan, Failure> {
    let mut plan = plan.clone();
    match &mut plan.workload {
        Workload::Calls { load, .. } => *load = new,
        _ => {
            return Err(Failure::Input(
                "an overload needs single requests; allowed: --workload inbetween, json, http".to_owned(),
            ));
        }
    }
    Ok(plan)
}

/// The plan of a load with three stages: at 90 % of capacity, above it, and below it.
fn overload_plan(plan: &Plan, of: &Overload, capacity: f64) -> Result<Plan, Failure> {
    let stage = |share: f64, seconds: f64| LoadStage {
        from: capacity * share,
        to: capacity * share,
        seconds,
    };
    let stages = Stages::new(vec![
        stage(NORMAL, of.before_s),
        stage(of.factor, of.seconds),
        stage(of.after_share, of.after_s),
    ])
    .map_err(|e| Failure::Input(e.to_string()))?;
    let load = Load::Open {
        process: Process::Poisson,
        stages,
        max_in_flight: of.max_in_flight,
    };
    Ok(Plan {
        measured_s: of.before_s + of.seconds + of.after_s,
        fine: true,
        ..with_load(plan, load)?
    })
}

fn report(
    plan: &Plan,
    of: &Overload,
    capacity: f64,
    run: &Run,
    beside: Option<&Run>,
) -> Result<OverloadReport, Failure> {
    let [before, during, after] = run.stages.as_slice() else {
        let stages = run.stages.len();
        return Err(Failure::Other(format!(
            "{stages} stages were measured instead of 3"
        )));
    };
    let counts = &during.counts;
    let answered = (counts.right + counts.refused + counts.failed).max(1);
    let normal_ms = before.latency_ms.p99;
    let end = plan.warmup_s + of.before_s + of.seconds;
    Ok(OverloadReport {
        capacity_per_s: capacity,
        capacity_found: of.capacity.is_none(),
        factor: of.factor,
        before: before.clone(),
        during: during.clone(),
        after: after.clone(),
        p99_ratio: during.latency_ms.p99 / normal_ms.max(1e-3),
        refused_share: counts.refused as f64 / answered as f64,
        recovery_s: recovery(&run.fine, end, end + of.after_s, normal_ms),
        memory: memory(of, run),
        beside: beside.map(|run| beside_report(of, run)),
    })
}

/// Seconds from the end of the overload until the server has recovered. Bins count from the start
/// of the load. All times are in seconds.
fn recovery(bins: &[FineBin], end: f64, stop: f64, normal_ms: f64) -> Option<f64> {
    let (first, last) = ((end / BIN_S).ceil() as usize, (stop / BIN_S).floor() as usize);
    let tail = bins.get(first..last.min(bins.len()))?;
    let usual = |bin: &FineBin| bin.other == 0 && bin.quantile_ms(0.9) <= normal_ms;
    let place = tail
        .windows(STEADY_BINS)
        .position(|bins| bins.iter().all(usual))?;
    Some((first + place) as f64 * BIN_S - end)
}

fn memory(of: &Overload, run: &Run) -> Option<OverloadMemory> {
    let rows = &run.server_series;
    let (begin, end) = (of.before_s, of.before_s + of.seconds);
    let between = |from: f64, to: f64| {
        let rows = rows.iter().filter(move |row| row.t >= from && row.t <= to);
        rows.map(|row| row.rss_bytes).max()
    };
    let quarter = of.seconds / 4.0;
    let first = rows.iter().rev().find(|row| row.t <= begin)?;
    let (early, late) = (
        between(begin + quarter, begin + 2.0 * quarter),
        between(end - quarter, end),
    );
    let growth = i64::try_from(late.unwrap_or(0)).ok()? - i64::try_from(early.unwrap_or(0)).ok()?;
    Some(OverloadMemory {
        begin: first.rss_bytes,
        peak: between(begin, end)?,
        growth_late: growth,
        end: rows.last()?.rss_bytes,
    })
}

fn beside_report(of: &Overload, run: &Run) -> Beside {
    let (begin, end) = (of.before_s, of.before_s + of.seconds);
    let slowed = |from: f64, to: f64| {
        let rows = run.series.iter().filter(move |row| row.t >= from && row.t < to);
        rows.map(|row| row.slowed).sum()
    };
    let live = run.figures.live.unwrap_or_default();
    Beside {
        characters: live.characters,
        slowed_before: slowed(0.0, begin),
        slowed_during: slowed(begin, end),
        slowed_after: slowed(end, f64::INFINITY),
        missing: live.missing_frames + live.faults,
        tick_p99_ms: run.figures.latency_ms.p99,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bin(latency_ms: u32, other: u32) -> FineBin {
        FineBin {
            latencies_us: vec![latency_ms * 1000; 10],
            other,
        }
    }

    #[test]
    fn recovery_is_the_begin_of_the_first_usual_second() {
        // 2 s of overload, 0.4 s of late answers, a refusal at 0.9 s, then normal bins. The last
        // bin is late.
        let mut bins = vec![bin(500, 9); 20];
        bins.extend(vec![bin(300, 0); 4]);
        bins.extend(vec![bin(10, 0); 5]);
        bins.push(bin(10, 1));
        bins.extend(vec![bin(10, 0); 15]);
        bins.push(bin(300, 0));
        let found = recovery(&bins, 2.0, 10.0, 20.0).unwrap();
        assert!((found - 1.0).abs() < 1e-9, "{found}");
        assert_eq!(recovery(&bins[..36], 2.0, 10.0, 5.0), None);
        assert_eq!(recovery(&[], 2.0, 10.0, 5.0), None);
        let at_once = vec![bin(3, 0); 40];
        assert_eq!(recovery(&at_once, 2.0, 4.0, 20.0), Some(0.0));
    }

    #[test]
    fn few_late_answers_in_a_bin_are_usual() {
        let mut usual = bin(10, 0);
        usual.latencies_us[3] = 900_000;
        assert_eq!(recovery(&vec![usual; 20], 0.0, 2.0, 20.0), Some(0.0));
    }
}

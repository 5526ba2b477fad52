//! The clock of a process that runs a load, and readings of its resources.

use std::time::Duration;

use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::failure::Failure;
use crate::measure::{Clock, Harvest, OwnUse, ProcessWatch, Recorder, sampling_times};
use crate::plan::Plan;

/// Time between the end of the preparation and the start of the load, so that no process starts
/// late.
pub(super) const HEAD_START: Duration = Duration::from_millis(200);

/// The clock of a plan's load that starts at `start`.
pub(super) fn clock(plan: &Plan, start: Instant) -> Clock {
    let clock = Clock::new(start, plan.warmup(), plan.measured()).fine(plan.fine);
    match plan.stages() {
        Some(stages) => clock.stages(stages),
        None => clock,
    }
}

/// All records, with the resources of this process.
pub(super) async fn finish(recorder: &Recorder, own: JoinHandle<OwnUse>) -> Result<Harvest, Failure> {
    let own = own
        .await
        .map_err(|e| Failure::Other(format!("cannot read the resources of this process: {e}")))?;
    Ok(Harvest {
        own,
        ..recorder.harvest()
    })
}

/// Reads the resources of this process during the load, at the times of the scrapes.
pub(super) async fn own_use(clock: Clock) -> OwnUse {
    let mut watch = ProcessWatch::default();
    let mut used = OwnUse {
        processes: 1,
        ..OwnUse::default()
    };
    let mut begin = None;
    for at in sampling_times(&clock) {
        sleep_until(at).await;
        let (cpu, rss) = watch.look();
        let cpu = cpu.as_secs_f64();
        used.note(
            at.saturating_duration_since(clock.start()).as_secs_f64(),
            cpu,
            rss,
        );
        if at >= clock.measured_from() {
            used.cpu_s = cpu - *begin.get_or_insert(cpu);
        }
    }
    used
}

//! The clock of a process that makes load, and readings of its resources.

use std::time::Duration;

use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::failure::Failure;
use crate::measure::{Clock, Harvest, OwnUse, ProcessWatch, Recorder, sampling_times};
use crate::plan::Plan;

/// Time from ready to the start of the load, so that no process starts late.
pub(super) const HEAD_START: Duration = Duration::from_millis(200);

/// The times of a plan's load that starts at a moment.
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
        .map_err(|e| Failure::Other(format!("looking at this process failed: {e}")))?;
    Ok(Harvest {
        own,
        ..recorder.harvest()
    })
}

/// Readings of this process during the load, at the moments of the scrapes.
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

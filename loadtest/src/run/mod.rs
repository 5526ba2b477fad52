//! Carries a plan out: gets ready, begins, watches, gathers.

pub mod closed;
pub mod open;
pub mod pace;
pub mod processes;
pub mod progress;

use std::sync::Arc;
use std::time::Duration;

use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::failure::Failure;
use crate::measure::{Clock, Harvest, OwnUse, ProcessWatch, Recorder, Scraper, sampling_times};
use crate::plan::Plan;
use crate::report::{self, Ingredients, Run};
use crate::workloads::{Share, prepare};
use progress::Progress;

/// From when all is ready to the begin of the load, so that no process begins late.
pub const HEAD_START: Duration = Duration::from_millis(200);

/// The times of a plan's load that begins at a moment.
pub fn clock(plan: &Plan, start: Instant) -> Clock {
    let clock = Clock::new(start, plan.warmup(), plan.measured()).fine(plan.fine);
    match plan.stages() {
        Some(stages) => clock.stages(stages),
        None => clock,
    }
}

/// Carries a plan out once.
///
/// # Errors
/// See [`Failure`]. What goes wrong with single requests is in the report and no failure.
pub async fn once(plan: &Plan, progress: &Progress) -> Result<Run, Failure> {
    let scraper = match plan.metrics_address() {
        Some(address) => Scraper::find(address).await,
        None => None,
    };
    let before = match &scraper {
        Some(scraper) => scraper.scrape().await,
        None => None,
    };
    let follow = |clock: Clock| scraper.map(|scraper| tokio::spawn(scraper.follow(clock)));
    let (harvest, scrapes) = if plan.processes > 1 {
        let workers = processes::Workers::spawn(plan).await?;
        let start = Instant::now() + HEAD_START;
        let scrapes = follow(clock(plan, start));
        (workers.carry_out(plan, start, progress).await?, scrapes)
    } else {
        let prepared = prepare(plan, Share::WHOLE).await?;
        let start = Instant::now() + HEAD_START;
        let scrapes = follow(clock(plan, start));
        let recorder = Arc::new(Recorder::new(clock(plan, start)));
        let shown = progress.follow(plan, recorder.clone());
        let own = tokio::spawn(own_use(recorder.clock().clone()));
        let done = prepared.carry_out(plan, Share::WHOLE, &recorder).await;
        shown.abort();
        done?;
        (finish(&recorder, own).await?, scrapes)
    };
    progress.done();
    let scrapes = match scrapes {
        Some(task) => task.await.ok(),
        None => None,
    };
    let ingredients = Ingredients {
        harvest,
        scrapes,
        rss_before_bytes: before
            .and_then(|metrics| metrics.sum("process_resident_memory_bytes", &[]))
            .unwrap_or_default() as u64,
    };
    Ok(report::run(plan, &ingredients))
}

/// All that was noted, with what this process used.
async fn finish(recorder: &Recorder, own: JoinHandle<OwnUse>) -> Result<Harvest, Failure> {
    let own = own
        .await
        .map_err(|e| Failure::Other(format!("looking at this process failed: {e}")))?;
    Ok(Harvest {
        own,
        ..recorder.harvest()
    })
}

/// What this process uses while the load goes on, looked at whenever the server is.
async fn own_use(clock: Clock) -> OwnUse {
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

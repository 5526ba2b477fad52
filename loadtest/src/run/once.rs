//! Runs a plan once: prepares and starts the load, follows it, and collects its figures.

use std::sync::Arc;

use tokio::time::Instant;

use super::process::{HEAD_START, clock, finish, own_use};
use super::processes::Workers;
use super::progress::Progress;
use crate::failure::Failure;
use crate::figures::{self, Ingredients, Run};
use crate::measure::{Clock, Recorder, Scraper};
use crate::plan::{Plan, Share};
use crate::workloads::prepare;

/// Runs a plan once.
///
/// # Errors
/// See [`Failure`]. Failed requests are counted in the report and do not cause an error.
pub async fn once(plan: &Plan, progress: &Progress) -> Result<Run, Failure> {
    let scraper = match plan.metrics_address() {
        Some(address) => Scraper::find(address, &plan.access).await,
        None => None,
    };
    let before = match &scraper {
        Some(scraper) => scraper.scrape().await,
        None => None,
    };
    let follow = |clock: Clock| scraper.map(|scraper| tokio::spawn(scraper.follow(clock)));
    let (harvest, scrapes) = if plan.processes > 1 {
        let workers = Workers::spawn(plan).await?;
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
    Ok(figures::run(plan, &ingredients))
}

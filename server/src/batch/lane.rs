//! A lane: the thread that owns a pipeline, and cuts its own batches.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::oneshot;

use super::core::{Batch, Outbox, Pieces, Ran};
use super::driver::{EngineFactory, Shared};
use super::scheduler::Part;
use crate::engine::{EngineError, Pipeline, RowAnswer, StageTimes};

/// Makes the lane's pipeline, and runs batches until there is nobody left to ask for them.
pub(super) fn run(
    shared: Arc<Shared>,
    number: usize,
    factory: &EngineFactory,
    started: oneshot::Sender<Result<(), EngineError>>,
) {
    let mut pipeline = match factory(number) {
        Ok(pipeline) => pipeline,
        Err(error) => {
            // Nobody to tell: the start was given up.
            let _ = started.send(Err(error));
            return;
        }
    };
    shared.lane_starts(number, pipeline.trial());
    if started.send(Ok(())).is_err() {
        return;
    }
    Lane {
        shared,
        number,
        parts: Vec::new(),
        outbox: Outbox::default(),
    }
    .serve(&mut pipeline);
}

/// A lane that runs. Where it is dropped by a panic, what it had fails, and the other lanes serve on.
struct Lane {
    shared: Arc<Shared>,
    number: usize,
    /// What it runs.
    parts: Vec<Part>,
    outbox: Outbox,
}

impl Lane {
    fn serve(mut self, pipeline: &mut Pipeline) {
        let mut ready = None;
        let mut ended: Option<Instant> = None;
        loop {
            let waited = ready.is_none();
            let Some(batch) = ready.or_else(|| self.shared.next_batch(self.number)) else {
                return;
            };
            let Batch { items, parts, reason } = batch;
            self.parts = parts;
            let started = Instant::now();
            self.shared.gauge.began(self.number, started);
            self.shared.metrics.dispatched(reason, items.len());
            for part in self.parts.iter().filter(|part| part.first == 0) {
                self.shared.metrics.queued(part.class, part.waited);
            }
            if let Some(ended) = ended.filter(|_| !waited) {
                self.shared.metrics.lane_gap(started - ended);
            }
            // A pipeline fills what it reads anew for every batch, so a panic leaves nothing behind in it.
            let result = catch_unwind(AssertUnwindSafe(|| pipeline.run(&items)))
                .unwrap_or_else(|payload| Err(EngineError::Panicked(panic_message(&*payload))));
            let now = Instant::now();
            let served = result.as_ref().map_or(0, |(answers, _)| answers.len());
            self.shared.gauge.ended(self.number, now, served);
            ended = Some(now);
            let parts = std::mem::take(&mut self.parts);
            let (pieces, times) = pieces(parts, result);
            if times.bucket > 0 {
                self.shared.metrics.ran(&times, items.len());
            }
            let ran = Ran {
                started,
                ended: now,
                times,
            };
            ready = self
                .shared
                .finish(self.number, &ran, items.len(), pieces, &mut self.outbox);
            self.outbox.send();
        }
    }
}

impl Drop for Lane {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let parts = std::mem::take(&mut self.parts);
            self.shared.lane_lost(self.number, parts);
        }
    }
}

/// Parts a batch's answers by request, and logs what failed.
fn pieces(
    parts: Vec<Part>,
    result: Result<(Vec<RowAnswer>, StageTimes), EngineError>,
) -> (Pieces, StageTimes) {
    match result {
        Ok((answers, times)) => {
            for error in answers.iter().filter_map(|answer| answer.as_ref().err()) {
                tracing::error!(%error, "a character failed");
            }
            let mut answers = answers.into_iter();
            let of_part = |part: Part| {
                let answers = answers.by_ref().take(part.characters);
                (part, answers.collect())
            };
            (parts.into_iter().map(of_part).collect(), times)
        }
        Err(error) => {
            tracing::error!(%error, "a batch failed");
            let failed = parts.into_iter().map(|part| (part, Err(error.clone())));
            (failed.collect(), StageTimes::default())
        }
    }
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("it gave no reason")
        .to_owned()
}

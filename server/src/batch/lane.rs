//! A lane: the thread that owns a pipeline, and cuts its own batches.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::oneshot;

use super::core::{Batch, Made, Outbox, Pieces, Ran};
use super::driver::{EngineFactory, Shared};
use super::order::Class;
use super::scheduler::Part;
use troupe_engine::{EngineError, MadeRow, Pipeline, StageTimes};
use troupe_motion::model::KeyframeTask;

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
        open: Unanswered::of(Vec::new(), Instant::now()),
        outbox: Outbox::default(),
    }
    .serve(&mut pipeline);
}

/// A lane that runs. Where it is dropped by a panic, what it had fails, and the other lanes serve on.
struct Lane {
    shared: Arc<Shared>,
    number: usize,
    /// What it runs.
    open: Unanswered,
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
            let started = Instant::now();
            self.shared.gauge.began(self.number, started);
            self.shared.metrics.dispatched(reason, items.len());
            for part in parts.iter().filter(|part| part.first == 0) {
                self.shared.metrics.queued(part.class, part.waited);
            }
            if let Some(ended) = ended.filter(|_| !waited) {
                self.shared.metrics.lane_gap(started - ended);
            }
            self.open = Unanswered::of(parts, started);
            let result = self.run(pipeline, &items);
            let now = Instant::now();
            ended = Some(now);
            let (mut pieces, mut ran) = self.open.take_whole(now);
            self.shared.gauge.ended(self.number, now, self.open.served);
            match result {
                Ok(()) => self.shared.metrics.ran(&ran.times, items.len()),
                Err(error) => {
                    tracing::error!(%error, "a batch failed");
                    ran.times.alike = 0;
                    pieces.extend(self.open.fail(&error));
                }
            }
            ready = self.shared.finish(self.number, &ran, pieces, &mut self.outbox);
            self.outbox.send();
        }
    }

    /// Runs a batch. What is there before its end is handed out at once, so that nobody waits for calls of the engine that come
    /// after their own, unless a full batch waits. The last stay in `open`.
    fn run(&mut self, pipeline: &mut Pipeline, items: &[KeyframeTask]) -> Result<(), EngineError> {
        let (shared, number) = (&self.shared, self.number);
        let (open, outbox) = (&mut self.open, &mut self.outbox);
        let mut made = |times: &StageTimes, rows| {
            open.note(times, rows);
            // Live characters need their plans by a time of their own, whoever else waits.
            if open.is_all_made() || (shared.full_batch_waits() && !open.is_live) {
                return;
            }
            let (pieces, ran) = open.take_whole(Instant::now());
            if !pieces.is_empty() {
                shared.deliver_early(number, &ran, pieces, outbox);
            }
        };
        // A pipeline fills what it reads anew for every batch, so a panic leaves nothing behind in it.
        let run = catch_unwind(AssertUnwindSafe(|| pipeline.run_by_calls(items, &mut made)))
            .unwrap_or_else(|payload| Err(EngineError::Panicked(panic_message(&*payload))));
        self.open.times = run?;
        Ok(())
    }
}

impl Drop for Lane {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let parts = self.open.parts.drain(..).map(|(part, _)| part).collect();
            self.shared.lane_lost(self.number, parts);
        }
    }
}

/// The requests of a batch that are not answered, and what there is for them.
struct Unanswered {
    started: Instant,
    /// Where the batch's time has gone so far.
    times: StageTimes,
    /// With the place in the batch of its first character.
    parts: Vec<(Part, usize)>,
    /// By the place in the batch, until they are taken out.
    rows: Vec<Option<MadeRow>>,
    /// How many were made, and how many of these were taken out and are no errors.
    made: usize,
    served: usize,
    /// Plans of live characters are in the batch.
    is_live: bool,
}

impl Unanswered {
    fn of(parts: Vec<Part>, started: Instant) -> Self {
        let mut rows = 0;
        let is_live = parts.iter().any(|part| part.class == Class::Live);
        let place = |part: Part| {
            let first = rows;
            rows += part.characters;
            (part, first)
        };
        let parts = parts.into_iter().map(place).collect();
        Self {
            started,
            times: StageTimes::default(),
            parts,
            rows: std::iter::repeat_with(|| None).take(rows).collect(),
            made: 0,
            served: 0,
            is_live,
        }
    }

    fn is_all_made(&self) -> bool {
        self.made == self.rows.len()
    }

    fn note(&mut self, times: &StageTimes, rows: Vec<MadeRow>) {
        self.times = *times;
        self.made += rows.len();
        for made in rows {
            if let Err(error) = &made.answer {
                tracing::error!(%error, "a character failed");
            }
            let place = made.row;
            self.rows[place] = Some(made);
        }
    }

    /// Takes those out of which all characters are there.
    fn take_whole(&mut self, now: Instant) -> (Pieces, Ran) {
        let rows = &mut self.rows;
        let whole = self.parts.extract_if(.., |(part, first)| {
            rows[*first..*first + part.characters].iter().all(Option::is_some)
        });
        let parts: Vec<(Part, usize)> = whole.collect();
        let piece = |(part, first): (Part, usize)| {
            let made = joined(&mut rows[first..first + part.characters]);
            if made.is_ok() {
                self.served += part.characters;
            }
            (part, made)
        };
        let pieces = parts.into_iter().map(piece).collect();
        let ran = Ran {
            started: self.started,
            ended: now,
            times: self.times,
            size: self.rows.len(),
        };
        (pieces, ran)
    }

    /// Takes all out: they fail.
    fn fail(&mut self, error: &EngineError) -> Pieces {
        let parts = self.parts.drain(..);
        parts.map(|(part, _)| (part, Err(error.clone()))).collect()
    }
}

/// Takes what there is for the characters of one request; an error of one is that of all.
fn joined(rows: &mut [Option<MadeRow>]) -> Result<Made, EngineError> {
    let mut all = Made::default();
    for made in rows.iter_mut().filter_map(Option::take) {
        all.motions.push(made.answer?);
        all.work += made.work;
    }
    Ok(all)
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("it gave no reason")
        .to_owned()
}

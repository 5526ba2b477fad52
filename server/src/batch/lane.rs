//! A lane: the thread that owns a pipeline, and cuts its own batches.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::oneshot;

use super::core::{Batch, Outbox, Pieces, Ran};
use super::driver::{EngineFactory, Shared};
use super::scheduler::Part;
use crate::engine::{EngineError, Pipeline, RowAnswer, RowAnswers, StageTimes, WorkItem};

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
        open: Unanswered::default(),
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
            self.open = Unanswered::of(parts);
            let result = self.run(pipeline, &items, started);
            let now = Instant::now();
            self.shared.gauge.ended(self.number, now, self.open.answered());
            ended = Some(now);
            let mut pieces = self.open.take_whole();
            let times = result.unwrap_or_else(|error| {
                tracing::error!(%error, "a batch failed");
                pieces.extend(self.open.fail(&error));
                StageTimes::default()
            });
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

    /// Runs a batch. What is there before its end is handed out at once, so that nobody waits for calls of the engine that come
    /// after their own, unless a full batch waits. The last stay in `open`.
    fn run(
        &mut self,
        pipeline: &mut Pipeline,
        items: &[WorkItem],
        started: Instant,
    ) -> Result<StageTimes, EngineError> {
        let (shared, number) = (&self.shared, self.number);
        let (open, outbox) = (&mut self.open, &mut self.outbox);
        let mut answered = |times: &StageTimes, answers| {
            open.note(answers);
            if open.answered() == items.len() || shared.full_batch_waits() {
                return;
            }
            let pieces = open.take_whole();
            if !pieces.is_empty() {
                let ran = Ran {
                    started,
                    ended: Instant::now(),
                    times: *times,
                };
                shared.deliver_early(number, &ran, items.len(), pieces, outbox);
            }
        };
        // A pipeline fills what it reads anew for every batch, so a panic leaves nothing behind in it.
        catch_unwind(AssertUnwindSafe(|| pipeline.run_by_calls(items, &mut answered)))
            .unwrap_or_else(|payload| Err(EngineError::Panicked(panic_message(&*payload))))
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
#[derive(Default)]
struct Unanswered {
    /// With the place in the batch of its first character.
    parts: Vec<(Part, usize)>,
    /// By the place in the batch, until they are handed out.
    answers: Vec<Option<RowAnswer>>,
    /// How many have come.
    answered: usize,
}

impl Unanswered {
    fn of(parts: Vec<Part>) -> Self {
        let mut rows = 0;
        let place = |part: Part| {
            let first = rows;
            rows += part.characters;
            (part, first)
        };
        let parts = parts.into_iter().map(place).collect();
        Self {
            parts,
            answers: std::iter::repeat_with(|| None).take(rows).collect(),
            answered: 0,
        }
    }

    fn answered(&self) -> usize {
        self.answered
    }

    fn note(&mut self, answers: RowAnswers) {
        self.answered += answers.len();
        for (row, answer) in answers {
            if let Err(error) = &answer {
                tracing::error!(%error, "a character failed");
            }
            self.answers[row] = Some(answer);
        }
    }

    /// Takes those out of which all characters are there.
    fn take_whole(&mut self) -> Pieces {
        let answers = &mut self.answers;
        let whole = self.parts.extract_if(.., |(part, first)| {
            answers[*first..*first + part.characters]
                .iter()
                .all(Option::is_some)
        });
        let parts: Vec<(Part, usize)> = whole.collect();
        let piece = |(part, first): (Part, usize)| {
            let rows = &mut answers[first..first + part.characters];
            (part, rows.iter_mut().filter_map(Option::take).collect())
        };
        parts.into_iter().map(piece).collect()
    }

    /// Takes all out: they fail.
    fn fail(&mut self, error: &EngineError) -> Pieces {
        let parts = self.parts.drain(..);
        parts.map(|(part, _)| (part, Err(error.clone()))).collect()
    }
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("it gave no reason")
        .to_owned()
}

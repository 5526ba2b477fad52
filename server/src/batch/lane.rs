//! A lane: the thread that owns a pipeline, and cuts its own batches.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::core::{Batch, Outbox, Pieces, Ran};
use super::driver::{EngineFactory, Shared};
use super::order::Class;
use super::scheduler::Part;
use crate::engine::{EngineError, Pipeline, RawMotion, RowAnswer, RowAnswers, StageTimes, WorkItem};

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
    fn run(&mut self, pipeline: &mut Pipeline, items: &[WorkItem]) -> Result<(), EngineError> {
        let (shared, number) = (&self.shared, self.number);
        let (open, outbox) = (&mut self.open, &mut self.outbox);
        let mut made = |times: &StageTimes, answers| {
            open.note(times, answers);
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
    /// Where the batch's time has gone so far, and how much of that was put to what was taken out.
    times: StageTimes,
    charged: Duration,
    /// With the place in the batch of its first character.
    parts: Vec<(Part, usize)>,
    /// By the place in the batch, until they are taken out.
    answers: Vec<Option<RowAnswer>>,
    /// How many were made, and how many of these were taken out and are no errors.
    made: usize,
    served: usize,
    /// Plans of live characters are among them.
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
            charged: Duration::ZERO,
            parts,
            answers: std::iter::repeat_with(|| None).take(rows).collect(),
            made: 0,
            served: 0,
            is_live,
        }
    }

    fn is_all_made(&self) -> bool {
        self.made == self.answers.len()
    }

    fn note(&mut self, times: &StageTimes, answers: RowAnswers) {
        self.times = *times;
        self.made += answers.len();
        for (row, answer) in answers {
            if let Err(error) = &answer {
                tracing::error!(%error, "a character failed");
            }
            self.answers[row] = Some(answer);
        }
    }

    /// Takes those out of which all characters are there.
    fn take_whole(&mut self, now: Instant) -> (Pieces, Ran) {
        let answers = &mut self.answers;
        let whole = self.parts.extract_if(.., |(part, first)| {
            answers[*first..*first + part.characters]
                .iter()
                .all(Option::is_some)
        });
        let parts: Vec<(Part, usize)> = whole.collect();
        let characters: usize = parts.iter().map(|(part, _)| part.characters).sum();
        let piece = |(part, first): (Part, usize)| {
            let rows = &mut answers[first..first + part.characters];
            let motions: Result<Vec<RawMotion>, EngineError> =
                rows.iter_mut().filter_map(Option::take).collect();
            if motions.is_ok() {
                self.served += part.characters;
            }
            (part, motions)
        };
        let pieces = parts.into_iter().map(piece).collect();
        let ran = Ran {
            started: self.started,
            ended: now,
            times: self.times,
            work: self.charge(characters),
            size: self.answers.len(),
        };
        (pieces, ran)
    }

    /// The time for each of so many characters that are taken out, where they share what was not put to others.
    fn charge(&mut self, characters: usize) -> Duration {
        if characters == 0 {
            return Duration::ZERO;
        }
        let StageTimes {
            assemble, scatter, ..
        } = self.times;
        let total = assemble + self.times.inference() + scatter;
        let rest = total.saturating_sub(std::mem::replace(&mut self.charged, total));
        rest / characters as u32
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::scheduler::RequestId;

    fn part(request: u64, characters: usize) -> Part {
        Part {
            request: RequestId(request),
            class: Class::Request,
            first: 0,
            characters,
            waited: Duration::ZERO,
        }
    }

    /// Times of a batch of which the decoder has run for so long.
    fn after(ms: u64) -> StageTimes {
        StageTimes {
            decoder: Duration::from_millis(ms),
            ..StageTimes::default()
        }
    }

    #[test]
    fn the_work_of_a_batch_comes_to_its_whole_time() {
        let mut open = Unanswered::of(vec![part(0, 1), part(1, 3), part(2, 2)], Instant::now());
        let mut work = Duration::ZERO;
        let mut sizes = Vec::new();
        for (ms, rows) in [(7, vec![0, 1]), (8, vec![]), (30, vec![2, 3, 4]), (40, vec![5])] {
            let answers = rows.into_iter().map(|row| (row, Ok(RawMotion::default())));
            open.note(&after(ms), answers.collect());
            let (pieces, ran) = open.take_whole(Instant::now());
            let taken: usize = pieces.iter().map(|(part, _)| part.characters).sum();
            work += ran.work * taken as u32;
            sizes.push(taken);
        }
        assert_eq!(sizes, [1, 0, 3, 2]);
        assert!(
            work.abs_diff(after(40).decoder) < Duration::from_micros(1),
            "{work:?}"
        );
        assert!(open.is_all_made() && open.served == 6);
    }
}

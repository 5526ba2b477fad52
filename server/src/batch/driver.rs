//! The scheduler's driver: keeps the waiting work, feeds events, carries out actions.

use std::any::Any;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc as blocking;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};

use super::scheduler::{Action, Cut, Event, Limits, Part, RequestId, Scheduler};
use crate::engine::{EngineError, Pipeline, RawMotion, RowAnswer, StageTimes, WorkItem};
use crate::telemetry::PackMetrics;

/// Makes an engine, on the thread that will own it.
pub type EngineFactory = Box<dyn FnOnce() -> Result<Pipeline, EngineError> + Send>;

/// Requests that may be on their way to the driver; its own queue is bounded in characters.
const INBOX: usize = 1024;
/// When it is worth to try again where the inbox is full: the driver empties it in one go.
const FULL_INBOX_RETRY: Duration = Duration::from_millis(10);

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// The queue has no room for the request.
    #[error("{pending_characters} characters are waiting")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// Inference failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// A served request.
#[derive(Debug, Default)]
pub struct Served {
    /// One answer a character, in the request's order.
    pub motions: Vec<RawMotion>,
    /// From the arrival at the batcher to the cut of the first batch.
    pub queued: Duration,
    /// Filling inputs, over all batches that carried the request.
    pub assemble: Duration,
    /// The three stages, over all batches that carried the request.
    pub inference: Duration,
    /// Copying out of the output tensors, over all batches that carried the request.
    pub scatter: Duration,
    /// Characters of the largest batch that carried the request.
    pub batch_size: usize,
}

/// The way to a pack's engine. Clones share it; the engine ends when the last one is gone.
#[derive(Debug, Clone)]
pub struct Batcher {
    inbox: mpsc::Sender<Submission>,
    running: Arc<AtomicBool>,
}

#[derive(Debug)]
struct Submission {
    items: Vec<WorkItem>,
    arrived: Instant,
    reply: oneshot::Sender<Result<Served, SubmitError>>,
}

impl Batcher {
    /// Starts the engine's thread, and answers when `factory` has made (and warmed up) the engine.
    ///
    /// # Errors
    /// What `factory` fails with, or [`EngineError::Stopped`] where its thread ends without a word.
    pub async fn start(
        name: &str,
        limits: Limits,
        metrics: PackMetrics,
        factory: EngineFactory,
    ) -> Result<Self, EngineError> {
        // One batch at a time is with the engine, so one place each way is all there can be.
        let (batches, engine_inbox) = blocking::sync_channel(1);
        let (engine_outbox, done) = mpsc::channel(1);
        let (started, starting) = oneshot::channel();
        std::thread::Builder::new()
            .name(format!("engine-{name}"))
            .spawn(move || own_engine(factory, started, &engine_inbox, &engine_outbox))
            .map_err(|error| EngineError::Library(format!("cannot start the engine's thread: {error}")))?;
        starting.await.map_err(|_| EngineError::Stopped)??;

        let (inbox, submissions) = mpsc::channel(INBOX);
        let running = Arc::new(AtomicBool::new(true));
        let driver = Driver::new(limits, metrics, batches, running.clone());
        tokio::spawn(driver.run(submissions, done));
        Ok(Self { inbox, running })
    }

    /// Whether the engine's thread is alive.
    pub fn is_running(&self) -> bool {
        self.running.load(Ordering::Relaxed)
    }

    /// Has `items` served, alone or together with what other callers ask for. A caller that drops the future gives up
    /// its place: what is not yet cut is not run.
    ///
    /// # Errors
    /// [`SubmitError`], for the whole request.
    pub async fn submit(&self, items: Vec<WorkItem>) -> Result<Served, SubmitError> {
        let (submission, answer) = Submission::new(items);
        self.inbox
            .send(submission)
            .await
            .map_err(|_| EngineError::Stopped)?;
        answer.await.map_err(|_| EngineError::Stopped)?
    }

    /// [`Batcher::submit`] for a caller who must not wait: `items` have a place, or not, when this returns. The future
    /// that it gives is the answer; dropping it gives up the place.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`] where there is no room on the way to the queue. The queue itself may still refuse.
    pub fn enqueue(
        &self,
        items: Vec<WorkItem>,
    ) -> Result<impl Future<Output = Result<Served, SubmitError>> + Send + use<>, SubmitError> {
        let (submission, answer) = Submission::new(items);
        self.inbox.try_send(submission).map_err(|error| match error {
            mpsc::error::TrySendError::Full(_) => SubmitError::QueueFull {
                pending_characters: INBOX,
                retry_after: FULL_INBOX_RETRY,
            },
            mpsc::error::TrySendError::Closed(_) => EngineError::Stopped.into(),
        })?;
        Ok(async { answer.await.map_err(|_| EngineError::Stopped)? })
    }
}

impl Submission {
    fn new(items: Vec<WorkItem>) -> (Self, oneshot::Receiver<Result<Served, SubmitError>>) {
        let (reply, answer) = oneshot::channel();
        let submission = Self {
            items,
            arrived: Instant::now(),
            reply,
        };
        (submission, answer)
    }
}

type Finished = Result<(Vec<RowAnswer>, StageTimes), EngineError>;

fn own_engine(
    factory: EngineFactory,
    started: oneshot::Sender<Result<(), EngineError>>,
    batches: &blocking::Receiver<Vec<WorkItem>>,
    done: &mpsc::Sender<Finished>,
) {
    let mut pipeline = match factory() {
        Ok(pipeline) => pipeline,
        Err(error) => {
            // Nobody to tell: the start was given up.
            let _ = started.send(Err(error));
            return;
        }
    };
    if started.send(Ok(())).is_err() {
        return;
    }
    while let Ok(items) = batches.recv() {
        // A pipeline fills what it reads anew for every batch, so a panic leaves nothing behind in it.
        let finished = catch_unwind(AssertUnwindSafe(|| pipeline.run(&items)))
            .unwrap_or_else(|payload| Err(EngineError::Panicked(panic_message(&*payload))));
        if done.blocking_send(finished).is_err() {
            return;
        }
    }
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("it gave no reason")
        .to_owned()
}

/// A request that the scheduler knows.
struct Job {
    /// What is not yet cut; taken from the front, in step with the scheduler's parts.
    items: std::vec::IntoIter<WorkItem>,
    characters: usize,
    served: Served,
    first_cut: bool,
    reply: oneshot::Sender<Result<Served, SubmitError>>,
}

struct Driver {
    scheduler: Scheduler,
    jobs: HashMap<RequestId, Job>,
    next_id: u64,
    /// The parts of the batch that the engine has.
    in_flight: Vec<Part>,
    /// How long a full batch takes, smoothed; the base of retry hints.
    batch_time: Duration,
    max_batch: usize,
    batches: blocking::SyncSender<Vec<WorkItem>>,
    running: Arc<AtomicBool>,
    metrics: PackMetrics,
}

impl Driver {
    fn new(
        limits: Limits,
        metrics: PackMetrics,
        batches: blocking::SyncSender<Vec<WorkItem>>,
        running: Arc<AtomicBool>,
    ) -> Self {
        Self {
            scheduler: Scheduler::new(limits),
            jobs: HashMap::new(),
            next_id: 0,
            in_flight: Vec::new(),
            batch_time: Duration::from_millis(50),
            max_batch: limits.max_batch,
            batches,
            running,
            metrics,
        }
    }

    async fn run(mut self, mut submissions: mpsc::Receiver<Submission>, mut done: mpsc::Receiver<Finished>) {
        let mut arrivals = Vec::with_capacity(INBOX);
        let mut open = true;
        self.step(Event::EngineFree);
        self.step(Event::Settled);
        while open || !self.jobs.is_empty() {
            tokio::select! {
                biased;
                finished = done.recv() => match finished {
                    Some(finished) => {
                        self.finish(finished);
                        self.step(Event::EngineFree);
                    }
                    None => break,
                },
                count = submissions.recv_many(&mut arrivals, INBOX), if open => open = count > 0,
            }
            // Work that came in meanwhile joins the batch that is about to be cut.
            while arrivals.len() < INBOX
                && let Ok(submission) = submissions.try_recv()
            {
                arrivals.push(submission);
            }
            self.drop_abandoned();
            for submission in arrivals.drain(..) {
                self.admit(submission);
            }
            self.step(Event::Settled);
            self.metrics.pending(
                self.scheduler.pending_requests(),
                self.scheduler.pending_characters(),
            );
        }
        self.running.store(false, Ordering::Relaxed);
    }

    fn step(&mut self, event: Event) {
        self.step_at(Instant::now(), event);
    }

    fn step_at(&mut self, now: Instant, event: Event) {
        match self.scheduler.step(now, event) {
            Some(Action::Cut(cut)) => self.send(cut),
            Some(Action::Refuse {
                request,
                pending_characters,
            }) => {
                let retry_after = self.retry_after(pending_characters);
                self.metrics.rejected("queue_full");
                self.answer(
                    request,
                    Err(SubmitError::QueueFull {
                        pending_characters,
                        retry_after,
                    }),
                );
            }
            Some(Action::Drop { request, .. }) => {
                self.metrics.rejected("client_gone");
                self.jobs.remove(&request);
            }
            Some(Action::Admit { .. }) | None => {}
        }
    }

    fn admit(&mut self, submission: Submission) {
        let request = RequestId(self.next_id);
        self.next_id += 1;
        let Submission {
            items,
            arrived,
            reply,
        } = submission;
        let characters = items.len();
        let served = Served {
            motions: Vec::with_capacity(characters),
            ..Served::default()
        };
        let job = Job {
            items: items.into_iter(),
            characters,
            served,
            first_cut: true,
            reply,
        };
        self.jobs.insert(request, job);
        // The scheduler's clock starts at the arrival, not when this task gets round to it.
        self.step_at(arrived, Event::Arrived { request, characters });
    }

    /// Forgets requests whose caller has gone.
    fn drop_abandoned(&mut self) {
        let gone: Vec<RequestId> = self
            .scheduler
            .waiting()
            .filter(|request| self.jobs.get(request).is_none_or(|job| job.reply.is_closed()))
            .collect();
        for request in gone {
            self.step(Event::Gone { request });
        }
    }

    /// Hands a batch to the engine.
    fn send(&mut self, cut: Cut) {
        let mut items = Vec::with_capacity(cut.characters());
        let size = cut.characters();
        for part in &cut.parts {
            let Some(job) = self.jobs.get_mut(&part.request) else {
                continue;
            };
            if std::mem::take(&mut job.first_cut) {
                job.served.queued = part.waited;
                self.metrics.queued(part.waited);
            }
            job.served.batch_size = job.served.batch_size.max(size);
            items.extend(job.items.by_ref().take(part.characters));
        }
        self.metrics.dispatched(cut.reason.label(), size);
        self.in_flight = cut.parts;
        if self.batches.send(items).is_err() {
            self.finish(Err(EngineError::Stopped));
        }
    }

    /// Hands a finished batch to its requests.
    fn finish(&mut self, finished: Finished) {
        let parts = std::mem::take(&mut self.in_flight);
        match finished {
            Ok((answers, times)) => {
                self.metrics.ran(&times, answers.len());
                self.batch_time = (self.batch_time * 3 + times.inference() + times.assemble) / 4;
                let mut answers = answers.into_iter();
                for part in parts {
                    let answers: Vec<RowAnswer> = answers.by_ref().take(part.characters).collect();
                    match answers.into_iter().collect() {
                        Ok(motions) => self.serve(part.request, motions, &times),
                        Err(error) => {
                            tracing::error!(%error, "a character failed");
                            self.fail(part.request, error);
                        }
                    }
                }
            }
            Err(error) => {
                tracing::error!(%error, "a batch failed");
                for part in parts {
                    self.fail(part.request, error.clone());
                }
            }
        }
    }

    /// Notes what a batch made of a request, and answers it where that was the last of it.
    fn serve(&mut self, request: RequestId, motions: Vec<RawMotion>, times: &StageTimes) {
        let Some(job) = self.jobs.get_mut(&request) else {
            return;
        };
        job.served.motions.extend(motions);
        job.served.assemble += times.assemble;
        job.served.inference += times.inference();
        job.served.scatter += times.scatter;
        if job.served.motions.len() == job.characters
            && let Some(job) = self.jobs.remove(&request)
        {
            // The caller may have gone meanwhile.
            let _ = job.reply.send(Ok(job.served));
        }
    }

    /// Fails a request, and forgets what of it still waits.
    fn fail(&mut self, request: RequestId, error: EngineError) {
        self.scheduler.step(Instant::now(), Event::Gone { request });
        self.answer(request, Err(error.into()));
    }

    fn answer(&mut self, request: RequestId, answer: Result<Served, SubmitError>) {
        if let Some(job) = self.jobs.remove(&request) {
            // The caller may have gone meanwhile.
            let _ = job.reply.send(answer);
        }
    }

    /// When what waits now should have been served.
    fn retry_after(&self, pending_characters: usize) -> Duration {
        let batches = pending_characters.div_ceil(self.max_batch).max(1) as u32;
        (self.batch_time * batches).max(Duration::from_millis(10))
    }
}

#[cfg(test)]
#[path = "driver_tests.rs"]
mod tests;

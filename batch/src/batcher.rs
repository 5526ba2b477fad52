//! The way to a pack's workers: callers put requests in, workers take jobs out.

use std::pin::Pin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use troupe_engine::generator::{Generator, JobId};
use troupe_engine::{EngineError, TrialRun};
use troupe_motion::model::{Motion, Output, Task};

use super::metrics::PackMetrics;
use super::order::Order;
use super::parker::Parkers;
use super::scheduler::{Limits, RequestId};
use super::state::{Orders, Replies, Reply, State, Step};
use super::worker;

/// Parts that may wait for a reader; one that has more is too slow.
const MAX_WAITING_PARTS: usize = 256;

/// Makes the generator of a worker, of which it gets the number from 0 on. Called once for each
/// worker, on the thread that will own it; all at the same time.
pub type GeneratorFactory = Arc<dyn Fn(usize) -> Result<Box<dyn Generator>, EngineError> + Send + Sync>;

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SubmitError {
    /// The queue has no room for the request, or is so slow that it would wait for too long.
    #[error("the queue is full: {pending_characters} characters are waiting; retry later")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// A newer plan of the same owner took its place.
    #[error("a newer plan of the same character replaced this one")]
    Superseded,
    /// It had not started at the moment from which on nobody would want the answer.
    #[error("the request timed out after {} ms in the queue", waited.as_millis())]
    DeadlinePassed {
        /// How long it waited.
        waited: Duration,
    },
    /// Its reader left too many parts of its answer waiting.
    #[error("the answer was cancelled: its parts were not read in time")]
    ReaderSlow,
    /// Inference failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// A served request.
#[derive(Debug, Default)]
pub struct Served {
    /// One answer a character, in the request's order.
    pub outputs: Vec<Output>,
    /// From the arrival to the start of its first character.
    pub queued: Duration,
    /// From the arrival to the start of the first step that gave some of the answer.
    pub started: Duration,
    /// From the arrival to the end of the last step that gave some of the answer.
    pub finished: Duration,
    /// Filling inputs, over the steps that gave some of the answer. Workers work side by side, so
    /// these sums may be longer than the time from start to finish.
    pub assemble: Duration,
    /// The networks, over the same.
    pub inference: Duration,
    /// Copying out of the output tensors, over the same.
    pub scatter: Duration,
    /// What its characters take of the workers' time, on average.
    pub work: Duration,
    /// Jobs of the largest of these steps.
    pub batch_size: usize,
    /// These steps.
    pub steps: Vec<ServedStep>,
}

/// A step that gave some of an answer. Other requests may have been in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServedStep {
    /// When it started.
    pub started: Instant,
    /// When it ended.
    pub ended: Instant,
    /// Jobs in it.
    pub jobs: usize,
    /// Rows of its network calls, padding included; 0 where there is no such number.
    pub rows: usize,
    /// The networks.
    pub inference: Duration,
}

impl Served {
    /// The answers as motions; what is none is left out.
    pub fn into_motions(self) -> impl Iterator<Item = Motion> {
        self.outputs.into_iter().filter_map(Output::into_motion)
    }
}

/// A part of a streamed answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// The character that it is of.
    pub character: usize,
    /// What follows the character's parts before.
    pub output: Output,
    /// Whether it is the character's last.
    pub is_last: bool,
    /// From the request's arrival to the start of its first character.
    pub queued: Duration,
    /// The step that made it.
    pub step: ServedStep,
}

/// The way to a pack's workers. Clones share it; the workers end when the last one is gone.
#[derive(Debug, Clone)]
pub struct Batcher(Arc<Owner>);

/// Ends the workers when it is dropped, once they have done what waits.
#[derive(Debug)]
struct Owner(Arc<Shared>);

impl Drop for Owner {
    fn drop(&mut self) {
        self.0.state().closed = true;
        self.0.parkers.unpark_all();
    }
}

impl Batcher {
    /// Starts the workers, and answers when `factory` has made (and warmed up) all their
    /// generators. An idle worker spins for `spin` before it parks.
    ///
    /// # Errors
    /// What `factory` fails with, or [`EngineError::Stopped`] where a thread ends without a word.
    pub async fn start(
        name: &str,
        limits: Limits,
        spin: Duration,
        metrics: PackMetrics,
        factory: GeneratorFactory,
    ) -> Result<Self, EngineError> {
        let limits = Limits {
            workers: limits.workers.max(1),
            max_batch: limits.max_batch.max(1),
            ..limits
        };
        metrics.workers(limits.workers);
        let shared = Arc::new(Shared {
            state: Mutex::new(State::new(limits, metrics.clone())),
            parkers: Parkers::new(limits.workers, spin),
            alive: AtomicUsize::new(limits.workers),
            metrics,
        });
        // Dropped on the way out where a worker does not start, so that the others end.
        let batcher = Self(Arc::new(Owner(shared.clone())));
        let mut starting = Vec::with_capacity(limits.workers);
        for number in 0..limits.workers {
            let (started, has_started) = oneshot::channel();
            let (shared, factory) = (shared.clone(), factory.clone());
            std::thread::Builder::new()
                .name(format!("worker-{number}-{name}"))
                .spawn(move || worker::run(shared, number, &factory, started))
                .map_err(|error| EngineError::Library(format!("cannot start a worker's thread: {error}")))?;
            starting.push(has_started);
        }
        for started in starting {
            started.await.map_err(|_| EngineError::Stopped)??;
        }
        Ok(batcher)
    }

    fn shared(&self) -> &Arc<Shared> {
        &self.0.0
    }

    /// Workers that are alive. One that is lost costs speed; the rest serve everything.
    pub fn workers(&self) -> usize {
        self.shared().alive.load(Ordering::Relaxed)
    }

    /// Whether a worker is alive.
    pub fn is_running(&self) -> bool {
        self.workers() > 0
    }

    /// Why a call of so many characters is refused if it comes now, where it is: to be asked before
    /// any work is put into it.
    pub fn refuse(&self, characters: usize) -> Option<SubmitError> {
        let refusal = self.shared().state().scheduler().refuse(characters)?;
        self.shared().metrics.rejected(refusal.into());
        Some(refusal.into())
    }

    /// Has `tasks` served, alone or together with what other callers ask for. A caller that drops
    /// the future gives up its place: what has not started is not run.
    ///
    /// # Errors
    /// [`SubmitError`], for the whole request.
    pub async fn submit(&self, tasks: Vec<Task>, order: Order) -> Result<Served, SubmitError> {
        self.enqueue(tasks, order)?.await
    }

    /// [`Batcher::submit`] for a caller who must not wait: `tasks` have a place when this returns,
    /// or do not. The future that it gives is the answer; dropping it gives up the place.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`] where there is no place, [`EngineError::Stopped`] where there is
    /// no worker.
    pub fn enqueue(&self, tasks: Vec<Task>, order: Order) -> Result<Answer, SubmitError> {
        let (reply, answer) = oneshot::channel();
        if tasks.is_empty() {
            // Nothing to do, and nothing that a worker would ever finish.
            let _ = reply.send(Ok(Served::default()));
            return Ok(Answer { answer, place: None });
        }
        let place = self.shared().admit(tasks, order, Reply::Whole(reply))?;
        Ok(Answer {
            answer,
            place: Some(place),
        })
    }

    /// Has one task served, and its answer part by part as it comes. Dropping the parts gives up
    /// the place.
    ///
    /// # Errors
    /// As [`Batcher::enqueue`].
    pub fn stream(&self, task: Task, order: Order) -> Result<Parts, SubmitError> {
        let (reply, parts) = mpsc::channel(MAX_WAITING_PARTS);
        let place = self.shared().admit(vec![task], order, Reply::Parts(reply))?;
        Ok(Parts {
            parts,
            place: Some(place),
        })
    }
}

/// A request's place. Dropping it gives up the place.
#[derive(Debug)]
struct PendingRequest {
    /// None where there is nothing to give up any more.
    shared: Option<Arc<Shared>>,
    request: RequestId,
}

impl PendingRequest {
    /// The request is answered.
    fn settle(mut self) {
        self.shared = None;
    }
}

impl Drop for PendingRequest {
    fn drop(&mut self) {
        if let Some(shared) = &self.shared {
            let mut state = shared.state();
            state.forget(Instant::now(), self.request);
            shared.show(&state);
        }
    }
}

/// The answer to a request, to be awaited. Dropping it gives up the request's place in the queue.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Answer {
    answer: oneshot::Receiver<Result<Served, SubmitError>>,
    place: Option<PendingRequest>,
}

impl Future for Answer {
    type Output = Result<Served, SubmitError>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let answer = ready!(Pin::new(&mut self.answer).poll(context));
        if let Some(place) = self.place.take() {
            place.settle();
        }
        Poll::Ready(answer.unwrap_or_else(|_| Err(EngineError::Stopped.into())))
    }
}

/// The parts of an answer, as they come.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Parts {
    parts: mpsc::Receiver<Result<Piece, SubmitError>>,
    place: Option<PendingRequest>,
}

impl Parts {
    /// The next part; none after the last.
    ///
    /// # Errors
    /// [`SubmitError`], after which nothing comes.
    pub async fn next(&mut self) -> Option<Result<Piece, SubmitError>> {
        self.place.as_ref()?;
        let part = self.parts.recv().await.unwrap_or(Err(SubmitError::ReaderSlow));
        if part.as_ref().map_or(true, |piece| piece.is_last)
            && let Some(place) = self.place.take()
        {
            place.settle();
        }
        Some(part)
    }
}

/// What callers and workers share.
#[derive(Debug)]
pub(super) struct Shared {
    state: Mutex<State>,
    parkers: Parkers,
    pub(super) metrics: PackMetrics,
    alive: AtomicUsize,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // Whoever panicked under the lock has lost its own request at most.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a request in, and wakes a worker where one is idle.
    fn admit(
        self: &Arc<Self>,
        tasks: Vec<Task>,
        order: Order,
        reply: Reply,
    ) -> Result<PendingRequest, SubmitError> {
        let now = Instant::now();
        let mut replies = Replies::default();
        let mut state = self.state();
        let admitted = state.admit(now, tasks, order, reply, &mut replies);
        self.release(state, &mut replies);
        admitted.map(|request| PendingRequest {
            shared: Some(Arc::clone(self)),
            request,
        })
    }

    /// Shows what waits, lets go of the lock, wakes who is to be woken and sends what is to be
    /// sent.
    fn release(&self, mut state: MutexGuard<'_, State>, replies: &mut Replies) {
        self.show(&state);
        let wake = state.take_wake();
        drop(state);
        for worker in wake {
            self.parkers.unpark(worker);
        }
        replies.send();
    }

    /// A worker that is about to start tried how fast it is: that tells how long calls will wait
    /// until others are measured.
    pub(super) fn tried(&self, TrialRun { rows, took }: TrialRun) {
        self.state().tried(Instant::now(), rows, took);
    }

    /// Hands out what a worker's last step made, and gives it its next orders. Waits for them where
    /// the worker `is_idle`. None when there will be no more.
    pub(super) fn next(
        &self,
        worker: usize,
        (room, is_idle): (usize, bool),
        mut step: Option<Step>,
        mut dropped: &[JobId],
        replies: &mut Replies,
    ) -> Option<Orders> {
        let spin_until = self.parkers.spin_until(Instant::now());
        loop {
            let mut state = self.state();
            let orders = state.ready(worker, (room, is_idle), step.take(), dropped, replies);
            dropped = &[];
            let is_over = is_idle && orders.is_empty() && state.is_over();
            let spins = state.scheduler().wakes_next(worker) && Instant::now() < spin_until;
            if !is_idle || !orders.is_empty() || is_over || !replies.is_empty() {
                self.release(state, replies);
                match (is_idle && orders.is_empty(), is_over) {
                    (false, _) => return Some(orders),
                    (true, true) => {
                        // Whoever is parked for work that will not come any more ends too.
                        self.parkers.unpark_all();
                        return None;
                    }
                    // Only answers were sent: look again before waiting.
                    (true, false) => continue,
                }
            }
            self.show(&state);
            match spins {
                true => self.parkers.spin(worker, state, spin_until),
                false => drop(self.parkers.park(worker, state)),
            }
        }
    }

    /// A worker's thread ends in a panic, with `held` unserved.
    pub(super) fn worker_lost(&self, worker: usize, held: &[JobId]) {
        let mut replies = Replies::default();
        let mut state = self.state();
        state.lose(Instant::now(), worker, held, &mut replies);
        let left = state.scheduler().workers();
        self.alive.store(left, Ordering::Relaxed);
        self.metrics.workers(left);
        self.release(state, &mut replies);
        // It may have been the last with work, after the last batcher: those that are parked look
        // whether they may end.
        self.parkers.unpark_all();
        tracing::error!(worker, left, "a worker is lost");
    }

    fn show(&self, state: &State) {
        let scheduler = state.scheduler();
        self.metrics
            .pending(scheduler.pending_requests(), scheduler.pending_characters());
    }
}

#[cfg(test)]
#[path = "step_tests.rs"]
mod step_tests;
#[cfg(test)]
#[path = "batcher_tests.rs"]
mod tests;
#[cfg(test)]
#[path = "worker_tests.rs"]
mod worker_tests;

//! The callers' interface to a pack's workers.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::task::{Context, Poll, ready};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use troupe_engine::EngineError;
use troupe_motion::model::Task;

use super::error::SubmitError;
use super::metrics::PackMetrics;
use super::order::Order;
use super::scheduler::{Limits, RequestId};
use super::served::{Piece, Served};
use super::shared::Shared;
use super::state::Reply;
use super::worker::{self, GeneratorFactory};

/// Pieces of an answer that may wait for their reader. With one more, the reader is too slow and
/// its request is cancelled.
const MAX_WAITING_PIECES: usize = 256;
/// Time between two looks at whether the workers have ended. A step takes milliseconds.
const JOIN_INTERVAL: Duration = Duration::from_millis(1);

/// The callers' interface to a pack's workers. Clones share them. When the last clone is dropped,
/// the workers finish the waiting requests and end.
#[derive(Debug, Clone)]
pub struct Batcher(Arc<Owner>);

/// Ends the workers when it is dropped.
#[derive(Debug)]
struct Owner {
    shared: Arc<Shared>,
    threads: Arc<Threads>,
}

/// The workers' threads that have not been joined.
#[derive(Debug, Default)]
struct Threads(Mutex<Vec<JoinHandle<()>>>);

impl Threads {
    fn add(&self, thread: JoinHandle<()>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(thread);
    }

    fn have_ended(&self) -> bool {
        let threads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        threads.iter().all(JoinHandle::is_finished)
    }

    /// Waits until `deadline` for their ends. Answers whether all have ended.
    fn join(&self, deadline: Instant) -> bool {
        let mut threads = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while !threads.iter().all(JoinHandle::is_finished) {
            if Instant::now() >= deadline {
                return false;
            }
            std::thread::sleep(JOIN_INTERVAL);
        }
        for thread in threads.drain(..) {
            // A worker that panicked has reported it.
            let _ = thread.join();
        }
        true
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.shared.close();
    }
}

impl Batcher {
    /// Starts the workers, and returns once `factory` has made and warmed up all their generators.
    /// An idle worker spins for `spin` before it parks.
    ///
    /// # Errors
    /// Those of `factory`, [`EngineError::Library`] if a thread cannot be started, or
    /// [`EngineError::Stopped`] if a thread ends without a result.
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
        let shared = Arc::new(Shared::new(limits, spin, metrics));
        // If a worker does not start, dropping this ends the others.
        let batcher = Self(Arc::new(Owner {
            shared: shared.clone(),
            threads: Arc::default(),
        }));
        let mut starting = Vec::with_capacity(limits.workers);
        for number in 0..limits.workers {
            let (started, has_started) = oneshot::channel();
            let (shared, factory) = (shared.clone(), factory.clone());
            let thread = std::thread::Builder::new()
                .name(format!("worker-{number}-{name}"))
                .spawn(move || worker::run(shared, number, &factory, started))
                .map_err(|error| EngineError::Library(format!("cannot start a worker's thread: {error}")))?;
            batcher.0.threads.add(thread);
            starting.push(has_started);
        }
        for started in starting {
            started.await.map_err(|_| EngineError::Stopped)??;
        }
        Ok(batcher)
    }

    fn shared(&self) -> &Arc<Shared> {
        &self.0.shared
    }

    /// Ends the workers: each finishes its running step and drops its generator. All requests fail
    /// with [`EngineError::Stopped`], also those that come later.
    pub fn stop(&self) {
        self.shared().stop();
    }

    /// Waits for the ends of the workers' threads, until `deadline`. Answers whether all have
    /// ended. Call [`Batcher::stop`] first. This blocks.
    pub fn join(&self, deadline: Instant) -> bool {
        self.0.threads.join(deadline)
    }

    /// A handle to the workers that does not keep them alive.
    pub fn leaving(&self) -> Leaving {
        Leaving {
            owner: Arc::downgrade(&self.0),
            shared: self.shared().clone(),
            threads: self.0.threads.clone(),
        }
    }

    fn admit(&self, tasks: Vec<Task>, order: Order, reply: Reply) -> Result<PendingRequest, SubmitError> {
        let work = tasks.iter().map(Task::work).max().unwrap_or(1);
        let order = Order { work, ..order };
        let request = self.shared().admit(tasks, order, reply)?;
        Ok(PendingRequest {
            shared: Some(self.shared().clone()),
            request,
        })
    }

    /// Number of workers that are alive. A lost worker costs speed; the others serve all requests.
    pub fn workers(&self) -> usize {
        self.shared().workers()
    }

    /// Whether a worker is alive.
    pub fn is_running(&self) -> bool {
        self.workers() > 0
    }

    /// Why a call with this number of characters would be refused now; none if it would be
    /// accepted. Lets a caller refuse early, before it prepares the call.
    pub fn refuse(&self, order: &Order, characters: usize) -> Option<SubmitError> {
        self.shared().refuse(order, characters)
    }

    /// Whether a call with this number of characters would be accepted now. Unlike
    /// [`Batcher::refuse`], this counts no refusal.
    pub fn has_room(&self, order: &Order, characters: usize) -> bool {
        self.shared().has_room(order, characters)
    }

    /// Serves `tasks`, possibly in batches with tasks of other callers. Dropping the future cancels
    /// the request: tasks that have not started are not run.
    ///
    /// # Errors
    /// [`SubmitError`] for the whole request.
    pub async fn submit(&self, tasks: Vec<Task>, order: Order) -> Result<Served, SubmitError> {
        self.enqueue(tasks, order)?.await
    }

    /// As [`Batcher::submit`], in two steps: when this returns, `tasks` are in the queue. The
    /// returned future is the answer. Dropping it cancels the request.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`] if the queue is full or too slow, [`EngineError::Stopped`] if no
    /// worker is alive.
    pub fn enqueue(&self, tasks: Vec<Task>, order: Order) -> Result<Answer, SubmitError> {
        let (reply, answer) = oneshot::channel();
        if tasks.is_empty() {
            // No worker would ever finish a request without tasks.
            let _ = reply.send(Ok(Served::default()));
            return Ok(Answer { answer, place: None });
        }
        let place = self.admit(tasks, order, Reply::Whole(reply))?;
        Ok(Answer {
            answer,
            place: Some(place),
        })
    }

    /// Serves one task and streams its answer piece by piece. Dropping the stream cancels the
    /// request.
    ///
    /// # Errors
    /// As [`Batcher::enqueue`].
    pub fn stream(&self, task: Task, order: Order) -> Result<AnswerStream, SubmitError> {
        let (reply, pieces) = mpsc::channel(MAX_WAITING_PIECES);
        let place = self.admit(vec![task], order, Reply::Stream(reply))?;
        Ok(AnswerStream {
            pieces,
            place: Some(place),
        })
    }
}

/// The workers of a batcher that new callers do not get any more. They end after the last clone of
/// the batcher is dropped.
#[derive(Debug)]
pub struct Leaving {
    owner: Weak<Owner>,
    shared: Arc<Shared>,
    threads: Arc<Threads>,
}

impl Leaving {
    /// Whether the batcher has clones left.
    pub fn is_held(&self) -> bool {
        self.owner.strong_count() > 0
    }

    /// Whether all workers have ended, and their generators are gone.
    pub fn has_ended(&self) -> bool {
        !self.is_held() && self.threads.have_ended()
    }

    /// As [`Batcher::stop`].
    pub fn stop(&self) {
        self.shared.stop();
    }

    /// As [`Batcher::join`].
    pub fn join(&self, deadline: Instant) -> bool {
        self.threads.join(deadline)
    }
}

/// A request without a whole answer yet. Dropping it cancels the request.
#[derive(Debug)]
struct PendingRequest {
    /// None once the request is answered.
    shared: Option<Arc<Shared>>,
    request: RequestId,
}

impl PendingRequest {
    /// The request is answered: dropping this no longer cancels it.
    fn settle(mut self) {
        self.shared = None;
    }
}

impl Drop for PendingRequest {
    fn drop(&mut self) {
        if let Some(shared) = &self.shared {
            shared.forget(self.request);
        }
    }
}

/// A future of the answer to a request. Dropping it cancels the request.
#[derive(Debug)]
#[must_use = "dropping it cancels the request"]
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

/// The pieces of an answer, as workers make them. Dropping it cancels the request.
#[derive(Debug)]
#[must_use = "dropping it cancels the request"]
pub struct AnswerStream {
    pieces: mpsc::Receiver<Result<Piece, SubmitError>>,
    place: Option<PendingRequest>,
}

impl AnswerStream {
    /// The next piece; none after the last piece or an error.
    ///
    /// # Errors
    /// [`SubmitError`] if the request failed or its reader was too slow.
    pub async fn next(&mut self) -> Option<Result<Piece, SubmitError>> {
        self.place.as_ref()?;
        let piece = self.pieces.recv().await.unwrap_or(Err(SubmitError::ReaderSlow));
        if piece.as_ref().map_or(true, |piece| piece.is_last)
            && let Some(place) = self.place.take()
        {
            place.settle();
        }
        Some(piece)
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

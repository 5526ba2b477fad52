//! The way to a pack's workers: callers put requests in, workers take jobs out.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

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

/// Parts that may wait for a reader; one that has more is too slow.
const MAX_WAITING_PIECES: usize = 256;

/// The way to a pack's workers. Clones share it; the workers end when the last one is gone.
#[derive(Debug, Clone)]
pub struct Batcher(Arc<Owner>);

/// Ends the workers when it is dropped, once they have done what waits.
#[derive(Debug)]
struct Owner(Arc<Shared>);

impl Drop for Owner {
    fn drop(&mut self) {
        self.0.close();
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
        let shared = Arc::new(Shared::new(limits, spin, metrics));
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

    fn admit(&self, tasks: Vec<Task>, order: Order, reply: Reply) -> Result<PendingRequest, SubmitError> {
        let request = self.shared().admit(tasks, order, reply)?;
        Ok(PendingRequest {
            shared: Some(self.shared().clone()),
            request,
        })
    }

    /// Workers that are alive. One that is lost costs speed; the rest serve everything.
    pub fn workers(&self) -> usize {
        self.shared().workers()
    }

    /// Whether a worker is alive.
    pub fn is_running(&self) -> bool {
        self.workers() > 0
    }

    /// Why a call of so many characters is refused if it comes now, where it is: to be asked before
    /// any work is put into it.
    pub fn refuse(&self, characters: usize) -> Option<SubmitError> {
        self.shared().refuse(characters)
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
        let place = self.admit(tasks, order, Reply::Whole(reply))?;
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
    pub fn stream(&self, task: Task, order: Order) -> Result<AnswerStream, SubmitError> {
        let (reply, parts) = mpsc::channel(MAX_WAITING_PIECES);
        let place = self.admit(vec![task], order, Reply::Stream(reply))?;
        Ok(AnswerStream {
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
            shared.forget(self.request);
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
pub struct AnswerStream {
    parts: mpsc::Receiver<Result<Piece, SubmitError>>,
    place: Option<PendingRequest>,
}

impl AnswerStream {
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

#[cfg(test)]
#[path = "step_tests.rs"]
mod step_tests;
#[cfg(test)]
#[path = "batcher_tests.rs"]
mod tests;
#[cfg(test)]
#[path = "worker_tests.rs"]
mod worker_tests;

//! The way to a pack's engine: callers put requests in, lanes take batches out.

use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::bells::Bells;
use super::core::{Batch, Core, Outbox, Pieces, Ran};
use super::gauge::EngineGauge;
use super::lane;
use super::metrics::PackMetrics;
use super::order::Order;
use super::scheduler::{Limits, Part, RequestId};
use troupe_engine::{EngineError, Pipeline, TrialRun};
use troupe_motion::model::{KeyframeTask, Motion};

/// Makes the engine of a lane, of which it gets the number from 0 on. Called once for each lane, on the thread that will
/// own it; all lanes at the same time.
pub type EngineFactory = Arc<dyn Fn(usize) -> Result<Pipeline, EngineError> + Send + Sync>;

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// The queue has no room for the request, or is so slow that it would wait for too long.
    #[error("{pending_characters} characters are waiting")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// A newer plan of the same owner took its place.
    #[error("a newer plan of the same character took its place")]
    Superseded,
    /// It was not cut before the moment from which on nobody would want the answer.
    #[error("it waited {} ms, too long for its answer to be of use", waited.as_millis())]
    DeadlinePassed {
        /// How long it waited.
        waited: Duration,
    },
    /// Inference failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// A served request.
#[derive(Debug, Default)]
pub struct Served {
    /// One answer a character, in the request's order.
    pub motions: Vec<Motion>,
    /// From the arrival at the batcher to the cut of the first batch.
    pub queued: Duration,
    /// From the arrival to the start of the first batch on its lane.
    pub started: Duration,
    /// From the arrival until its last batch handed it out, at the batch's end or before.
    pub finished: Duration,
    /// Filling inputs, over all batches that carried the request, in each until it was handed out. Lanes work side by side, so
    /// these sums may be longer than the time from start to finish.
    pub assemble: Duration,
    /// The three stages, over the same.
    pub inference: Duration,
    /// Copying out of the output tensors, over the same.
    pub scatter: Duration,
    /// Its share of the lanes' time ([`MadeRow::work`](troupe_engine::MadeRow)).
    pub work: Duration,
    /// Characters of the largest batch that carried the request.
    pub batch_size: usize,
}

/// The way to a pack's engine. Clones share it; the engine ends when the last one is gone.
#[derive(Debug, Clone)]
pub struct Batcher(Arc<Owner>);

/// Ends the lanes when it is dropped, once they have done what waits.
#[derive(Debug)]
struct Owner(Arc<Shared>);

impl Drop for Owner {
    fn drop(&mut self) {
        self.0.core().closed = true;
        self.0.bells.ring_all();
    }
}

impl Batcher {
    /// Starts the engine's lanes, and answers when `factory` has made (and warmed up) all of them.
    ///
    /// # Errors
    /// What `factory` fails with, or [`EngineError::Stopped`] where a thread ends without a word.
    pub async fn start(
        name: &str,
        limits: Limits,
        metrics: PackMetrics,
        factory: EngineFactory,
    ) -> Result<Self, EngineError> {
        let limits = Limits {
            lanes: limits.lanes.max(1),
            max_batch: limits.max_batch.max(1),
            ..limits
        };
        metrics.lanes(limits.lanes);
        let shared = Arc::new(Shared {
            core: Mutex::new(Core::new(limits, metrics.clone())),
            bells: Bells::new(limits.lanes, limits.lane_spin),
            gauge: EngineGauge::new(limits.lanes, Instant::now()),
            running: AtomicBool::new(true),
            max_batch: limits.max_batch,
            metrics,
        });
        // Dropped on the way out where a lane does not start, so that the others end.
        let batcher = Self(Arc::new(Owner(shared.clone())));
        let mut starting = Vec::with_capacity(limits.lanes);
        for lane in 0..limits.lanes {
            let (started, has_started) = oneshot::channel();
            let (shared, factory) = (shared.clone(), factory.clone());
            std::thread::Builder::new()
                .name(format!("lane-{lane}-{name}"))
                .spawn(move || lane::run(shared, lane, &factory, started))
                .map_err(|error| EngineError::Library(format!("cannot start a lane's thread: {error}")))?;
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

    /// Whether a lane is alive. One that is lost costs speed; the rest serve everything.
    pub fn is_running(&self) -> bool {
        self.shared().running.load(Ordering::Relaxed)
    }

    /// How busy the engine is.
    pub fn gauge(&self) -> &EngineGauge {
        &self.shared().gauge
    }

    /// Why an InBetween call of so many characters is refused if it comes now, where it is: to be asked before any work is
    /// put into it.
    pub fn refuse(&self, characters: usize) -> Option<SubmitError> {
        let refusal = self.shared().core().refuse(Instant::now(), characters)?;
        self.shared().metrics.rejected(refusal.into());
        Some(refusal.into())
    }

    /// Has `items` served, alone or together with what other callers ask for. A caller that drops the future gives up
    /// its place: what is not yet cut is not run.
    ///
    /// # Errors
    /// [`SubmitError`], for the whole request.
    pub async fn submit(&self, items: Vec<KeyframeTask>, order: Order) -> Result<Served, SubmitError> {
        self.enqueue(items, order)?.await
    }

    /// [`Batcher::submit`] for a caller who must not wait: `items` have a place when this returns, or do not. The future
    /// that it gives is the answer; dropping it gives up the place.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`] where there is no place, [`EngineError::Stopped`] where there is no engine.
    pub fn enqueue(&self, items: Vec<KeyframeTask>, order: Order) -> Result<Answer, SubmitError> {
        let (reply, answer) = oneshot::channel();
        if items.is_empty() {
            // Nothing to do, and nothing that a lane would ever finish.
            let _ = reply.send(Ok(Served::default()));
            return Ok(Answer { answer, place: None });
        }
        let request = self.shared().admit(items, order, reply)?;
        let place = Some((self.shared().clone(), request));
        Ok(Answer { answer, place })
    }
}

/// The answer to a request, to be awaited. Dropping it gives up the request's place in the queue.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Answer {
    answer: oneshot::Receiver<Result<Served, SubmitError>>,
    place: Option<(Arc<Shared>, RequestId)>,
}

impl Future for Answer {
    type Output = Result<Served, SubmitError>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let answer = ready!(Pin::new(&mut self.answer).poll(context));
        self.place = None;
        Poll::Ready(answer.unwrap_or_else(|_| Err(EngineError::Stopped.into())))
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        if let Some((shared, request)) = self.place.take() {
            let mut core = shared.core();
            core.forget(Instant::now(), request);
            shared.show(&core);
        }
    }
}

/// What callers and lanes share.
#[derive(Debug)]
pub(super) struct Shared {
    core: Mutex<Core>,
    bells: Bells,
    pub(super) gauge: EngineGauge,
    pub(super) metrics: PackMetrics,
    max_batch: usize,
    running: AtomicBool,
}

impl Shared {
    fn core(&self) -> MutexGuard<'_, Core> {
        // Whoever panicked under the lock has lost its own request at most.
        self.core.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a request in, and wakes a lane where one is idle.
    fn admit(
        &self,
        items: Vec<KeyframeTask>,
        order: Order,
        reply: super::core::Reply,
    ) -> Result<RequestId, SubmitError> {
        let now = Instant::now();
        let mut outbox = Outbox::default();
        let mut core = self.core();
        let admitted = core.admit(now, items, order, reply, &mut outbox);
        let asleep = core.scheduler().idle_lane().filter(|_| !core.woken);
        core.woken |= asleep.is_some();
        self.show(&core);
        drop(core);
        if let Some(lane) = asleep {
            self.bells.ring(lane);
        }
        outbox.send();
        admitted
    }

    /// A lane is ready for its first batch. Where it tried a batch already, that tells how long calls will wait until others
    /// have been measured.
    pub(super) fn lane_starts(&self, lane: usize, trial: Option<TrialRun>) {
        let mut core = self.core();
        if let Some(TrialRun { rows, took }) = trial {
            core.tried(Instant::now(), rows, took);
        }
        core.free(Instant::now(), lane);
    }

    /// Waits for a batch. Gives none when there will be no more.
    pub(super) fn next_batch(&self, lane: usize) -> Option<Batch> {
        let listen_until = self.bells.listen_until(Instant::now());
        let mut outbox = Outbox::default();
        let mut core = self.core();
        loop {
            if let Some(batch) = core.take(lane) {
                return Some(batch);
            }
            if core.is_over() {
                // Whoever sleeps on for work that will not come any more ends too.
                self.bells.ring_all();
                return None;
            }
            let now = Instant::now();
            core.settle(now, &mut outbox);
            let batch = core.take(lane);
            self.ring(&core, batch.is_some());
            if batch.is_some() {
                drop(core);
                outbox.send();
                return batch;
            }
            if !outbox.is_empty() {
                drop(core);
                outbox.send();
                core = self.core();
                continue;
            }
            let listens = core.scheduler().idle_lane() == Some(lane) && now < listen_until;
            core = match core.wake_at {
                None if listens => {
                    self.bells.listen(lane, core, listen_until);
                    self.core()
                }
                at => {
                    let time = at.map(|at| at.saturating_duration_since(now));
                    self.bells.sleep(lane, core, time)
                }
            };
        }
    }

    /// Whether a full batch waits. Callers who ask again then wait behind it: to have an answer before the batch that makes it
    /// ends would not make them any faster, and parting a batch's answers costs the lane time.
    pub(super) fn full_batch_waits(&self) -> bool {
        self.gauge.waiting() >= self.max_batch
    }

    /// Takes what a lane has made of a batch that it still runs.
    pub(super) fn deliver_early(&self, lane: usize, ran: &Ran, pieces: Pieces, outbox: &mut Outbox) {
        let mut core = self.core();
        core.deliver_early(lane, ran, pieces, outbox);
        self.show(&core);
        drop(core);
        outbox.send();
    }

    /// Takes the last of what a lane has made of a batch, and gives it the next one where there is one.
    pub(super) fn finish(
        &self,
        lane: usize,
        ran: &Ran,
        pieces: Pieces,
        outbox: &mut Outbox,
    ) -> Option<Batch> {
        let mut core = self.core();
        core.deliver(ran, pieces, outbox);
        core.ended(lane, ran, outbox);
        core.settle(Instant::now(), outbox);
        let batch = core.take(lane);
        self.ring(&core, batch.is_some());
        batch
    }

    /// A lane's thread ends in a panic, with `parts` unserved.
    pub(super) fn lane_lost(&self, lane: usize, parts: Vec<Part>) {
        let mut outbox = Outbox::default();
        let mut core = self.core();
        core.lose(Instant::now(), lane, parts, &mut outbox);
        let left = core.scheduler().lanes();
        self.running.store(left > 0, Ordering::Relaxed);
        self.gauge.lost_lane(lane, Instant::now());
        self.metrics.lanes(left);
        if let Some(other) = core.scheduler().idle_lane() {
            self.bells.ring(other);
        }
        self.show(&core);
        drop(core);
        tracing::error!(lane, left, "a lane of the engine is lost");
        outbox.send();
    }

    /// Wakes the lanes that have something to do: those with a batch, and one to keep the time where the caller is about
    /// to run a batch itself and some work is held back.
    fn ring(&self, core: &Core, runs: bool) {
        for lane in core.called() {
            self.bells.ring(lane);
        }
        if runs
            && core.wake_at.is_some()
            && let Some(lane) = core.scheduler().idle_lane()
        {
            self.bells.ring(lane);
        }
        self.show(core);
    }

    fn show(&self, core: &Core) {
        let scheduler = core.scheduler();
        let characters = scheduler.pending_characters();
        self.gauge.wait(characters);
        self.metrics.pending(scheduler.pending_requests(), characters);
    }
}

#[cfg(test)]
#[path = "early_tests.rs"]
mod early_tests;
#[cfg(test)]
#[path = "lane_tests.rs"]
mod lane_tests;
#[cfg(test)]
#[path = "driver_tests.rs"]
mod tests;

//! Data that callers and workers share: the locked state, and the parkers that wake workers.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use troupe_engine::generator::JobId;
use troupe_engine::{EngineError, TrialRun};
use troupe_motion::model::Task;

use super::error::SubmitError;
use super::metrics::PackMetrics;
use super::order::Order;
use super::parker::Parkers;
use super::scheduler::{Limits, RequestId};
use super::state::{Orders, Replies, Reply, State, Step};

/// See the module.
#[derive(Debug)]
pub(super) struct Shared {
    state: Mutex<State>,
    parkers: Parkers,
    pub(super) metrics: PackMetrics,
    alive: AtomicUsize,
    /// Workers end after their running steps, whatever waits.
    stopped: AtomicBool,
}

impl Shared {
    /// Starts without requests. An idle worker spins for `spin` before it parks.
    pub(super) fn new(limits: Limits, spin: Duration, metrics: PackMetrics) -> Self {
        metrics.workers(limits.workers);
        Self {
            state: Mutex::new(State::new(limits, metrics.clone())),
            parkers: Parkers::new(limits.workers, spin),
            alive: AtomicUsize::new(limits.workers),
            stopped: AtomicBool::new(false),
            metrics,
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        // A panic under the lock loses at most the request of the thread that panicked.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a request, and wakes an idle worker if there is one.
    pub(super) fn admit(
        &self,
        tasks: Vec<Task>,
        order: Order,
        reply: Reply,
    ) -> Result<RequestId, SubmitError> {
        let now = Instant::now();
        let mut replies = Replies::default();
        let mut state = self.state();
        if self.stopped.load(Ordering::Relaxed) {
            return Err(EngineError::Stopped.into());
        }
        let admitted = state.admit(now, tasks, order, reply, &mut replies);
        self.release(state, &mut replies);
        admitted
    }

    /// Cancels a request whose caller is gone.
    pub(super) fn forget(&self, request: RequestId) {
        let mut state = self.state();
        state.forget(Instant::now(), request);
        self.show(&state);
    }

    /// Whether a call of this many characters would be accepted now.
    pub(super) fn has_room(&self, order: &Order, characters: usize) -> bool {
        self.state().scheduler().refuse(order, characters).is_none()
    }

    /// Why a call of this many characters would be refused now.
    pub(super) fn refuse(&self, order: &Order, characters: usize) -> Option<SubmitError> {
        let refusal = self.state().scheduler().refuse(order, characters)?;
        self.metrics.rejected(refusal.into());
        Some(refusal.into())
    }

    /// No more requests come: workers finish the waiting ones and end.
    pub(super) fn close(&self) {
        self.state().closed = true;
        self.parkers.unpark_all();
    }

    /// Workers end after their running steps. All requests fail.
    pub(super) fn stop(&self) {
        let mut state = self.state();
        // Under the lock: a worker looks at it before it parks, and so does a new request.
        self.stopped.store(true, Ordering::Relaxed);
        state.abandon();
        drop(state);
        self.close();
    }

    /// Number of workers that are alive.
    pub(super) fn workers(&self) -> usize {
        self.alive.load(Ordering::Relaxed)
    }

    /// Updates the metrics, releases the lock, wakes workers and sends answers.
    fn release(&self, mut state: MutexGuard<'_, State>, replies: &mut Replies) {
        self.show(&state);
        let wake = state.take_wake();
        drop(state);
        for worker in wake {
            self.parkers.unpark(worker);
        }
        replies.send();
    }

    /// Notes the speed that a starting worker measured. It is the first estimate of how long calls
    /// will wait.
    pub(super) fn tried(&self, TrialRun { work, took, .. }: TrialRun) {
        self.state().tried(Instant::now(), work, took);
    }

    /// Delivers the results of a worker's last step and gives the worker its next orders. If the
    /// worker `is_idle`, waits for orders. None if the worker must end.
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
            if self.stopped.load(Ordering::Relaxed) {
                return None;
            }
            let orders = state.ready(worker, (room, is_idle), step.take(), dropped, replies);
            dropped = &[];
            let is_over = is_idle && orders.is_empty() && state.is_over();
            let spins = state.scheduler().wakes_next(worker) && Instant::now() < spin_until;
            if !is_idle || !orders.is_empty() || is_over || !replies.is_empty() {
                self.release(state, replies);
                match (is_idle && orders.is_empty(), is_over) {
                    (false, _) => return Some(orders),
                    (true, true) => {
                        // Workers that are parked must end too.
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

    /// A worker's thread panicked; the jobs in `held` are not done.
    pub(super) fn worker_lost(&self, worker: usize, held: &[JobId]) {
        let mut replies = Replies::default();
        let mut state = self.state();
        state.lose(Instant::now(), worker, held, &mut replies);
        let left = state.scheduler().workers();
        self.alive.store(left, Ordering::Relaxed);
        self.metrics.workers(left);
        self.release(state, &mut replies);
        // If the batcher is gone and this worker had the last work, the parked workers must end.
        self.parkers.unpark_all();
        tracing::error!(worker, left, "a worker is lost");
    }

    fn show(&self, state: &State) {
        let scheduler = state.scheduler();
        self.metrics
            .pending(scheduler.pending_requests(), scheduler.pending_characters());
    }
}

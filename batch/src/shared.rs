//! What callers and workers share: the state behind its lock, and what wakes a worker.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use troupe_engine::TrialRun;
use troupe_engine::generator::JobId;
use troupe_motion::model::Task;

use super::error::SubmitError;
use super::metrics::PackMetrics;
use super::order::Order;
use super::parker::Parkers;
use super::scheduler::{Limits, RequestId};
use super::state::{Orders, Replies, Reply, State, Step};

/// What callers and workers share.
#[derive(Debug)]
pub(super) struct Shared {
    state: Mutex<State>,
    parkers: Parkers,
    pub(super) metrics: PackMetrics,
    alive: AtomicUsize,
}

impl Shared {
    /// A state without requests. An idle worker spins for `spin` before it parks.
    pub(super) fn new(limits: Limits, spin: Duration, metrics: PackMetrics) -> Self {
        metrics.workers(limits.workers);
        Self {
            state: Mutex::new(State::new(limits, metrics.clone())),
            parkers: Parkers::new(limits.workers, spin),
            alive: AtomicUsize::new(limits.workers),
            metrics,
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        // Whoever panicked under the lock has lost its own request at most.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a request in, and wakes a worker where one is idle.
    pub(super) fn admit(
        &self,
        tasks: Vec<Task>,
        order: Order,
        reply: Reply,
    ) -> Result<RequestId, SubmitError> {
        let now = Instant::now();
        let mut replies = Replies::default();
        let mut state = self.state();
        let admitted = state.admit(now, tasks, order, reply, &mut replies);
        self.release(state, &mut replies);
        admitted
    }

    /// Gives up a request's place.
    pub(super) fn forget(&self, request: RequestId) {
        let mut state = self.state();
        state.forget(Instant::now(), request);
        self.show(&state);
    }

    /// Why a call of so many characters would be refused now.
    pub(super) fn refuse(&self, characters: usize) -> Option<SubmitError> {
        let refusal = self.state().scheduler().refuse(characters)?;
        self.metrics.rejected(refusal.into());
        Some(refusal.into())
    }

    /// No more requests come: workers end once they have done what waits.
    pub(super) fn close(&self) {
        self.state().closed = true;
        self.parkers.unpark_all();
    }

    /// Workers that are alive.
    pub(super) fn workers(&self) -> usize {
        self.alive.load(Ordering::Relaxed)
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

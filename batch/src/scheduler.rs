//! The scheduler as a pure state machine: [`Scheduler::step`] takes what happened and answers what
//! to do. It reads no clock, holds no work and does no I/O, so every rule below is tested without
//! threads or time.
//!
//! # Order
//! Earliest deadline first. A request's virtual deadline is its [`Order::deadline`], or its arrival
//! where that is later, plus the [offset](Limits::class_offset) of its class. Of equal ones the
//! first that came goes first. **Nothing starves**: what comes after a request's virtual deadline
//! has a later one, so from then on only what already waits can go before it, and
//! [`Limits::max_queued`] and [`Limits::max_live`] bound that.
//!
//! **Calls beside a crowd**: one of [`Limits::call_share`] places goes to the most urgent call
//! first, whatever its deadline. What a batch is too small for is carried over to the next, so that
//! the share holds for batches of one too.
//!
//! # Batches
//! A worker that is at the end of a step says how many more jobs it has room for, and gets up to so
//! many characters: a batch of a family with one step, new jobs beside those that go on of a family
//! with several. A batch is capped at [`Limits::max_batch`], and at what a worker does in
//! [`Limits::max_batch_time`]. Idle workers share what waits evenly. What is more than a call of
//! the engine is taken in [whole calls](Limits::call_rows). A request may be split, over workers as
//! well.
//!
//! # Owners
//! At most one plan of an owner is with a worker. One more may wait. A newer one replaces it and
//! inherits its virtual deadline where that is earlier, so that a stream of plans does not push
//! itself back.
//!
//! # Limits
//! A request that does not fit is refused whole, at once. So is a call that would wait for longer
//! than [`Limits::max_wait`] by the rate at which calls left the queue lately. What idle workers
//! are about to take does not count as waiting. Work that was given up, was replaced or has expired
//! is dropped before it starts.

mod event;
mod limits;
mod meter;
mod queue;

use std::time::{Duration, Instant};

use self::meter::Meter;
use self::queue::{Queue, Take};
use super::order::{Class, Order};

pub use event::{Action, Batch, BatchReason, Event, Finished, Ready, RequestId};
pub use limits::{Limits, QueueRefusal};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Worker {
    /// It has not reported yet, or has jobs.
    Busy,
    /// It waits to be woken, with so much room.
    Idle(usize),
    /// It was woken and has not reported yet.
    Woken(usize),
    Lost,
}

impl Worker {
    /// The room of one that takes work at once.
    fn room(self) -> Option<usize> {
        match self {
            Self::Idle(room) | Self::Woken(room) => Some(room),
            Self::Busy | Self::Lost => None,
        }
    }
}

/// The state machine. See the module's text for its rules.
#[derive(Debug)]
pub struct Scheduler {
    limits: Limits,
    queue: Queue,
    workers: Vec<Worker>,
    meter: Meter,
    /// Places that went to anybody since a call had one of its own, at most [`Limits::call_share`].
    call_credit: usize,
}

impl Scheduler {
    /// An empty scheduler whose workers have not reported yet.
    pub fn new(limits: Limits) -> Self {
        Self {
            queue: Queue::default(),
            workers: vec![Worker::Busy; limits.workers],
            meter: Meter::new(limits.workers),
            call_credit: limits.call_share,
            limits,
        }
    }

    /// Characters that wait.
    pub fn pending_characters(&self) -> usize {
        let classes = Class::ALL.into_iter();
        classes.map(|class| self.queue.pending(class)).sum()
    }

    /// Requests that wait with at least one character.
    pub(crate) fn pending_requests(&self) -> usize {
        self.queue.len()
    }

    /// Workers that are not lost.
    pub fn workers(&self) -> usize {
        let alive = self.workers.iter().filter(|&&worker| worker != Worker::Lost);
        alive.count()
    }

    /// Whether a worker may have jobs.
    pub(crate) fn is_busy(&self, worker: usize) -> bool {
        self.workers.get(worker) == Some(&Worker::Busy)
    }

    /// Whether it is the worker that the next arrival wakes.
    pub(crate) fn wakes_next(&self, worker: usize) -> bool {
        self.first_idle() == Some(worker)
    }

    /// A worker's time for one character, over the latest steps.
    pub(crate) fn character_time(&self) -> Duration {
        self.meter.character_time()
    }

    /// Why a call of so many characters is refused if it comes now, where it is: to be asked before
    /// it arrives.
    pub fn refuse(&self, characters: usize) -> Option<QueueRefusal> {
        self.refusal(Class::Request, characters, 0)
    }

    /// Takes one event, and adds what to do about it to `actions`.
    pub fn step(&mut self, now: Instant, event: Event<'_>, actions: &mut Vec<Action>) {
        match event {
            Event::Arrived {
                request,
                characters,
                order,
            } => self.arrive(now, request, characters, order, actions),
            Event::Gone { request } => {
                let left = self.queue.forget(request);
                actions.extend(left.map(|characters| Action::Drop { request, characters }));
            }
            Event::Tried { characters, took } => self.meter.stepped(took, characters),
            Event::Ready(ready) => self.ready(now, ready, actions),
            Event::WorkerLost { worker, finished } => self.lose(worker, finished),
        }
        self.wake(actions);
    }

    fn arrive(
        &mut self,
        now: Instant,
        request: RequestId,
        characters: usize,
        order: Order,
        actions: &mut Vec<Action>,
    ) {
        let older = order.owner.and_then(|owner| self.queue.waiting_of(owner));
        let leaving = older.map_or(0, |older| older.pending(order.class));
        if let Some(refusal) = self.refusal(order.class, characters, leaving) {
            return actions.push(Action::Refuse { request, refusal });
        }
        let due = order.deadline.max(now) + self.limits.class_offset(order.class);
        let older = self.queue.add(now, request, characters, order, due);
        actions.extend(older.map(|request| Action::Supersede { request }));
    }

    /// Why so many characters would have no place, where `leaving` of those that wait make room for
    /// them.
    fn refusal(&self, class: Class, characters: usize, leaving: usize) -> Option<QueueRefusal> {
        let pending = self.queue.pending(class) - leaving;
        let taken: usize = self.workers.iter().filter_map(|worker| worker.room()).sum();
        let wait = self.meter.wait(pending);
        let room = self.limits.room(class) + taken;
        let full = characters > room.saturating_sub(pending);
        let limited = class == Class::Request && !self.limits.max_wait.is_zero();
        let slow = limited && taken == 0 && wait > self.limits.max_wait;
        (full || slow).then(|| QueueRefusal {
            pending_characters: self.pending_characters(),
            expected_wait: wait,
            full,
        })
    }

    fn lose(&mut self, worker: usize, finished: &[Finished]) {
        for done in finished {
            self.queue.finish(done.request, done.characters);
        }
        if let Some(known) = self
            .workers
            .get_mut(worker)
            .filter(|known| **known != Worker::Lost)
        {
            *known = Worker::Lost;
            self.meter.lost();
        }
    }

    fn ready(&mut self, now: Instant, ready: Ready<'_>, actions: &mut Vec<Action>) {
        let Ready {
            worker,
            room,
            is_idle,
            took,
            finished,
        } = ready;
        for done in finished {
            self.queue.finish(done.request, done.characters);
        }
        if let Some(took) = took {
            let characters = finished.iter().map(|done| done.characters).sum();
            self.meter.stepped(took, characters);
        }
        match self.workers.get(worker) {
            None | Some(Worker::Lost) => return,
            _ => {}
        }
        let room = room.min(self.limits.max_batch);
        let slices = self.take(now, self.share(worker, room), actions);
        self.workers[worker] = match slices.is_empty() && is_idle {
            true => Worker::Idle(room),
            false => Worker::Busy,
        };
        if !slices.is_empty() {
            let reason = match took {
                _ if self.queue.ready() > 0 => BatchReason::Full,
                Some(_) => BatchReason::Backlog,
                None => BatchReason::Idle,
            };
            actions.push(Action::Start(Batch {
                worker,
                slices,
                reason,
            }));
        }
    }

    /// How many characters a worker with so much room takes of what is ready.
    fn share(&self, worker: usize, room: usize) -> usize {
        let cap = match self.limits.max_batch_time {
            Duration::ZERO => usize::MAX,
            time => self.meter.within(time).max(1),
        };
        let others = self.workers.iter().enumerate();
        let idle = others.filter(|&(other, state)| other != worker && state.room().is_some());
        let even = self.queue.ready().div_ceil(idle.count() + 1);
        self.limits.whole_calls(room.min(cap).min(even))
    }

    /// Takes up to `wanted` characters off the queue.
    fn take(&mut self, now: Instant, wanted: usize, actions: &mut Vec<Action>) -> Vec<RequestSlice> {
        let (mut room, mut calls, mut own) = (wanted, 0, self.places_of_calls(wanted));
        let mut slices: Vec<RequestSlice> = Vec::new();
        while room > 0 {
            let calls_only = own > 0;
            let most = if calls_only { own } else { room };
            match self.queue.take(now, most, calls_only) {
                Some(Take::Slice(slice)) => {
                    room -= slice.characters;
                    own = own.saturating_sub(slice.characters);
                    let is_call = slice.class == Class::Request;
                    calls += if is_call { slice.characters } else { 0 };
                    // A call may get places of its own, and then more of the others. Nothing else
                    // is there twice.
                    let mut before = slices.iter_mut().filter(|_| is_call);
                    match before.find(|before| before.request == slice.request) {
                        Some(before) => before.characters += slice.characters,
                        None => slices.push(slice),
                    }
                }
                Some(Take::Expired { request, waited }) => actions.push(Action::Expire { request, waited }),
                None if calls_only => own = 0,
                None => break,
            }
        }
        let spent = calls * self.limits.call_share;
        self.call_credit = (self.call_credit + wanted)
            .saturating_sub(spent)
            .min(self.limits.call_share);
        let waiting = self.queue.pending(Class::Request) > 0;
        self.meter.left(now, calls, waiting);
        slices
    }

    /// How many of so many places go to calls first.
    fn places_of_calls(&self, wanted: usize) -> usize {
        (self.call_credit + wanted)
            .checked_div(self.limits.call_share)
            .unwrap_or_default()
            .min(wanted)
    }

    /// Wakes an idle worker where something is ready and none is awake already.
    fn wake(&mut self, actions: &mut Vec<Action>) {
        let woken = |worker: &Worker| matches!(worker, Worker::Woken(_));
        if self.queue.ready() == 0 || self.workers.iter().any(woken) {
            return;
        }
        if let Some(worker) = self.first_idle()
            && let Worker::Idle(room) = self.workers[worker]
        {
            self.workers[worker] = Worker::Woken(room);
            actions.push(Action::Wake { worker });
        }
    }

    fn first_idle(&self) -> Option<usize> {
        let idle = |worker: &Worker| matches!(worker, Worker::Idle(_));
        self.workers.iter().position(idle)
    }
}

#[cfg(test)]
#[path = "scheduler_model_tests.rs"]
mod model_tests;
#[cfg(test)]
#[path = "scheduler_tests.rs"]
mod tests;

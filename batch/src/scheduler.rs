//! The scheduler as a pure state machine: [`Scheduler::step`] takes an event and returns actions.
//! It reads no clock, holds no work and does no I/O, so every rule below is tested without threads
//! or time.
//!
//! A *call* is a request of [`Class::Request`]; all other requests are plans of sessions.
//!
//! # Order
//! The earliest virtual deadline goes first. A request's virtual deadline is the later of its
//! [`Order::deadline`] and its arrival, plus the [offset](Limits::class_offset) of its class. If
//! two are equal, the earlier arrival goes first. **No class starves**: a request that arrives
//! after the virtual deadline of another has a later one itself. So from then on the class of the
//! other comes first again once requests are done that already wait, and [`Limits::max_queued`] and
//! [`Limits::max_live`] bound those.
//!
//! **Clients share evenly**: the order above decides which class goes first. Within a class the
//! clients with waiting requests take turns by the work that each has had (`scheduler/fair.rs`),
//! first the groups and then the clients of a group. A client's own requests go by virtual
//! deadline. So a client that asks for much, or says that all of it is urgent, delays itself.
//!
//! **Calls beside a crowd**: one in [`Limits::call_share`] places of a batch goes to the call
//! whose turn it is, whatever its deadline. If a batch is too small for that, the fraction is
//! carried over to the next batch. So the share also holds for batches of one.
//!
//! # Batches
//! At the end of a step a worker reports its room: how many more jobs it can take. It gets up to so
//! many characters. In a family with one step they are its next batch. In a family with several
//! steps they join the jobs that it already has. A batch is limited to [`Limits::max_batch`], and
//! to the work that a worker does in [`Limits::max_batch_time`], or in
//! [`Limits::calls_batch_time`] if no plan came for five seconds. While some group calls for little
//! and another asks for much, each has at most [`Limits::shared_batch_time`] of it, times its
//! share: its part. A group calls for little if its open work, waiting or with workers, is no more
//! than that, or a single character, and was so for three seconds. If only clients of one group
//! differ in that, each of them has a part. Who has had a part is passed over, in all classes.
//! Idle workers share the waiting characters evenly. More characters than one engine call takes are
//! given out in [whole calls](Limits::call_rows). A request may be split, also across workers.
//!
//! # Owners
//! At most one plan of an owner is with a worker, and one more may wait. A newer plan replaces the
//! waiting one. It inherits the older plan's virtual deadline if that is earlier, so that a stream
//! of plans does not push itself back.
//!
//! # Limits
//! A request that does not fit is refused as a whole, at once. But if its client has less waiting
//! than others, the least urgent calls of the client with most leave the full queue for a call, if
//! possible unstarted ones. A call is refused in any case if it would wait for longer than
//! [`Limits::max_wait`]. Its wait follows from the rate at which calls left the queue lately, and
//! from what may go before it: of each other client at most as much as its own has waiting.
//! Characters that idle workers are about to take do not count as waiting. Cancelled, replaced and
//! expired work is dropped before it starts.

mod callers;
mod event;
mod fair;
mod limits;
mod meter;
mod queue;

use std::time::{Duration, Instant};

use self::callers::{Callers, Small};
use self::meter::Meter;
use self::queue::{Queue, Room, Take, Waiting};
use super::order::{Class, Order};

pub use event::{Action, Batch, BatchReason, Event, Finished, Ready, RequestId, RequestSlice};
pub use limits::{Limits, QueueRefusal};

/// Time from a plan on in which more of them are expected: a live character plans several times.
const PLANS_LATELY: Duration = Duration::from_secs(5);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Worker {
    /// It has not reported yet, or has jobs.
    Busy,
    /// It waits to be woken; holds its room, in characters.
    Idle(usize),
    /// It was woken and has not reported yet; holds its room, in characters.
    Woken(usize),
    Lost,
}

impl Worker {
    /// The room of an idle or woken worker, in characters.
    fn room(self) -> Option<usize> {
        match self {
            Self::Idle(room) | Self::Woken(room) => Some(room),
            Self::Busy | Self::Lost => None,
        }
    }
}

/// The state machine. The module's documentation has its rules.
#[derive(Debug)]
pub struct Scheduler {
    limits: Limits,
    queue: Queue,
    workers: Vec<Worker>,
    meter: Meter,
    /// Places given out since the last place that was kept for calls; at most
    /// [`Limits::call_share`].
    call_credit: usize,
    callers: Callers,
    last_plan: Option<Instant>,
}

impl Scheduler {
    /// An empty scheduler whose workers have not reported yet.
    pub fn new(limits: Limits) -> Self {
        Self {
            queue: Queue::default(),
            workers: vec![Worker::Busy; limits.workers],
            meter: Meter::new(limits.workers),
            call_credit: limits.call_share,
            callers: Callers::default(),
            last_plan: None,
            limits,
        }
    }

    /// Waiting characters of all classes.
    pub fn pending_characters(&self) -> usize {
        let classes = Class::ALL.into_iter();
        classes.map(|class| self.queue.pending(class)).sum()
    }

    /// Requests with at least one waiting character.
    pub(crate) fn pending_requests(&self) -> usize {
        self.queue.len()
    }

    /// Number of workers that are not lost.
    pub fn workers(&self) -> usize {
        let alive = self.workers.iter().filter(|&&worker| worker != Worker::Lost);
        alive.count()
    }

    /// Whether a worker may have jobs.
    pub(crate) fn is_busy(&self, worker: usize) -> bool {
        self.workers.get(worker) == Some(&Worker::Busy)
    }

    /// Whether the next arrival wakes this worker.
    pub(crate) fn wakes_next(&self, worker: usize) -> bool {
        self.first_idle() == Some(worker)
    }

    /// A worker's expected time for so much [work](Order::work).
    pub(crate) fn time_of(&self, work: u32) -> Duration {
        self.meter.time_of(work.into())
    }

    /// Why a call with this number of characters would be refused now; none if it would be
    /// accepted.
    pub fn refuse(&self, order: &Order, characters: usize) -> Option<QueueRefusal> {
        let refusal = self.refusal(order, characters, (0, 0))?;
        match self.in_the_way(order, characters, refusal) {
            Some(_) => None,
            None => Some(refusal),
        }
    }

    /// Handles one event, and adds the resulting actions to `actions`.
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
            Event::Tried { work, took } => self.meter.stepped(took, work),
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
        if order.class != Class::Request {
            self.last_plan = Some(now);
        }
        let part = self.within(self.limits.shared_batch_time);
        let asked = order.cost() * characters as u64;
        let [of_group, of_client] = (self.queue.open_work_of(&order))
            .map(|open| open + asked <= part || (open == 0 && characters == 1));
        let small = Small { of_group, of_client };
        self.callers.note(now, &order, small);
        let older = order.owner.and_then(|owner| self.queue.waiting_of(owner));
        let older = older.filter(|older| older.class() == order.class);
        let leaving = older.map_or((0, 0), Waiting::pending);
        if let Some(refusal) = self.refusal(&order, characters, leaving) {
            let Some(in_the_way) = self.in_the_way(&order, characters, refusal) else {
                return actions.push(Action::Refuse { request, refusal });
            };
            for request in in_the_way {
                self.queue.forget(request);
                actions.push(Action::PushOut { request, refusal });
            }
        }
        let due = order.deadline.max(now) + self.limits.class_offset(order.class);
        let older = self.queue.add(now, request, characters, order, due);
        actions.extend(older.map(|request| Action::Supersede { request }));
    }

    /// The calls that must go to make room for a call that finds the queue full; none if it is
    /// refused.
    fn in_the_way(&self, order: &Order, characters: usize, refusal: QueueRefusal) -> Option<Vec<RequestId>> {
        if !refusal.full || order.class != Class::Request {
            return None;
        }
        let free = (self.room(order.class)).saturating_sub(self.queue.pending(order.class));
        self.queue.in_the_way(order, characters, characters - free)
    }

    /// Most waiting characters of a class. Idle workers are about to take some.
    fn room(&self, class: Class) -> usize {
        let taken: usize = self.workers.iter().filter_map(|worker| worker.room()).sum();
        self.limits.room(class) + taken
    }

    /// Why `characters` more would be refused if they replaced `leaving` waiting ones of so much
    /// work.
    fn refusal(
        &self,
        order: &Order,
        characters: usize,
        (leaving, work): (usize, u64),
    ) -> Option<QueueRefusal> {
        let class = order.class;
        let pending = self.queue.pending(class) - leaving;
        let wait = self.meter.wait(self.queue.ahead(order, characters, work));
        let full = characters > self.room(class).saturating_sub(pending);
        let limited = class == Class::Request && !self.limits.max_wait.is_zero();
        let slow = limited && self.room(class) == self.limits.room(class) && wait > self.limits.max_wait;
        (full || slow).then(|| QueueRefusal {
            pending_characters: self.pending_characters(),
            expected_wait: wait,
            full: !slow,
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
        let done = finished.iter();
        let work = done
            .map(|done| self.queue.finish(done.request, done.characters))
            .sum();
        if let Some(took) = took {
            self.meter.stepped(took, work);
        }
        match self.workers.get(worker) {
            None | Some(Worker::Lost) => return,
            _ => {}
        }
        let room = room.min(self.limits.max_batch);
        let work = self.within(self.longest_batch(now));
        let slices = self.take(now, self.share(worker, room, work), work, actions);
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

    /// The limit on the time of a batch.
    fn longest_batch(&self, now: Instant) -> Duration {
        let is_recent = |plan| now.saturating_duration_since(plan) < PLANS_LATELY;
        match self.last_plan.is_some_and(is_recent) {
            true => self.limits.max_batch_time,
            false => self.limits.calls_batch_time,
        }
    }

    /// Work that a worker does in a limit of time, where zero is no limit.
    fn within(&self, time: Duration) -> u64 {
        match time.is_zero() {
            true => u64::MAX,
            false => self.meter.within(time),
        }
    }

    /// How many of the ready characters a worker with room for so many characters and so much work
    /// takes.
    fn share(&self, worker: usize, room: usize, work: u64) -> usize {
        let cap = self.queue.characters_within(work).max(1);
        let others = self.workers.iter().enumerate();
        let idle = others.filter(|&(other, state)| other != worker && state.room().is_some());
        let even = self.queue.ready().div_ceil(idle.count() + 1);
        self.limits.whole_calls(room.min(cap).min(even))
    }

    /// Takes up to `wanted` characters of at most so much work off the queue, at least one.
    fn take(
        &mut self,
        now: Instant,
        wanted: usize,
        mut work: u64,
        actions: &mut Vec<Action>,
    ) -> Vec<RequestSlice> {
        let (mut room, mut own) = (wanted, self.places_of_calls(wanted));
        let (mut calls, mut work_of_calls) = (0, 0);
        let mut shares = self
            .callers
            .shares(now, self.within(self.limits.shared_batch_time));
        let mut slices: Vec<RequestSlice> = Vec::new();
        while room > 0 {
            let calls_only = own > 0;
            let most = Room {
                characters: if calls_only { own } else { room },
                work,
                at_least_one: slices.is_empty(),
            };
            match self
                .queue
                .take(now, most, calls_only, |client| shares.left(client))
            {
                Some(Take::Slice {
                    slice,
                    client,
                    work: taken,
                }) => {
                    room -= slice.characters;
                    work = work.saturating_sub(taken);
                    own = own.saturating_sub(slice.characters);
                    if slice.class == Class::Request {
                        calls += slice.characters;
                        work_of_calls += taken;
                    }
                    shares.take(client, taken);
                    // A request comes up again after those of other clients.
                    match slices.iter_mut().find(|before| before.request == slice.request) {
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
        let taken: usize = slices.iter().map(|slice| slice.characters).sum();
        self.call_credit = (self.call_credit + taken)
            .saturating_sub(spent)
            .min(self.limits.call_share);
        let waiting = self.queue.pending(Class::Request) > 0;
        self.meter.left(now, work_of_calls, waiting);
        slices
    }

    /// How many of the `wanted` places are kept for calls.
    fn places_of_calls(&self, wanted: usize) -> usize {
        (self.call_credit + wanted)
            .checked_div(self.limits.call_share)
            .unwrap_or_default()
            .min(wanted)
    }

    /// Wakes an idle worker if characters are ready and no woken worker is on its way.
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

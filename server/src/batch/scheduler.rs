//! The batch scheduler as a pure state machine: [`Scheduler::step`] takes what happened and answers what to do.
//! It reads no clock, holds no work and does no I/O, so every rule below is tested without threads or time.
//!
//! # Order
//! Each request has a virtual deadline: its [`Order::deadline`], or its arrival where that is later, plus the
//! [handicap](Limits::handicap) of its class. The earliest goes first, and of equal ones the one that came first. So a
//! class keeps its deadlines' order, and plans of live characters go before InBetween calls until those have waited for
//! the handicap. **Nothing starves**: what comes after a request's virtual deadline has a later one, so from that moment
//! on only what already waits can go before it, and that is bounded by [`Limits::max_queued`] and [`Limits::max_live`].
//!
//! # Batches
//! - While all lanes are busy, requests wait. Free lanes share what waits: with `k` of them and `n` characters, a cut
//!   takes ⌈n / k⌉, at most a batch. A request may be split, over lanes as well. A lone request is cut at once.
//! - With [`Limits::batch_delay`], free lanes wait up to so long for [`Limits::preferred_batch`] characters.
//! - While there are live characters, a batch takes no more than it can do in [`Limits::live_slice`], by measure: a plan
//!   that comes just after the cut waits no longer than that for a lane.
//! - Callers that wait for their answers ask again a moment after they got them. So a lane that has answered several at the end of
//!   its batch (those before it are back already) and finds next to none waits up to a tenth of the time that its batch took for as many to come: else few callers fall into one group
//!   more than there are lanes, and batches are the smaller. Not while there are live characters. An engine that does not pad
//!   takes time for every row, so its lanes do not wait where a few are ready: to be idle costs more than larger batches give.
//! - A lane that has answered takes no more than lanes would have if all that is under way were shared evenly.
//! - An engine that pads computes the padding too, and one that cuts batches into calls takes nearly as long for a small call as for
//!   a large one. Where more is ready at once than a few, and work has piled up behind a busy lane, a cut is rounded down to a
//!   size without padding, or to whole calls and to half of one: the rest goes first with the next lane.
//! - Where batches are cut into calls, and most segments lately had the length of the others in their batch, a batch is one call:
//!   who comes next waits no longer than that for a lane. Else a longer one, in which more of a length meet, has fuller calls.
//!
//! # Owners
//! At most one plan of an owner is with the engine. One more may wait; a newer one takes its place, and inherits its
//! virtual deadline where that is earlier, so that a stream of plans does not push itself back.
//!
//! # Limits
//! A request that does not fit is refused whole, at once; so is an InBetween call that would wait for longer than
//! [`Limits::max_wait`] (in an overload [`Limits::max_standing_wait`]), by the rate at which such calls left the queue
//! lately. What free lanes are about to take does not count as waiting. Each class has room of its own. Work that was
//! given up, was replaced or has expired is dropped before it is cut.

mod limits;
mod meter;
mod queue;
mod standing;

use std::time::{Duration, Instant};

use self::meter::Meter;
use self::queue::{Queue, Take};
use self::standing::Standing;
use super::order::{Class, Order};
use troupe_engine::BatchSizes;

pub use limits::{Limits, Refusal};

/// How long the last plan of a live character is remembered.
const LIVE_MEMORY: Duration = Duration::from_secs(2);
/// A batch is not made smaller than this for the sake of live characters: it would cost more than it gives.
const MIN_SLICE: usize = 4;
/// Fewer characters than this are not split up to save padding or to share them: to wait for the next lane costs more. For as
/// many, a lane of an engine that does not pad waits no longer.
const MIN_SPLIT: usize = 8;
/// A lane that answered fewer callers than this waits for nobody.
const MIN_GATHER: usize = 4;
/// The part of its batch's time that a lane waits at most.
const GATHER_PART: u32 = 10;
/// Padding of more than one row in so many is not worth it while work piles up.
const MOST_PADDING: usize = 16;

/// Names a request for as long as it is known to the scheduler. Never reused, and rising with the arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A request asks for a place in the queue. Unless an [`Action::Refuse`] follows, it has one.
    Arrived {
        /// The new request.
        request: RequestId,
        /// How many characters it carries; at least one.
        characters: usize,
        /// Its claim on a place.
        order: Order,
    },
    /// Nobody waits for the request's answer any more.
    Gone {
        /// The abandoned request.
        request: RequestId,
    },
    /// A lane that has not been ready yet tried how fast it is.
    Tried {
        /// Characters of a batch.
        characters: usize,
        /// How long it took.
        took: Duration,
    },
    /// Of the batch that a lane runs, some have their answers already.
    Answered {
        /// Its number.
        lane: usize,
        /// How many characters.
        characters: usize,
        /// Whose they are: so many requests.
        callers: usize,
    },
    /// A batch has run.
    Ran {
        /// Its characters.
        characters: usize,
        /// The most of them whose segments had one length; 0 where that is not known.
        alike: usize,
    },
    /// A lane is ready for a batch: it has started, or finished the previous one.
    LaneFree {
        /// Its number.
        lane: usize,
    },
    /// A lane will run no batch any more.
    LaneLost {
        /// Its number.
        lane: usize,
    },
    /// Everything that has happened so far was told, so batches may be cut now. (Without this, the first of many
    /// requests that arrive together would always travel alone.)
    Settled,
}

/// What to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The request has no place in the queue; it is forgotten.
    Refuse {
        /// The refused request.
        request: RequestId,
        /// Why.
        refusal: Refusal,
    },
    /// A newer plan of the same owner has the place of this one, which is forgotten.
    Supersede {
        /// The older request.
        request: RequestId,
    },
    /// What is left of the request has expired, and is forgotten.
    Expire {
        /// The expired request.
        request: RequestId,
        /// How long it waited.
        waited: Duration,
    },
    /// The rest of an abandoned request has left the queue unserved.
    Drop {
        /// The abandoned request.
        request: RequestId,
        /// Characters that will not be served.
        characters: usize,
    },
    /// Run this batch; its lane counts as busy until the next [`Event::LaneFree`].
    Cut(Cut),
    /// Tell [`Event::Settled`] again at this time, unless it is told earlier.
    WakeAt(Instant),
}

/// Why a batch was cut when it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CutReason {
    /// The lane was idle when the work arrived.
    Idle,
    /// The lane became free and took its share of what waited.
    Backlog,
    /// More waits than fits into the batch.
    Full,
    /// The lane was idle, and waited for more work.
    Delayed,
}

impl CutReason {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Idle, Self::Backlog, Self::Full, Self::Delayed];

    /// The reason as a metric label.
    pub fn label(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Backlog => "backlog",
            Self::Full => "full",
            Self::Delayed => "delayed",
        }
    }
}

/// One batch: parts of requests, the most urgent first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    /// The lane that is to run it.
    pub lane: usize,
    /// What the batch carries; never empty.
    pub parts: Vec<Part>,
    /// Why it was cut now.
    pub reason: CutReason,
}

impl Cut {
    /// Characters in the batch.
    pub fn characters(&self) -> usize {
        self.parts.iter().map(|part| part.characters).sum()
    }
}

/// Consecutive characters of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// The request they belong to.
    pub request: RequestId,
    /// Its class.
    pub class: Class,
    /// Index of the first character within the request.
    pub first: usize,
    /// How many characters, at least one.
    pub characters: usize,
    /// How long they waited since the request's arrival.
    pub waited: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lane {
    /// Not free: it has not reported yet, or runs a batch.
    Busy,
    /// Free since the last event, so whatever waits has piled up meanwhile.
    JustFreed,
    Idle,
    Lost,
}

impl Lane {
    fn is_free(self) -> bool {
        matches!(self, Self::JustFreed | Self::Idle)
    }
}

/// What a lane that has answered waits for.
#[derive(Debug, Clone, Copy)]
struct Gather {
    until: Instant,
    /// Characters that were answered.
    answered: usize,
    /// Characters to have before that. Known once the lane had its first turn, for lanes before it may take of what was
    /// ready when it became free.
    wanted: Option<usize>,
}

/// The state machine. See the module's text for its rules.
#[derive(Debug)]
pub struct Scheduler {
    limits: Limits,
    queue: Queue,
    lanes: Vec<Lane>,
    gathers: Vec<Option<Gather>>,
    meter: Meter,
    sizes: BatchSizes,
    /// When free lanes cease to wait for more work, where they do.
    held_until: Option<Instant>,
    last_live: Option<Instant>,
    /// While calls are left waiting after every cut, and for a while after an overload.
    standing: Option<Standing>,
}

impl Scheduler {
    /// An empty scheduler whose lanes have not reported yet.
    pub fn new(limits: Limits) -> Self {
        Self {
            queue: Queue::new(limits.lanes),
            lanes: vec![Lane::Busy; limits.lanes],
            gathers: vec![None; limits.lanes],
            meter: Meter::new(limits.lanes),
            sizes: limits.sizes(),
            limits,
            held_until: None,
            last_live: None,
            standing: None,
        }
    }

    /// Characters that wait for a batch.
    pub fn pending_characters(&self) -> usize {
        Class::ALL
            .into_iter()
            .map(|class| self.queue.pending(class))
            .sum()
    }

    /// Requests that wait with at least one character.
    pub fn pending_requests(&self) -> usize {
        self.queue.len()
    }

    /// A lane that is free and waits for work.
    pub fn idle_lane(&self) -> Option<usize> {
        self.lanes.iter().position(|lane| lane.is_free())
    }

    /// Lanes that are not lost.
    pub fn lanes(&self) -> usize {
        self.lanes.iter().filter(|&&lane| lane != Lane::Lost).count()
    }

    /// Why an InBetween call of so many characters is refused if it comes now, where it is: to be asked before it arrives.
    pub fn refuse(&mut self, now: Instant, characters: usize) -> Option<Refusal> {
        self.refuse_of(now, Class::Request, characters, 0)
    }

    /// Takes one event, and adds what to do about it to `actions`.
    pub fn step(&mut self, now: Instant, event: Event, actions: &mut Vec<Action>) {
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
            Event::Tried { characters, took } => self.meter.ran(characters, took),
            Event::Answered {
                lane,
                characters,
                callers,
            } => self.meter.answered(lane, characters, callers),
            Event::Ran { characters, alike } => self.meter.measured(characters, alike),
            Event::LaneFree { lane } => self.lane(now, lane, Lane::JustFreed),
            Event::LaneLost { lane } => self.lane(now, lane, Lane::Lost),
            Event::Settled => self.settle(now, actions),
        }
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
        if let Some(refusal) = self.refuse_of(now, order.class, characters, leaving) {
            return actions.push(Action::Refuse { request, refusal });
        }
        let due = order.deadline.max(now) + self.limits.handicap(order.class);
        let older = self.queue.add(now, request, characters, order, due);
        actions.extend(older.map(|request| Action::Supersede { request }));
        if order.class == Class::Live {
            self.last_live = Some(now);
        }
    }

    /// [`Scheduler::refuse`] for a class, where `leaving` of those that wait make room.
    fn refuse_of(
        &mut self,
        now: Instant,
        class: Class,
        characters: usize,
        leaving: usize,
    ) -> Option<Refusal> {
        let refusal = self.refusal(now, class, characters, leaving)?;
        if class == Class::Request {
            // More than makes the limit what it is in an overload would only take longer to be forgotten.
            let beyond = self.beyond(now, self.queue.pending(class) - leaving);
            if !self.limits.is_plain_overload(self.meter.wait(beyond))
                && let Some(standing) = &mut self.standing
            {
                standing.refused(characters);
            }
        }
        Some(refusal)
    }

    /// Why so many characters would have no place, where `leaving` of those that wait make room for them.
    fn refusal(&self, now: Instant, class: Class, characters: usize, leaving: usize) -> Option<Refusal> {
        let pending = self.queue.pending(class) - leaving;
        let free = self.lanes.iter().filter(|lane| lane.is_free()).count();
        let room = self.limits.room(class) + free * self.limits.max_batch;
        let wait = self.meter.wait(pending);
        // What the lanes take with their next batches is no queue that could be shorter, however slow they are.
        let next_batches = self.lanes() * self.most(now);
        let beyond = match pending > next_batches {
            true => self.beyond(now, pending),
            false => 0,
        };
        let longest = self.limits.longest_wait(self.meter.wait(beyond));
        let full = characters > room.saturating_sub(pending);
        let slow = class == Class::Request && free == 0 && !longest.is_zero() && wait > longest;
        (full || slow).then(|| Refusal {
            pending_characters: self.pending_characters(),
            expected_wait: wait,
            full,
        })
    }

    /// Characters of calls that came beyond those that were served, where so many wait now.
    fn beyond(&self, now: Instant, pending: usize) -> usize {
        self.standing.map_or(0, |standing| standing.beyond(now, pending))
    }

    fn lane(&mut self, now: Instant, lane: usize, state: Lane) {
        let Some(known) = self.lanes.get_mut(lane) else {
            return;
        };
        if *known == Lane::Lost {
            return;
        }
        *known = state;
        let done = self.meter.done(lane, now);
        self.gathers[lane] = done
            .filter(|done| state == Lane::JustFreed && done.callers >= MIN_GATHER)
            .map(|done| Gather {
                until: now + done.took / GATHER_PART,
                answered: done.characters,
                wanted: None,
            });
        if state == Lane::Lost {
            self.meter.lost();
        }
        self.queue.done(lane);
    }

    fn settle(&mut self, now: Instant, actions: &mut Vec<Action>) {
        let most = self.most(now);
        let mut free = self.lanes.iter().filter(|lane| lane.is_free()).count();
        let mut calls = 0;
        for lane in 0..self.lanes.len() {
            if !self.lanes[lane].is_free() {
                continue;
            }
            if self.hold(now, most, actions) {
                break;
            }
            if self.gather(now, lane, most, actions) {
                continue;
            }
            let share = self.share(lane, free);
            let wanted = match self.limits.batch_delay.is_zero() {
                true => share,
                false => share.max(self.limits.preferred_batch),
            };
            let wanted = self.unpadded(lane, wanted.min(most));
            let (parts, of_calls) = self.take(now, lane, wanted, actions);
            calls += of_calls;
            free -= 1;
            if parts.is_empty() {
                continue;
            }
            let reason = match (self.lanes[lane], self.held_until) {
                _ if wanted >= most && self.queue.ready() > 0 && free == 0 => CutReason::Full,
                (_, Some(_)) => CutReason::Delayed,
                (Lane::JustFreed, _) => CutReason::Backlog,
                _ => CutReason::Idle,
            };
            self.lanes[lane] = Lane::Busy;
            actions.push(Action::Cut(Cut { lane, parts, reason }));
        }
        if self.queue.ready() == 0 || free == 0 {
            self.held_until = None;
        }
        for (lane, gather) in self.lanes.iter_mut().zip(&self.gathers) {
            if *lane == Lane::JustFreed && gather.is_none() {
                *lane = Lane::Idle;
            }
        }
        let waiting = self.queue.pending(Class::Request);
        self.meter.left(now, calls, waiting > 0);
        self.standing = Standing::after_cut(self.standing, now, waiting);
    }

    /// Whether there were plans of live characters lately.
    fn has_live(&self, now: Instant) -> bool {
        self.last_live
            .is_some_and(|last| now.saturating_duration_since(last) < LIVE_MEMORY)
    }

    /// Most characters of a batch that is cut now.
    fn most(&self, now: Instant) -> usize {
        let Limits {
            max_batch,
            call_rows,
            live_slice: slice,
            ..
        } = self.limits;
        let largest = match call_rows {
            0 => max_batch,
            _ if self.meter.lengths_differ() => max_batch,
            rows => rows.min(max_batch),
        };
        if !self.has_live(now) || slice.is_zero() {
            return largest;
        }
        let most = self.meter.batch_within(slice).max(MIN_SLICE);
        self.sizes.within(most.min(largest))
    }

    /// How much of what a lane could take it should: less by a few, where they would cost as much as many.
    fn unpadded(&self, lane: usize, wanted: usize) -> usize {
        let few = wanted < MIN_SPLIT && self.limits.call_rows == 0;
        if self.lanes[lane] != Lane::JustFreed || few {
            return wanted;
        }
        let size = self.sizes.for_rows(wanted);
        match (size - wanted) * MOST_PADDING > size {
            true => self.sizes.within(wanted),
            false => wanted,
        }
    }

    /// Whether a lane is to wait for those that it has answered.
    fn gather(&mut self, now: Instant, lane: usize, most: usize, actions: &mut Vec<Action>) -> bool {
        let never = self.has_live(now) || !self.limits.batch_delay.is_zero();
        let Some(gather) = &mut self.gathers[lane] else {
            return false;
        };
        let ready = self.queue.ready();
        let wanted = *gather.wanted.get_or_insert(ready + gather.answered);
        let worth = match self.limits.padded {
            true => most,
            false => most.min(MIN_SPLIT),
        };
        let enough = ready >= wanted.min(worth);
        if now >= gather.until || enough || never {
            self.gathers[lane] = None;
            return false;
        }
        actions.push(Action::WakeAt(gather.until));
        true
    }

    /// What a lane may take of what is ready, where `free` lanes are.
    fn share(&self, lane: usize, free: usize) -> usize {
        let ready = self.queue.ready();
        let share = ready.div_ceil(free);
        match self.lanes[lane] {
            Lane::JustFreed => {
                let even = (ready + self.meter.running()).div_ceil(self.lanes().max(1));
                share.min(even.max(MIN_SPLIT))
            }
            _ => share,
        }
    }

    /// Whether free lanes are to wait for more work.
    fn hold(&mut self, now: Instant, most: usize, actions: &mut Vec<Action>) -> bool {
        let Limits {
            batch_delay: delay,
            preferred_batch: preferred,
            ..
        } = self.limits;
        let ready = self.queue.ready();
        if delay.is_zero() || ready == 0 || ready >= preferred.min(most) {
            return false;
        }
        let until = self.queue.first_arrival().unwrap_or(now) + delay;
        let until = self.held_until.map_or(until, |held| held.min(until));
        self.held_until = Some(until);
        if until <= now {
            return false;
        }
        actions.push(Action::WakeAt(until));
        true
    }

    /// Takes up to `wanted` characters for a lane: what it takes, and how much of it is of InBetween calls.
    fn take(
        &mut self,
        now: Instant,
        lane: usize,
        wanted: usize,
        actions: &mut Vec<Action>,
    ) -> (Vec<Part>, usize) {
        let (mut room, mut calls) = (wanted, 0);
        let mut parts = Vec::new();
        while room > 0 {
            match self.queue.take(now, lane, room) {
                Some(Take::Part(part)) => {
                    room -= part.characters;
                    if part.class == Class::Request {
                        calls += part.characters;
                    }
                    parts.push(part);
                }
                Some(Take::Expired { request, waited }) => actions.push(Action::Expire { request, waited }),
                None => break,
            }
        }
        if !parts.is_empty() {
            self.meter.began(lane, now, wanted - room, parts.len());
        }
        (parts, calls)
    }
}

#[cfg(test)]
#[path = "scheduler_model_tests.rs"]
mod model_tests;
#[cfg(test)]
#[path = "scheduler_tests.rs"]
mod tests;

//! A simple model of the scheduler: one list, searched for each question.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::super::{Action, Batch, BatchReason, Finished, Limits, RequestId, RequestSlice};
use crate::order::{Class, Order, OwnerId};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fate {
    Open,
    /// All of it went to workers.
    Served,
    Refused,
    Superseded,
    Gone,
    Expired,
}

#[derive(Debug, Clone)]
pub(super) struct Known {
    order: Order,
    arrived: Instant,
    /// When the request, or the first of those whose place it inherited, arrived.
    place_since: Instant,
    due: Instant,
    characters: usize,
    next: usize,
    pub(super) fate: Fate,
}

impl Known {
    fn left(&self) -> usize {
        match self.fate {
            Fate::Open => self.characters - self.next,
            _ => 0,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum State {
    /// Not idle.
    Busy,
    Idle,
    Woken,
    Lost,
}

#[derive(Debug, Clone)]
pub(super) struct Holder {
    pub(super) state: State,
    pub(super) held: Vec<Finished>,
}

#[derive(Debug, Clone)]
pub(super) struct Model {
    limits: Limits,
    /// Jobs that a worker's generator holds.
    slots: usize,
    pub(super) now: Instant,
    pub(super) requests: BTreeMap<RequestId, Known>,
    pub(super) workers: Vec<Holder>,
    /// Time and characters of steps, from a step that finished something to the next.
    measured: Vec<(f64, usize)>,
    open_s: f64,
    /// Places since a call had one of its own.
    call_credit: usize,
}

impl Model {
    pub(super) fn new(limits: Limits, slots: usize) -> Self {
        let worker = Holder {
            state: State::Busy,
            held: Vec::new(),
        };
        Self {
            limits,
            slots,
            now: Instant::now(),
            requests: BTreeMap::new(),
            workers: vec![worker; limits.workers],
            measured: vec![(0.005, 1)],
            open_s: 0.0,
            call_credit: limits.call_share,
        }
    }

    pub(super) fn pending(&self, class: Class) -> usize {
        let of_class = |known: &&Known| known.order.class == class;
        self.requests.values().filter(of_class).map(Known::left).sum()
    }

    /// Workers that one of the states fits.
    pub(super) fn workers_in(&self, states: &[State]) -> Vec<usize> {
        let workers = 0..self.workers.len();
        workers
            .filter(|&worker| states.contains(&self.workers[worker].state))
            .collect()
    }

    /// Workers that take work at once.
    fn at_hand(&self) -> Vec<usize> {
        self.workers_in(&[State::Idle, State::Woken])
    }

    fn is_with_a_worker(&self, request: RequestId) -> bool {
        let mut held = self.workers.iter().flat_map(|worker| &worker.held);
        held.any(|held| held.request == request)
    }

    /// Whether the rule of owners lets a request start.
    fn may_start(&self, request: RequestId) -> bool {
        let Some(owner) = self.requests[&request].order.owner else {
            return true;
        };
        let others = self.requests.iter().filter(|(other, _)| **other != request);
        let mut plans = others.filter(|(_, known)| known.order.owner == Some(owner) && known.next > 0);
        !plans.any(|(other, known)| known.left() > 0 || self.is_with_a_worker(*other))
    }

    /// Everything that may start, the most urgent first.
    fn ready(&self) -> Vec<RequestId> {
        let open = self.requests.iter().filter(|(_, known)| known.left() > 0);
        let mut ready: Vec<RequestId> = open.map(|(request, _)| *request).collect();
        ready.retain(|request| self.may_start(*request));
        ready.sort_by_key(|request| (self.requests[request].due, *request));
        ready
    }

    fn ready_characters(&self) -> usize {
        let ready = self.ready();
        ready.iter().map(|request| self.requests[request].left()).sum()
    }

    pub(super) fn arrive(&mut self, request: RequestId, characters: usize, order: Order, actions: &[Action]) {
        let waits = |known: &Known| known.next == 0 && known.left() > 0;
        let replaced = self
            .requests
            .iter()
            .find(|(_, known)| order.owner.is_some() && known.order.owner == order.owner && waits(known))
            .map(|(request, _)| *request);
        let freed = replaced.map_or(0, |older| self.requests[&older].left());
        let at_hand = self.at_hand().len();
        let room = self.limits.room(order.class) + at_hand * self.limits.max_batch.min(self.slots);
        let pending = self.pending(order.class) - freed;
        let fits = pending + characters <= room;
        let mut known = Known {
            order,
            arrived: self.now,
            place_since: self.now,
            due: order.deadline.max(self.now) + self.limits.class_offset(order.class),
            characters,
            next: 0,
            fate: Fate::Open,
        };
        if let [Action::Refuse { request: of, refusal }] = actions {
            assert_eq!(*of, request);
            assert_eq!(refusal.full, !fits, "the wrong reason");
            let all: usize = Class::ALL.map(|class| self.pending(class)).iter().sum();
            assert_eq!(refusal.pending_characters, all);
            assert!(pending > 0 || refusal.expected_wait.is_zero());
            if fits {
                let max_wait = self.limits.max_wait;
                assert!(order.class == Class::Request && at_hand == 0);
                assert!(!max_wait.is_zero() && refusal.expected_wait > max_wait);
            }
            known.fate = Fate::Refused;
        } else {
            assert!(fits, "took what does not fit");
            let supersede = replaced.map(|request| Action::Supersede { request });
            assert_eq!(actions, supersede.as_slice());
            if let Some(older) = replaced.and_then(|older| self.requests.get_mut(&older)) {
                older.fate = Fate::Superseded;
                known.due = known.due.min(older.due);
                known.place_since = older.place_since;
            }
        }
        self.requests.insert(request, known);
    }

    pub(super) fn leave(&mut self, request: RequestId, actions: &[Action]) {
        let known = self.requests.get_mut(&request);
        match known.filter(|known| known.left() > 0) {
            Some(known) => {
                let characters = known.left();
                known.fate = Fate::Gone;
                assert_eq!(actions, [Action::Drop { request, characters }]);
            }
            None => assert_eq!(actions, []),
        }
    }

    /// Takes out of a worker's hands what is finished.
    pub(super) fn finish(&mut self, worker: usize, finished: &[Finished]) {
        for done in finished {
            let mut held = self.workers[worker].held.iter_mut();
            let held = held.find(|held| held.request == done.request);
            held.expect("it has some of it").characters -= done.characters;
        }
        self.workers[worker].held.retain(|held| held.characters > 0);
    }

    pub(super) fn measure(&mut self, took: Option<Duration>, finished: &[Finished]) {
        let characters: usize = finished.iter().map(|done| done.characters).sum();
        self.open_s += took.unwrap_or_default().as_secs_f64();
        if took.is_some() && characters > 0 {
            self.measured.push((self.open_s, characters));
            self.open_s = 0.0;
        }
    }

    /// What a worker does in the longest time of a batch; the numbers may differ in how they are
    /// rounded.
    pub(super) fn time_caps(&self) -> Vec<usize> {
        if self.limits.max_batch_time.is_zero() {
            return vec![usize::MAX];
        }
        let (mut time_s, mut characters, mut weight) = (0.0, 0.0, 1.0);
        for (took_s, of) in self.measured.iter().rev() {
            time_s += weight * took_s;
            characters += weight * *of as f64;
            weight *= 0.9;
        }
        let cap = self.limits.max_batch_time.as_secs_f64() / (time_s / characters).max(1e-6);
        let rounded = [cap * (1.0 - 1e-6), cap * (1.0 + 1e-6)];
        rounded.map(|cap| (cap as usize).max(1)).to_vec()
    }

    /// A worker is between two steps: the actions that the scheduler must give.
    pub(super) fn boundary(&mut self, worker: usize, took: Option<Duration>, time_cap: usize) -> Vec<Action> {
        let room = self.room(worker).min(self.limits.max_batch);
        let others = self.at_hand().iter().filter(|&&other| other != worker).count();
        let even = self.ready_characters().div_ceil(others + 1);
        let mut wanted = room.min(time_cap).min(even);
        let rows = self.limits.call_rows;
        while rows > 0 && wanted > rows && !wanted.is_multiple_of(rows) {
            wanted -= 1;
        }
        let (mut actions, mut slices) = (Vec::new(), Vec::<RequestSlice>::new());
        let (mut expires, mut calls) = (false, 0);
        let share = self.limits.call_share;
        self.call_credit += wanted;
        let mut own = self.call_credit.checked_div(share).unwrap_or(0).min(wanted);
        while wanted > 0
            && let ready = self.ready()
            && let Some(&first) = ready.first()
        {
            let is_call = |request: &&RequestId| self.requests[*request].order.class == Class::Request;
            let request = match ready.iter().find(is_call) {
                Some(&call) if own > 0 => call,
                _ => {
                    own = 0;
                    first
                }
            };
            let place_since = self.requests[&request].place_since;
            // What came after another's virtual deadline does not go before it, but to a place of
            // calls.
            for other in ready.iter().filter(|_| own == 0) {
                assert!(place_since <= self.requests[other].due, "{other:?} is starved");
            }
            let known = self.requests.get_mut(&request).unwrap();
            let waited = self.now - known.arrived;
            if known.order.expires.is_some_and(|expires| expires <= self.now) {
                known.fate = Fate::Expired;
                expires = true;
                actions.push(Action::Expire { request, waited });
                continue;
            }
            let characters = known.left().min(if own > 0 { own } else { wanted });
            wanted -= characters;
            own = own.saturating_sub(characters);
            if known.order.class == Class::Request {
                calls += characters;
            }
            match slices.iter_mut().find(|slice| slice.request == request) {
                Some(slice) => slice.characters += characters,
                None => slices.push(RequestSlice {
                    request,
                    class: known.order.class,
                    first: known.next,
                    characters,
                    waited,
                }),
            }
            known.next += characters;
            if known.next == known.characters {
                known.fate = Fate::Served;
            }
            let held = &mut self.workers[worker].held;
            match held.iter_mut().find(|held| held.request == request) {
                Some(held) => held.characters += characters,
                None => held.push(Finished { request, characters }),
            }
        }
        self.call_credit = self.call_credit.saturating_sub(calls * share).min(share);
        let is_idle = self.workers[worker].held.is_empty();
        self.workers[worker].state = if is_idle { State::Idle } else { State::Busy };
        let reason = match took {
            _ if !self.ready().is_empty() => BatchReason::Full,
            Some(_) => BatchReason::Backlog,
            None => BatchReason::Idle,
        };
        if !slices.is_empty() {
            actions.push(Action::Start(Batch {
                worker,
                slices,
                reason,
            }));
        } else {
            assert!(
                room == 0 || expires || self.ready().is_empty(),
                "took nothing of what is ready"
            );
        }
        actions
    }

    pub(super) fn room(&self, worker: usize) -> usize {
        let held: usize = self.workers[worker].held.iter().map(|held| held.characters).sum();
        self.slots - held
    }

    /// Notes woken workers. After that at most one is on its way, and none sleeps while something
    /// is ready.
    pub(super) fn wake(&mut self, woken: &[usize]) {
        for &worker in woken {
            assert!(!self.ready().is_empty(), "woken for nothing");
            assert_eq!(self.workers_in(&[State::Idle]).first(), Some(&worker));
            self.workers[worker].state = State::Woken;
        }
        let on_the_way = self.workers_in(&[State::Woken]).len();
        assert!(on_the_way <= 1);
        assert!(
            self.ready().is_empty() || on_the_way == 1 || self.workers_in(&[State::Idle]).is_empty(),
            "a worker sleeps while something is ready"
        );
    }

    /// At most one plan of an owner is with workers.
    pub(super) fn check_owners(&self) {
        let mut plans: BTreeMap<OwnerId, RequestId> = BTreeMap::new();
        for held in self.workers.iter().flat_map(|worker| &worker.held) {
            if let Some(owner) = self.requests[&held.request].order.owner {
                let first = *plans.entry(owner).or_insert(held.request);
                assert_eq!(first, held.request, "two plans of {owner:?}");
            }
        }
    }
}

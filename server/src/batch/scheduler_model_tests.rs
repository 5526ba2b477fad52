//! The scheduler against a model that keeps everything in one list and looks through it.

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::batch::order::OwnerId;

#[derive(Debug, Clone)]
enum Step {
    Arrive {
        characters: usize,
        owner: Option<u64>,
        deadline_ms: u64,
        expires_ms: Option<u64>,
    },
    /// The n-th request that ever arrived (modulo their number) goes away.
    Leave(usize),
    /// The n-th lane that has a batch (modulo their number) is done with it.
    Finish(usize),
    /// The n-th lane that has a batch (modulo their number) has answered some of it.
    Answer(usize),
    /// The n-th lane is lost, unless it is the last.
    Lose(usize),
    Settle,
    Pass(u64),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let arrive = (
        1usize..12,
        prop::option::of(0u64..5),
        0u64..300,
        prop::option::weighted(0.2, 0u64..200),
    );
    let arrive = arrive.prop_map(|(characters, owner, deadline_ms, expires_ms)| Step::Arrive {
        characters: if owner.is_some() {
            characters % 3 + 1
        } else {
            characters
        },
        owner,
        deadline_ms,
        expires_ms,
    });
    let step = prop_oneof![
        8 => arrive,
        2 => any::<usize>().prop_map(Step::Leave),
        5 => any::<usize>().prop_map(Step::Finish),
        3 => any::<usize>().prop_map(Step::Answer),
        1 => any::<usize>().prop_map(Step::Lose),
        6 => Just(Step::Settle),
        5 => (0u64..80).prop_map(Step::Pass),
    ];
    prop::collection::vec(step, 1..150)
}

fn some_limits() -> impl Strategy<Value = Limits> {
    let slice = prop_oneof![Just(0u64), 1u64..100];
    let delay = (prop_oneof![Just(0u64), 1u64..50], 0usize..6);
    let batch = (1usize..20, any::<bool>(), prop_oneof![Just(0usize), 1usize..9]);
    let wait = || prop_oneof![Just(0u64), 1u64..200];
    let delays = (delay, slice, wait(), wait());
    (1usize..5, batch, 0usize..40, 0u64..400, delays).prop_map(
        |(lanes, (max_batch, padded, call_rows), spare, ageing_ms, delays)| {
            let ((delay_ms, preferred_batch), slice_ms, wait_ms, standing_ms) = delays;
            Limits {
                lanes,
                max_batch,
                padded,
                call_rows,
                max_queued: 12 + spare,
                max_live: 3 + spare,
                max_wait: Duration::from_millis(wait_ms),
                max_standing_wait: Duration::from_millis(standing_ms),
                ageing: Duration::from_millis(ageing_ms),
                batch_delay: Duration::from_millis(delay_ms),
                preferred_batch,
                live_slice: Duration::from_millis(slice_ms),
                lane_spin: Duration::ZERO,
            }
        },
    )
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    Open,
    /// All cut.
    Served,
    Refused,
    Superseded,
    Gone,
    Expired,
}

#[derive(Debug)]
struct Known {
    order: Order,
    /// When the request, or the first of those whose place it inherited, arrived.
    place_since: Instant,
    due: Instant,
    characters: usize,
    next: usize,
    fate: Fate,
}

impl Known {
    fn left(&self) -> usize {
        if self.fate == Fate::Open {
            self.characters - self.next
        } else {
            0
        }
    }
}

struct Model {
    limits: Limits,
    now: Instant,
    requests: BTreeMap<RequestId, Known>,
    lanes: BTreeMap<usize, Option<Vec<RequestId>>>,
    /// Since when lanes run batches, and how many characters and callers of them are not answered.
    running: BTreeMap<usize, (Instant, usize, usize)>,
    /// Until when lanes may wait for those that they have answered.
    gathers: BTreeMap<usize, Instant>,
    /// The fewest that were left waiting since none were.
    fewest: usize,
    /// How many were refused and are remembered, at most.
    refused: f64,
    /// Since when none are left waiting.
    empty_since: Option<Instant>,
}

impl Model {
    fn new(limits: Limits) -> Self {
        let now = Instant::now();
        Self {
            limits,
            now,
            requests: BTreeMap::new(),
            lanes: (0..limits.lanes).map(|lane| (lane, None)).collect(),
            running: BTreeMap::new(),
            gathers: BTreeMap::new(),
            fewest: 0,
            refused: 0.0,
            empty_since: Some(now),
        }
    }

    fn pending(&self, class: Class) -> usize {
        let of_class = |known: &&Known| known.order.class == class;
        self.requests.values().filter(of_class).map(Known::left).sum()
    }

    fn free_lanes(&self) -> usize {
        self.lanes.values().filter(|lane| lane.is_none()).count()
    }

    fn with_a_lane(&self, request: RequestId) -> bool {
        self.lanes
            .values()
            .flatten()
            .any(|parts| parts.contains(&request))
    }

    /// Whether the owner rule lets a request be cut.
    fn may_be_cut(&self, request: RequestId) -> bool {
        let Some(owner) = self.requests[&request].order.owner else {
            return true;
        };
        let mut others = self
            .requests
            .iter()
            .filter(|(other, known)| **other != request && known.order.owner == Some(owner));
        !others.any(|(other, known)| known.next > 0 && (known.left() > 0 || self.with_a_lane(*other)))
    }

    /// Everything that may be cut, the most urgent first.
    fn ready(&self) -> Vec<RequestId> {
        let open = self.requests.iter().filter(|(_, known)| known.left() > 0);
        let mut ready: Vec<RequestId> = open.map(|(request, _)| *request).collect();
        ready.retain(|request| self.may_be_cut(*request));
        ready.sort_by_key(|request| (self.requests[request].due, *request));
        ready
    }

    fn ready_characters(&self) -> usize {
        self.ready()
            .iter()
            .map(|request| self.requests[request].left())
            .sum()
    }

    fn sizes(&self) -> BatchSizes {
        match self.limits.call_rows {
            0 => BatchSizes::new(self.limits.max_batch, !self.limits.padded),
            rows => BatchSizes::of_calls(self.limits.max_batch, rows),
        }
    }

    /// Characters of a batch that is one call of the engine, where it cuts batches into calls; else of the largest.
    fn one_call(&self) -> usize {
        match self.limits.call_rows {
            0 => self.limits.max_batch,
            rows => rows.min(self.limits.max_batch),
        }
    }

    /// Whether a call may be refused for so long a wait.
    fn is_too_long(&self, class: Class, pending: usize, wait: Duration) -> bool {
        let Limits {
            max_wait,
            max_standing_wait,
            ..
        } = self.limits;
        // Live characters make batches, and with them what may always wait, smaller, and so may segments of one length: by
        // measures that are not known here, to four and to a call at the least.
        let least = match self.limits.live_slice.is_zero() {
            true => self.one_call(),
            false => self.sizes().within(self.one_call().min(4)),
        };
        let stands = !max_standing_wait.is_zero() && pending > self.lanes.len() * least;
        // It falls from the one to the other, by what came beyond what was served; a character waits `wait / pending`.
        let more = match self.empty_since {
            Some(_) => 0,
            None => pending - self.fewest.min(pending),
        };
        let beyond = more + self.remembered() as usize;
        let share =
            3.0 * beyond as f64 * wait.as_secs_f64() / (pending.max(1) as f64 * max_wait.as_secs_f64());
        let fallen = max_wait.saturating_sub(max_standing_wait).mul_f64(share.min(1.0));
        let too_long = wait > max_wait || stands && wait + Duration::from_nanos(100) > max_wait - fallen;
        class == Class::Request && self.free_lanes() == 0 && !max_wait.is_zero() && too_long
    }

    /// Refused characters, less by two thirds for each second that no calls are left waiting.
    fn remembered(&self) -> f64 {
        let empty = self
            .empty_since
            .map(|since| self.now.saturating_duration_since(since));
        self.refused * (-empty.unwrap_or_default().as_secs_f64()).exp()
    }

    fn arrive(&mut self, request: RequestId, characters: usize, order: Order, actions: &[Action]) {
        let replaced = self
            .requests
            .iter()
            .find(|(_, known)| {
                order.owner.is_some()
                    && known.order.owner == order.owner
                    && known.next == 0
                    && known.left() > 0
            })
            .map(|(request, _)| *request);
        let freed = replaced.map_or(0, |older| self.requests[&older].left());
        let room = self.limits.room(order.class) + self.free_lanes() * self.limits.max_batch;
        let pending = self.pending(order.class) - freed;
        let fits = pending + characters <= room;
        let too_slow = match actions {
            [Action::Refuse { refusal, .. }] => {
                assert_eq!(refusal.full, !fits, "the wrong reason");
                !refusal.full && self.is_too_long(order.class, pending, refusal.expected_wait)
            }
            _ => false,
        };
        let fits = fits && !too_slow;
        if (fits, order.class) == (false, Class::Request) {
            self.refused += characters as f64;
        }
        let mut known = Known {
            order,
            place_since: self.now,
            due: order.deadline.max(self.now) + self.limits.handicap(order.class),
            characters,
            next: 0,
            fate: if fits { Fate::Open } else { Fate::Refused },
        };
        match (fits, replaced) {
            (false, _) => assert!(
                matches!(actions, [Action::Refuse { request: refused, .. }] if *refused == request),
                "took what does not fit: {actions:?}"
            ),
            (true, None) => assert_eq!(actions, []),
            (true, Some(older)) => {
                assert_eq!(actions, [Action::Supersede { request: older }]);
                let older = self.requests.get_mut(&older).unwrap();
                older.fate = Fate::Superseded;
                known.due = known.due.min(older.due);
                known.place_since = older.place_since;
            }
        }
        self.requests.insert(request, known);
    }

    fn leave(&mut self, request: RequestId, actions: &[Action]) {
        let Some(known) = self.requests.get_mut(&request) else {
            return assert_eq!(actions, []);
        };
        let characters = known.left();
        if characters == 0 {
            return assert_eq!(actions, []);
        }
        known.fate = Fate::Gone;
        assert_eq!(actions, [Action::Drop { request, characters }]);
    }

    /// Notes that a lane has answered some, and gives how many characters of how many callers.
    fn answer(&mut self, lane: usize, nth: usize) -> (usize, usize) {
        let Some((_, unanswered, callers)) = self.running.get_mut(&lane) else {
            return (0, 0);
        };
        let characters = nth % (*unanswered + 1);
        let whose = characters.min(*callers);
        *unanswered -= characters;
        *callers -= whose;
        (characters, whose)
    }

    fn finish(&mut self, lane: usize) {
        self.lanes.insert(lane, None);
        if let Some((since, _, callers)) = self.running.remove(&lane)
            && callers >= 4
        {
            self.gathers.insert(lane, self.now + (self.now - since) / 10);
        }
    }

    fn settle(&mut self, actions: Vec<Action>) {
        let mut held = false;
        let expires = actions
            .iter()
            .any(|action| matches!(action, Action::Expire { .. }));
        for action in actions {
            match action {
                Action::Expire { request, .. } => {
                    let known = self.requests.get_mut(&request).unwrap();
                    assert!(known.left() > 0 && known.order.expires.unwrap() <= self.now);
                    known.fate = Fate::Expired;
                }
                Action::WakeAt(at) => {
                    let delayed = at <= self.now + self.limits.batch_delay;
                    assert!(at > self.now && (delayed || self.gathers.values().any(|&until| until == at)));
                    held |= delayed;
                }
                Action::Cut(cut) => self.cut(&cut, expires),
                other => panic!("unexpected {other:?}"),
            }
        }
        let pending = self.pending(Class::Request);
        self.refused = self.remembered();
        self.fewest = match self.empty_since {
            Some(_) => pending,
            None => self.fewest.min(pending),
        };
        self.empty_since = (pending == 0).then_some(self.now);
        let free = self.lanes.iter().filter(|(_, parts)| parts.is_none());
        let gather = |lane| self.gathers.get(lane).is_some_and(|&until| until > self.now);
        assert!(
            held || self.ready().is_empty() || free.into_iter().all(|(lane, _)| gather(lane)),
            "a lane is idle while work waits"
        );
    }

    fn cut(&mut self, cut: &Cut, expires: bool) {
        let size = cut.characters();
        assert!((1..=self.limits.max_batch).contains(&size));
        assert_eq!(self.lanes[&cut.lane], None, "the lane is not free");
        let share = self.ready_characters().div_ceil(self.free_lanes());
        if self.limits.batch_delay.is_zero() && self.limits.live_slice.is_zero() && !expires {
            let running: usize = self.running.values().map(|(_, characters, _)| characters).sum();
            let even = (self.ready_characters() + running)
                .div_ceil(self.lanes.len())
                .max(8);
            let may_be = |whole: usize| {
                let sizes = self.sizes();
                let without_padding = sizes.all().iter().copied().rfind(|&size| size <= whole);
                let many = whole >= 8 || self.limits.call_rows > 0;
                let rounded = many && Some(size) == without_padding;
                size == whole || rounded
            };
            // By measures that are not known here, a batch is one call at most.
            let wholes = [self.limits.max_batch, self.one_call()].map(|most| share.min(most));
            assert!(
                wholes
                    .iter()
                    .any(|&whole| may_be(whole) || may_be(whole.min(even))),
                "{size} of {wholes:?} or {even}"
            );
        }
        self.running.insert(cut.lane, (self.now, size, cut.parts.len()));
        self.gathers.remove(&cut.lane);
        self.lanes.insert(cut.lane, Some(Vec::new()));
        for part in &cut.parts {
            let ready = self.ready();
            // One that expires while a batch is put together may let its owner's next plan in, behind what the batch has.
            match expires {
                true => assert!(ready.contains(&part.request), "not its turn"),
                false => assert_eq!(ready.first(), Some(&part.request), "not the most urgent"),
            }
            // What came after another's virtual deadline does not go before it.
            let place_since = self.requests[&part.request].place_since;
            for other in ready.iter().filter(|_| !expires) {
                assert!(place_since <= self.requests[other].due, "{other:?} is starved");
            }
            let known = self.requests.get_mut(&part.request).unwrap();
            assert!(known.order.expires.is_none_or(|expires| expires > self.now));
            assert_eq!(part.first, known.next, "characters lost, or served twice");
            assert!((1..=known.left()).contains(&part.characters));
            known.next += part.characters;
            if known.next == known.characters {
                known.fate = Fate::Served;
            }
            self.lanes
                .entry(cut.lane)
                .and_modify(|parts| parts.get_or_insert_default().push(part.request));
        }
    }
}

/// A scheduler and its model, side by side.
struct Pair {
    scheduler: Scheduler,
    model: Model,
    arrivals: u64,
}

impl Pair {
    fn new(limits: Limits) -> Self {
        let mut pair = Self {
            scheduler: Scheduler::new(limits),
            model: Model::new(limits),
            arrivals: 0,
        };
        for lane in 0..limits.lanes {
            pair.step(Event::LaneFree { lane });
        }
        pair
    }

    fn step(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        self.scheduler.step(self.model.now, event, &mut actions);
        actions
    }

    /// The n-th lane that has a batch.
    fn busy(&self, nth: usize) -> Option<usize> {
        let busy = self.model.lanes.iter().filter(|(_, parts)| parts.is_some());
        let busy: Vec<usize> = busy.map(|(lane, _)| *lane).collect();
        busy.get(nth % busy.len().max(1)).copied()
    }

    fn take(&mut self, step: Step) {
        match step {
            Step::Arrive {
                characters,
                owner,
                deadline_ms,
                expires_ms,
            } => {
                self.arrivals += 1;
                let request = RequestId(self.arrivals);
                let after = |ms| self.model.now + Duration::from_millis(ms);
                let order = match owner {
                    Some(owner) => Order::live(OwnerId(owner), after(deadline_ms)),
                    None => Order::request(after(deadline_ms)),
                };
                let order = Order {
                    expires: expires_ms.map(after),
                    ..order
                };
                let actions = self.step(Event::Arrived {
                    request,
                    characters,
                    order,
                });
                self.model.arrive(request, characters, order, &actions);
            }
            Step::Leave(nth) => {
                let request = RequestId(1 + nth as u64 % self.arrivals.max(1));
                let actions = self.step(Event::Gone { request });
                self.model.leave(request, &actions);
            }
            Step::Answer(nth) => {
                if let Some(lane) = self.busy(nth) {
                    let (characters, callers) = self.model.answer(lane, nth / 7);
                    let answered = Event::Answered {
                        lane,
                        characters,
                        callers,
                    };
                    assert_eq!(self.step(answered), []);
                }
            }
            Step::Finish(nth) => {
                if let Some(lane) = self.busy(nth) {
                    let ran = Event::Ran {
                        characters: 8,
                        alike: 1 + nth % 8,
                    };
                    assert_eq!(self.step(ran), []);
                    assert_eq!(self.step(Event::LaneFree { lane }), []);
                    self.model.finish(lane);
                }
            }
            Step::Lose(nth) => {
                if self.model.lanes.len() > 1 {
                    let lane = nth % self.model.limits.lanes;
                    assert_eq!(self.step(Event::LaneLost { lane }), []);
                    self.model.lanes.remove(&lane);
                    self.model.running.remove(&lane);
                }
            }
            Step::Settle => {
                let actions = self.step(Event::Settled);
                self.model.settle(actions);
            }
            Step::Pass(ms) => self.model.now += Duration::from_millis(ms),
        }
        let pending: usize = Class::ALL
            .into_iter()
            .map(|class| self.model.pending(class))
            .sum();
        assert_eq!(self.scheduler.pending_characters(), pending);
        let free = self.model.free_lanes() > 0;
        assert_eq!(self.scheduler.idle_lane().is_some(), free);
    }
}

proptest! {
    #[test]
    fn it_does_what_the_model_does(limits in some_limits(), steps in steps()) {
        let mut pair = Pair::new(limits);
        for step in steps {
            pair.take(step);
        }
        // All that was admitted is served in the end, once lanes are done and held work has waited.
        for _ in 0..10_000 {
            if pair.scheduler.pending_requests() == 0 {
                break;
            }
            pair.take(Step::Finish(0));
            pair.take(Step::Pass(10));
            pair.take(Step::Settle);
        }
        let open = pair.model.requests.values().filter(|known| known.fate == Fate::Open);
        prop_assert_eq!(open.count(), 0, "a request was lost");
    }

    #[test]
    fn no_order_of_events_panics(
        limits in some_limits(),
        events in prop::collection::vec((0usize..9, 0usize..6, 0u64..20), 1..200),
    ) {
        let (mut scheduler, mut actions) = (Scheduler::new(limits), Vec::new());
        let mut now = Instant::now();
        for (next, (kind, lane, number)) in events.into_iter().enumerate() {
            let event = match kind {
                0 | 1 => Event::Arrived {
                    request: RequestId(next as u64),
                    characters: 1 + number as usize,
                    order: match kind {
                        0 => Order::request(now),
                        _ => Order::live(OwnerId(number % 3), now),
                    },
                },
                2 => Event::Gone { request: RequestId(number * 7) },
                3 => Event::LaneFree { lane },
                4 if number == 0 => Event::LaneLost { lane },
                6 => Event::Ran { characters: number as usize, alike: lane },
                7 => Event::Answered { lane, characters: number as usize, callers: number as usize / 2 },
                5 => Event::Tried { characters: lane, took: Duration::from_millis(number) },
                _ => Event::Settled,
            };
            scheduler.step(now, event, &mut actions);
            for action in actions.drain(..) {
                if let Action::Cut(cut) = action {
                    prop_assert!((1..=limits.max_batch).contains(&cut.characters()));
                    prop_assert!(cut.lane < limits.lanes);
                }
            }
            // Clocks may jump back between threads by a little.
            now = if number % 2 == 0 { now + Duration::from_millis(number) } else { now - Duration::from_millis(1) };
        }
    }
}

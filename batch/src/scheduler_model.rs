//! A simple model of the scheduler: one list, searched for each question.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use super::super::{Action, Batch, BatchReason, Finished, Limits, RequestId, RequestSlice};
use troupe_base::turns::ClientId;

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

    fn work_left(&self) -> u64 {
        self.left() as u64 * u64::from(self.order.work)
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

/// A client or a group of a class, by name.
type Name = (Class, u64, Option<u64>);

#[derive(Debug, Clone)]
pub(super) struct Model {
    limits: Limits,
    /// Jobs that a worker's generator holds.
    slots: usize,
    pub(super) now: Instant,
    pub(super) requests: BTreeMap<RequestId, Known>,
    pub(super) workers: Vec<Holder>,
    /// Time and work of steps, from a step that finished something to the next.
    measured: Vec<(f64, u64)>,
    open_s: f64,
    /// Places since a call had one of its own.
    call_credit: usize,
    /// Virtual times of clients and groups.
    times: BTreeMap<Name, u64>,
    /// The virtual time of what was taken last: of groups by class, of clients by class and group.
    nows: BTreeMap<(Class, Option<u64>), u64>,
    /// Clients and groups that had something ready.
    working: BTreeSet<Name>,
    arrivals: Vec<Arrival>,
}

/// A request that came, and whether its group and its client had little open with it.
#[derive(Debug, Clone, Copy)]
struct Arrival {
    at: Instant,
    client: ClientId,
    is_call: bool,
    small: [bool; 2],
}

/// Whether two names take turns with each other.
fn same_level(one: &Name, other: &Name) -> bool {
    let level = |(class, group, own): &Name| (*class, own.map(|_| *group));
    level(one) == level(other)
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
            measured: vec![(25e-6, 1)],
            open_s: 0.0,
            call_credit: limits.call_share,
            times: BTreeMap::new(),
            nows: BTreeMap::new(),
            working: BTreeSet::new(),
            arrivals: Vec::new(),
        }
    }

    /// The client and the group of a request.
    fn names(&self, request: RequestId) -> [Name; 2] {
        let Order { class, client, .. } = self.requests[&request].order;
        [
            (class, client.group, Some(client.own)),
            (class, client.group, None),
        ]
    }

    /// The virtual time of those among which a name takes its turn.
    fn now_of(&mut self, (class, group, own): Name) -> &mut u64 {
        self.nows.entry((class, own.map(|_| group))).or_default()
    }

    /// Clients and groups that begin to wait start at the time of what was taken last.
    fn look_who_works(&mut self) {
        let working: BTreeSet<Name> = (self.ready().iter())
            .flat_map(|request| self.names(*request))
            .collect();
        // If no one waits any more, all are even.
        let rests: Vec<Name> = (self.times.keys())
            .filter(|name| !working.iter().any(|other| same_level(name, other)))
            .copied()
            .collect();
        for name in rests {
            let time = self.times[&name];
            let now = self.now_of(name);
            *now = time.max(*now);
        }
        for &name in working.difference(&self.working.clone()) {
            let now = *self.now_of(name);
            let time = self.times.entry(name).or_default();
            *time = now.max(*time);
        }
        self.working = working;
    }

    /// The turns of those that `fits` allows, and how far behind each the next one is.
    fn turns(&self, fits: impl Fn(&Name) -> bool) -> Vec<(Name, Option<u64>)> {
        let mut order: Vec<(u64, Name)> = (self.working.iter())
            .filter(|name| fits(name))
            .map(|name| (self.times[name], *name))
            .collect();
        order.sort();
        let behind = |place: usize| order.get(place + 1).map(|next| next.0 - order[place].0);
        (0..order.len())
            .map(|place| (order[place].1, behind(place)))
            .collect()
    }

    /// The request of a class that goes first among those that `may_go`, and how many of its
    /// characters.
    fn first_of(&self, class: Class, may_go: &impl Fn(RequestId) -> bool) -> Option<(RequestId, usize)> {
        let ready = self.ready();
        for (group, ahead) in self.turns(|name| name.0 == class && name.2.is_none()) {
            for (client, ahead_too) in
                self.turns(|name| name.0 == class && name.1 == group.1 && name.2.is_some())
            {
                let request = ready.iter().find(|request| self.names(**request)[0] == client);
                let request = *request.expect("a client that works has something ready");
                if !may_go(request) {
                    continue;
                }
                let [of_client, of_group] = self.costs(request);
                let most = [(ahead, of_group), (ahead_too, of_client)]
                    .map(|(ahead, cost)| ahead.map(|ahead| ahead / cost));
                let most = most.into_iter().flatten().min();
                return Some((request, most.map_or(usize::MAX, |most| most as usize + 1)));
            }
        }
        None
    }

    fn charge(&mut self, request: RequestId, characters: usize) {
        for (name, cost) in self.names(request).into_iter().zip(self.costs(request)) {
            let time = self.times[&name];
            // Those that were passed over are even with it now.
            for other in self.working.iter().filter(|other| same_level(&name, other)) {
                let passed = self.times.entry(*other).or_default();
                *passed = time.max(*passed);
            }
            let now = self.now_of(name);
            *now = time.max(*now);
            self.times.insert(name, time + cost * characters as u64);
        }
    }

    /// What one character of a request costs its client and its group.
    fn costs(&self, request: RequestId) -> [u64; 2] {
        let Order { work, client, .. } = self.requests[&request].order;
        [work.into(), u64::from(work) * 1000 / u64::from(client.share)]
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

    fn ready_work(&self) -> u64 {
        let ready = self.ready();
        ready
            .iter()
            .map(|request| self.requests[request].work_left())
            .sum()
    }

    /// The calls that leave a full queue for one more: again and again the least urgent unstarted
    /// call of the client with most waiting, in the group with most waiting.
    fn push_out(&self, order: Order, characters: usize, lacking: usize) -> Option<Vec<RequestId>> {
        let mut waiting: Vec<(RequestId, &Known)> = (self.requests.iter())
            .filter(|(_, known)| known.order.class == order.class && known.left() > 0)
            .map(|(request, known)| (*request, known))
            .collect();
        let (mut out, mut freed) = (Vec::new(), 0);
        while freed < lacking {
            let (mut groups, mut clients) = (BTreeMap::new(), BTreeMap::new());
            let work = characters as u64 * u64::from(order.work);
            let all = (waiting.iter()).map(|(_, known)| (known.order.client, known.work_left()));
            for (client, work) in all.chain([(order.client, work)]) {
                *groups.entry(client.group).or_insert(0) += work * 1000;
                *clients.entry(client).or_insert(0) += work;
            }
            for (group, work) in &mut groups {
                *work /= group + 1;
            }
            let heaviest = |(group, work): &(&u64, &u64)| (**work, **group == order.client.group, **group);
            let (&group, _) = groups.iter().max_by_key(heaviest)?;
            let heaviest =
                |(client, work): &(&ClientId, &u64)| (**work, **client != order.client, client.own);
            let of_group = clients.iter().filter(|(client, _)| client.group == group);
            let (&client, &work) = of_group.max_by_key(heaviest)?;
            let own = clients[&order.client];
            if group == order.client.group && (client == order.client || work <= own) {
                return None;
            }
            let of_client = |started: bool| {
                let calls = waiting.iter();
                let calls =
                    calls.filter(|(_, known)| known.order.client == client && (known.next > 0) == started);
                calls.max_by_key(|(request, known)| (known.due, *request))
            };
            let &(request, known) = of_client(false).or_else(|| of_client(true))?;
            out.push(request);
            freed += known.left();
            waiting.retain(|(other, _)| *other != request);
        }
        Some(out)
    }

    /// A request came when a part of a batch was so much work.
    pub(super) fn arrive(
        &mut self,
        request: RequestId,
        characters: usize,
        order: Order,
        (part, actions): (u64, &[Action]),
    ) {
        let caps = self.within(self.limits.shared_batch_time);
        assert!(caps.iter().any(|cap| part.abs_diff(*cap) <= 1));
        let open = |same: &dyn Fn(ClientId) -> bool| -> u64 {
            let of_class = |known: &Known| same(known.order.client) && known.order.class == order.class;
            let waiting = self
                .requests
                .values()
                .filter(|known| of_class(known))
                .map(Known::work_left);
            let held = self.workers.iter().flat_map(|worker| &worker.held);
            let held = held.map(|held| (&self.requests[&held.request], held.characters as u64));
            let running = held.filter(|(known, _)| of_class(known));
            let running = running.map(|(known, characters)| characters * u64::from(known.order.work));
            waiting.chain(running).sum()
        };
        let open = [
            open(&|client| client.group == order.client.group),
            open(&|client| client == order.client),
        ];
        let asked = u64::from(order.work) * characters as u64;
        self.arrivals.push(Arrival {
            at: self.now,
            client: order.client,
            is_call: order.class == Class::Request,
            small: open.map(|open| open + asked <= part || (open == 0 && characters == 1)),
        });
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
            let max_wait = self.limits.max_wait;
            let is_slow = order.class == Class::Request
                && at_hand == 0
                && !max_wait.is_zero()
                && refusal.expected_wait > max_wait;
            assert_eq!(refusal.full, !is_slow, "the wrong reason");
            assert!(is_slow || !fits, "refused without a reason");
            let all: usize = Class::ALL.map(|class| self.pending(class)).iter().sum();
            assert_eq!(refusal.pending_characters, all);
            assert!(pending > 0 || refusal.expected_wait.is_zero());
            known.fate = Fate::Refused;
            if refusal.full && order.class == Class::Request {
                let lacking = pending + characters - room.max(pending);
                assert_eq!(self.push_out(order, characters, lacking), None, "could make room");
            }
        } else if !fits && order.class == Class::Request {
            let out = self.push_out(order, characters, pending + characters - room.max(pending));
            let pushed: Vec<RequestId> = (actions.iter())
                .map(|action| match action {
                    Action::PushOut { request, refusal } if refusal.full => *request,
                    other => panic!("{other:?}"),
                })
                .collect();
            assert_eq!(Some(&pushed), out.as_ref(), "the wrong ones leave");
            for request in pushed {
                self.requests.get_mut(&request).expect("it waits").fate = Fate::Refused;
                self.look_who_works();
            }
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
        self.look_who_works();
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
        self.look_who_works();
    }

    /// Takes out of a worker's hands what is finished.
    pub(super) fn finish(&mut self, worker: usize, finished: &[Finished]) {
        for done in finished {
            let mut held = self.workers[worker].held.iter_mut();
            let held = held.find(|held| held.request == done.request);
            held.expect("it has some of it").characters -= done.characters;
        }
        self.workers[worker].held.retain(|held| held.characters > 0);
        self.look_who_works();
    }

    pub(super) fn measure(&mut self, took: Option<Duration>, finished: &[Finished]) {
        let work =
            |done: &Finished| done.characters as u64 * u64::from(self.requests[&done.request].order.work);
        let work = finished.iter().map(work).sum();
        self.open_s += took.unwrap_or_default().as_secs_f64();
        if took.is_some() && work > 0 {
            self.measured.push((self.open_s, work));
            self.open_s = 0.0;
        }
    }

    /// Whether in the last three seconds one asked for much, and another called for little and had
    /// made no large call for three seconds. `key` names who counts as one; `level` is the place of
    /// its smallness in arrivals.
    fn are_two(&self, level: usize, key: impl Fn(&Arrival) -> Option<u64>) -> bool {
        let memory = Duration::from_secs(3);
        let lately = |arrival: &Arrival| self.now - arrival.at < memory;
        let is_little = |place: usize| {
            let call = &self.arrivals[place];
            let was_large = |other: &Arrival| {
                let is_large = other.is_call && !other.small[level];
                is_large && key(other) == key(call) && call.at - other.at < memory
            };
            call.is_call && call.small[level] && !self.arrivals[..place].iter().any(was_large)
        };
        let little: Vec<u64> = (0..self.arrivals.len())
            .filter(|place| lately(&self.arrivals[*place]) && is_little(*place))
            .filter_map(|place| key(&self.arrivals[place]))
            .collect();
        let much = self
            .arrivals
            .iter()
            .filter(|arrival| lately(arrival) && !arrival.small[level]);
        let mut much = much.filter_map(key);
        much.any(|large| little.iter().any(|other| *other != large))
    }

    /// The work that a worker does in the longest time of a batch, and in that of a client's part;
    /// the numbers may differ in how they are rounded.
    pub(super) fn work_caps(&self) -> Vec<[u64; 2]> {
        let is_recent = |arrival: &Arrival| self.now - arrival.at < Duration::from_secs(5);
        let batch = match self
            .arrivals
            .iter()
            .any(|arrival| !arrival.is_call && is_recent(arrival))
        {
            true => self.within(self.limits.max_batch_time),
            false => self.within(self.limits.calls_batch_time),
        };
        let client = self.within(self.limits.shared_batch_time);
        let pairs = batch
            .iter()
            .flat_map(|batch| client.iter().map(|client| [*batch, *client]));
        pairs.collect()
    }

    fn within(&self, time: Duration) -> Vec<u64> {
        if time.is_zero() {
            return vec![u64::MAX];
        }
        let (mut time_s, mut work, mut weight) = (0.0, 0.0, 1.0);
        for (took_s, of) in self.measured.iter().rev() {
            time_s += weight * took_s;
            work += weight * *of as f64;
            weight *= 0.9;
        }
        let cap = time.as_secs_f64() / (time_s / work).max(1e-9);
        let rounded = [cap * (1.0 - 1e-6), cap * (1.0 + 1e-6)];
        rounded.map(|cap| cap as u64).to_vec()
    }

    /// A worker is between two steps: the actions that the scheduler must give.
    pub(super) fn boundary(
        &mut self,
        worker: usize,
        took: Option<Duration>,
        [work_cap, client_cap]: [u64; 2],
    ) -> Vec<Action> {
        let room = self.room(worker).min(self.limits.max_batch);
        let others = self.at_hand().iter().filter(|&&other| other != worker).count();
        let even = self.ready_characters().div_ceil(others + 1);
        let mean = self
            .ready_work()
            .checked_div(self.ready_characters() as u64)
            .unwrap_or(1);
        let mut work_left = work_cap;
        let within = usize::try_from(work_cap / mean.max(1))
            .unwrap_or(usize::MAX)
            .max(1);
        let mut wanted = room.min(within).min(even);
        let rows = self.limits.call_rows;
        while rows > 0 && wanted > rows && !wanted.is_multiple_of(rows) {
            wanted -= 1;
        }
        let (mut actions, mut slices) = (Vec::new(), Vec::<RequestSlice>::new());
        let (mut expires, mut calls) = (false, 0);
        let share = self.limits.call_share;
        let credit = self.call_credit + wanted;
        let mut own = credit.checked_div(share).unwrap_or(0).min(wanted);
        let mut taken = 0;
        let of_groups = self.are_two(0, |arrival| Some(arrival.client.group));
        // Whose part it is, and its size.
        let parts: BTreeMap<ClientId, Option<(u64, u64)>> = (self.requests.values())
            .map(|known| known.order.client)
            .map(|client| {
                let of_group =
                    |arrival: &Arrival| (arrival.client.group == client.group).then_some(arrival.client.own);
                let part = match of_groups {
                    true => Some((client.group, client_cap.saturating_mul(client.share.into()))),
                    false => self.are_two(1, of_group).then_some((client.own, client_cap)),
                };
                (client, part)
            })
            .collect();
        let part = |client: ClientId| parts[&client];
        let mut by_client: BTreeMap<u64, u64> = BTreeMap::new();
        while wanted > 0
            && let ready = self.ready()
            && !ready.is_empty()
        {
            let left = |client: ClientId| match part(client) {
                Some((name, size)) => size.saturating_sub(by_client.get(&name).copied().unwrap_or_default()),
                None => u64::MAX,
            };
            let may_go = |request: RequestId| {
                let order = self.requests[&request].order;
                let has_expired = order.expires.is_some_and(|expires| expires <= self.now);
                slices.is_empty() || has_expired || u64::from(order.work) <= left(order.client)
            };
            let mut classes: Vec<Class> = Vec::new();
            for request in &ready {
                let class = self.requests[request].order.class;
                if !classes.contains(&class) {
                    classes.push(class);
                }
            }
            let of_calls = (own > 0)
                .then(|| self.first_of(Class::Request, &may_go))
                .flatten();
            if own > 0 && of_calls.is_none() {
                own = 0;
            }
            let next = of_calls.or_else(|| classes.iter().find_map(|class| self.first_of(*class, &may_go)));
            let Some((request, most)) = next else { break };
            let left = left(self.requests[&request].order.client);
            let place_since = self.requests[&request].place_since;
            // What came after the virtual deadline of another of its client does not go before.
            let same = |other: &&RequestId| self.names(**other) == self.names(request);
            for other in ready.iter().filter(same) {
                assert!(place_since <= self.requests[other].due, "{other:?} is starved");
            }
            let known = self.requests.get_mut(&request).unwrap();
            let waited = self.now - known.arrived;
            if known.order.expires.is_some_and(|expires| expires <= self.now) {
                known.fate = Fate::Expired;
                expires = true;
                actions.push(Action::Expire { request, waited });
                self.look_who_works();
                continue;
            }
            let cost = u64::from(known.order.work);
            let client = known.order.client;
            let within = usize::try_from(work_left.min(left) / cost).unwrap_or(usize::MAX);
            let within = within.max(usize::from(slices.is_empty()));
            let characters = known.left().min(if own > 0 { own } else { wanted }).min(most);
            let characters = characters.min(within);
            if characters == 0 && own > 0 {
                own = 0;
                continue;
            }
            if characters == 0 {
                break;
            }
            wanted -= characters;
            taken += characters;
            work_left = work_left.saturating_sub(cost * characters as u64);
            if let Some((name, _)) = part(client) {
                *by_client.entry(name).or_default() += cost * characters as u64;
            }
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
            self.charge(request, characters);
            self.look_who_works();
        }
        let credit = self.call_credit + taken;
        self.call_credit = credit.saturating_sub(calls * share).min(share);
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

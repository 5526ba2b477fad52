//! The queue: waiting requests in their order, and the plans of each owner.

use std::collections::{BTreeSet, HashMap};
use std::time::{Duration, Instant};

use troupe_base::turns::ClientId;

use super::event::{RequestId, RequestSlice};
use super::fair::Fair;
use crate::order::{Class, Order, OwnerId};

/// A request with waiting characters.
#[derive(Debug)]
pub(super) struct Waiting {
    order: Order,
    /// The virtual deadline; see the scheduler's documentation.
    due: Instant,
    arrived: Instant,
    /// Index of the first waiting character.
    next: usize,
    /// Number of waiting characters.
    left: usize,
}

impl Waiting {
    /// The number of waiting characters if the request is of that class, otherwise 0.
    pub(super) fn pending(&self, class: Class) -> usize {
        if self.order.class == class { self.left } else { 0 }
    }
}

/// The plans of one owner.
#[derive(Debug, Default)]
struct Owner {
    /// The plan that has at least partly gone to workers.
    active: Option<RequestId>,
    /// Characters of the active plan that are with workers now.
    running: usize,
    /// The waiting plan. It becomes ready once no plan is active.
    waiting: Option<RequestId>,
}

/// The clients of an address, or a key alone.
#[derive(Debug, Default)]
struct Group {
    members: Fair<u64, Member>,
    /// Waiting characters.
    pending: usize,
}

/// The requests of one client, in one class.
#[derive(Debug, Default)]
struct Member {
    /// Those that may start, by virtual deadline and arrival.
    ready: BTreeSet<(Instant, RequestId)>,
    /// Waiting characters.
    pending: usize,
}

/// The requests of a class.
#[derive(Debug, Default)]
struct Line {
    /// Those that may start, by virtual deadline and arrival.
    ready: BTreeSet<(Instant, RequestId)>,
    groups: Fair<u64, Group>,
    pending: usize,
}

impl Line {
    fn client(&mut self, client: ClientId) -> (&mut Group, u64) {
        (self.groups.held(client.group), client.own)
    }

    /// Adds waiting characters of a client.
    fn wait(&mut self, client: ClientId, characters: usize) {
        self.pending += characters;
        let (group, own) = self.client(client);
        group.pending += characters;
        group.members.held(own).pending += characters;
    }

    /// Characters of a client no longer wait.
    fn leave(&mut self, client: ClientId, characters: usize) {
        self.pending -= characters;
        let (group, own) = self.client(client);
        group.pending -= characters;
        group.members.held(own).pending -= characters;
    }

    fn make_ready(&mut self, client: ClientId, at: (Instant, RequestId)) {
        self.ready.insert(at);
        let (group, own) = self.client(client);
        group.members.held(own).ready.insert(at);
        group.members.set_working(own, true);
        self.groups.set_working(client.group, true);
    }

    /// Whether it was ready.
    fn remove(&mut self, client: ClientId, at: (Instant, RequestId)) -> bool {
        let was_ready = self.ready.remove(&at);
        let (group, own) = self.client(client);
        group.members.held(own).ready.remove(&at);
        was_ready
    }

    /// Requests of a client were removed, and others of it may have come.
    fn settle(&mut self, client: ClientId) {
        let (group, own) = self.client(client);
        if group.members.held(own).ready.is_empty() {
            group.members.set_working(own, false);
            group.members.clean(|member| member.pending == 0);
        }
        if group.members.working() == 0 {
            self.groups.set_working(client.group, false);
            self.groups.clean(|group| group.pending == 0);
        }
    }

    /// The next request, and how many characters of it may go before those of other clients.
    fn next(&self, cost: impl Fn(RequestId) -> u64) -> Option<(RequestId, usize)> {
        let (group, ahead_of_groups) = self.groups.first()?;
        let members = &self.groups.get(group)?.members;
        let (own, ahead_of_members) = members.first()?;
        let &(_, request) = members.get(own)?.ready.first()?;
        let cost = cost(request);
        let ahead = ahead_of_groups.into_iter().chain(ahead_of_members).min();
        let most = ahead.map_or(usize::MAX, |ahead| (ahead / cost) as usize + 1);
        Some((request, most))
    }

    fn charge(&mut self, client: ClientId, cost: u64) {
        let (group, own) = self.client(client);
        group.members.charge(own, cost);
        self.groups.charge(client.group, cost);
    }

    /// About how many waiting characters go before `characters` more of a client: of each other
    /// client at most as many as it has waiting itself.
    fn ahead(&self, client: ClientId, characters: usize) -> usize {
        let group = self.groups.get(client.group);
        let member = group.and_then(|group| group.members.get(client.own));
        let own = characters + member.map_or(0, |member| member.pending);
        let (members, pending) = group.map_or((0, 0), |group| (group.members.working(), group.pending));
        let of_group = own.saturating_mul(members.max(1)).min(pending + characters);
        of_group.saturating_mul(self.groups.working()).min(self.pending)
    }
}

/// Taken from the front of the queue.
#[derive(Debug)]
pub(super) enum Take {
    Slice(RequestSlice),
    Expired { request: RequestId, waited: Duration },
}

/// The waiting requests. Every operation takes at most logarithmic time in their number.
#[derive(Debug, Default)]
pub(super) struct Queue {
    requests: HashMap<RequestId, Waiting>,
    lines: [Line; Class::ALL.len()],
    ready_characters: usize,
    owners: HashMap<OwnerId, Owner>,
    /// Owners of the requests with characters on workers.
    running: HashMap<RequestId, OwnerId>,
}

impl Queue {
    /// Number of waiting requests.
    pub(super) fn len(&self) -> usize {
        self.requests.len()
    }

    /// Number of waiting characters of a class.
    pub(super) fn pending(&self, class: Class) -> usize {
        self.lines[class as usize].pending
    }

    /// About how many waiting characters go before a request of `characters` with that order.
    pub(super) fn ahead(&self, order: &Order, characters: usize) -> usize {
        self.lines[order.class as usize].ahead(order.client, characters)
    }

    /// Number of characters that may start.
    pub(super) fn ready(&self) -> usize {
        self.ready_characters
    }

    /// The waiting plan of an owner, which a newer one would replace.
    pub(super) fn waiting_of(&self, owner: OwnerId) -> Option<&Waiting> {
        let waiting = self.owners.get(&owner)?.waiting?;
        self.requests.get(&waiting)
    }

    /// The calls that must go so that `lacking` characters have room for a call of `characters`:
    /// of those who have most waiting, the least urgent that have not started. None if the call's
    /// own client would have as much waiting as they.
    pub(super) fn in_the_way(
        &self,
        order: &Order,
        characters: usize,
        lacking: usize,
    ) -> Option<Vec<RequestId>> {
        let line = &self.lines[order.class as usize];
        let (mut chosen, mut freed) = (Vec::new(), 0);
        let mut groups: HashMap<u64, usize> = line
            .groups
            .each()
            .map(|(key, group)| (key, group.pending))
            .collect();
        *groups.entry(order.client.group).or_default() += characters;
        let mut gone: HashMap<(u64, u64), usize> = HashMap::new();
        while freed < lacking {
            let (&heaviest, _) = groups
                .iter()
                .max_by_key(|&(&key, &pending)| (pending, key != order.client.group, key))?;
            let members = line.groups.get(heaviest)?.members.each();
            let member = members.map(|(own, member)| {
                let is_own = ClientId { group: heaviest, own } == order.client;
                let more = if is_own { characters } else { 0 };
                let less = gone.get(&(heaviest, own)).copied().unwrap_or_default();
                (member.pending + more - less, !is_own, own, member)
            });
            let (pending, is_other, own, member) =
                member.max_by_key(|&(pending, is_other, own, _)| (pending, is_other, own))?;
            let own_pending = self.pending_of(order) + characters;
            if heaviest == order.client.group && (!is_other || pending <= own_pending) {
                return None;
            }
            let unstarted = |&&(_, request): &&(Instant, RequestId)| {
                !chosen.contains(&request)
                    && self
                        .requests
                        .get(&request)
                        .is_some_and(|waiting| waiting.next == 0)
            };
            let &(_, request) = member.ready.iter().rev().find(unstarted)?;
            let left = self.requests.get(&request)?.left;
            chosen.push(request);
            freed += left;
            *gone.entry((heaviest, own)).or_default() += left;
            *groups.entry(heaviest).or_default() -= left;
        }
        Some(chosen)
    }

    /// Waiting characters of a client, in the class of an order.
    fn pending_of(&self, order: &Order) -> usize {
        let group = self.lines[order.class as usize].groups.get(order.client.group);
        let member = group.and_then(|group| group.members.get(order.client.own));
        member.map_or(0, |member| member.pending)
    }

    /// Adds a request, and returns the one that it replaces.
    pub(super) fn add(
        &mut self,
        now: Instant,
        request: RequestId,
        characters: usize,
        order: Order,
        mut due: Instant,
    ) -> Option<RequestId> {
        let older = order.owner.and_then(|owner| self.owners.get(&owner)?.waiting);
        let replaced = older.and_then(|older| self.remove(older));
        if let Some(older) = &replaced {
            due = due.min(older.due);
        }
        self.lines[order.class as usize].wait(order.client, characters);
        let waiting = Waiting {
            order,
            due,
            arrived: now,
            next: 0,
            left: characters,
        };
        self.requests.insert(request, waiting);
        let blocked = order.owner.is_some_and(|owner| {
            let owner = self.owners.entry(owner).or_default();
            owner.waiting = Some(request);
            owner.active.is_some()
        });
        if !blocked {
            self.make_ready(&order, due, request, characters);
        }
        if let Some(older) = replaced {
            self.settle(&older.order);
        }
        older
    }

    /// The class with the most urgent request.
    fn most_urgent(&self) -> Option<Class> {
        let first = |class: &Class| self.lines[*class as usize].ready.first();
        let classes = Class::ALL.into_iter().filter(|class| first(class).is_some());
        classes.min_by_key(|class| first(class))
    }

    /// Takes up to `room` characters, at least one, for the client whose turn it is in the class
    /// with the most urgent request: its own most urgent request. With `calls_only`, of a call.
    pub(super) fn take(&mut self, now: Instant, room: usize, calls_only: bool) -> Option<Take> {
        let class = match calls_only {
            true => Class::Request,
            false => self.most_urgent()?,
        };
        let line = &mut self.lines[class as usize];
        let requests = &self.requests;
        let cost = |request| requests.get(&request).map_or(1, |waiting| waiting.order.cost());
        let (request, most) = line.next(cost)?;
        let waiting = self.requests.get_mut(&request)?;
        let waited = now.saturating_duration_since(waiting.arrived);
        if waiting.order.expires.is_some_and(|expires| expires <= now) {
            self.forget(request);
            return Some(Take::Expired { request, waited });
        }
        let order = waiting.order;
        let Order { owner, client, .. } = order;
        let slice = RequestSlice {
            request,
            class,
            first: waiting.next,
            characters: waiting.left.min(room).min(most),
            waited,
        };
        waiting.next += slice.characters;
        waiting.left -= slice.characters;
        let (left, at) = (waiting.left, (waiting.due, request));
        self.ready_characters -= slice.characters;
        line.charge(client, order.cost() * slice.characters as u64);
        line.leave(client, slice.characters);
        if left == 0 {
            self.requests.remove(&request);
            line.remove(client, at);
            line.settle(client);
        }
        if let Some(id) = owner {
            let owner = self.owners.entry(id).or_default();
            if owner.waiting == Some(request) {
                owner.waiting = None;
            }
            owner.active = Some(request);
            owner.running += slice.characters;
            self.running.insert(request, id);
        }
        Some(Take::Slice(slice))
    }

    /// Removes the waiting rest of a request, and returns its number of characters.
    pub(super) fn forget(&mut self, request: RequestId) -> Option<usize> {
        let waiting = self.remove(request)?;
        if let Some(owner) = waiting.order.owner {
            if let Some(plans) = self.owners.get_mut(&owner)
                && plans.waiting == Some(request)
            {
                plans.waiting = None;
            }
            self.release(owner);
        }
        self.settle(&waiting.order);
        Some(waiting.left)
    }

    /// Records that `characters` of a request have left their worker.
    pub(super) fn finish(&mut self, request: RequestId, characters: usize) {
        let Some(&id) = self.running.get(&request) else {
            return;
        };
        if let Some(owner) = self.owners.get_mut(&id) {
            owner.running = owner.running.saturating_sub(characters);
            if owner.running == 0 {
                self.running.remove(&request);
            }
        }
        self.release(id);
    }

    /// Makes an owner's waiting plan ready if no character of its active plan waits or runs.
    fn release(&mut self, id: OwnerId) {
        let Some(owner) = self.owners.get_mut(&id) else {
            return;
        };
        let active = owner.active;
        if owner.running > 0 || active.is_some_and(|active| self.requests.contains_key(&active)) {
            return;
        }
        owner.active = None;
        let Some(next) = owner.waiting else {
            self.owners.remove(&id);
            return;
        };
        if active.is_some()
            && let Some(waiting) = self.requests.get(&next)
        {
            let (order, due, left) = (waiting.order, waiting.due, waiting.left);
            self.make_ready(&order, due, next, left);
        }
    }

    fn make_ready(&mut self, order: &Order, due: Instant, request: RequestId, characters: usize) {
        self.lines[order.class as usize].make_ready(order.client, (due, request));
        self.ready_characters += characters;
    }

    fn settle(&mut self, order: &Order) {
        self.lines[order.class as usize].settle(order.client);
    }

    /// Removes a request from all fields but `owners`. The caller settles its client afterwards.
    fn remove(&mut self, request: RequestId) -> Option<Waiting> {
        let waiting = self.requests.remove(&request)?;
        let line = &mut self.lines[waiting.order.class as usize];
        line.leave(waiting.order.client, waiting.left);
        if line.remove(waiting.order.client, (waiting.due, request)) {
            self.ready_characters -= waiting.left;
        }
        Some(waiting)
    }
}

//! The queue: waiting requests in their order, and the plans of each owner.

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::time::{Duration, Instant};

use troupe_base::turns::ClientId;

use super::event::{RequestId, RequestSlice};
use super::fair::Fair;
use crate::order::{Class, Order, OwnerId};

/// Factor on costs, so that dividing them by shares loses little.
const SHARE_UNIT: u64 = 1000;
/// Groups, and clients of a group, that are looked at for one with a part of the batch left. In a
/// batch of the longest time, fewer can use up their parts.
const MOST_PASSED: usize = 16;

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
    pub(super) fn class(&self) -> Class {
        self.order.class
    }

    /// Waiting characters and their work.
    pub(super) fn pending(&self) -> (usize, u64) {
        (self.left, self.order.cost() * self.left as u64)
    }
}

/// The plans of one owner.
#[derive(Debug, Default)]
struct Owner {
    /// The plan that has at least partly gone to workers.
    active: Option<RequestId>,
    /// The waiting plan. It becomes ready once no plan is active.
    waiting: Option<RequestId>,
}

/// The part of a request that is with workers.
#[derive(Debug)]
struct Running {
    order: Order,
    characters: usize,
}

/// The clients of an address, or a key alone.
#[derive(Debug, Default)]
struct Group {
    members: Fair<u64, Member>,
    /// Waiting work.
    work: u64,
    /// See [`ClientId::share`].
    share: u64,
}

/// The requests of one client, in one class.
#[derive(Debug, Default)]
struct Member {
    /// Those that may start, by virtual deadline and arrival.
    ready: BTreeSet<(Instant, RequestId)>,
    /// Waiting work.
    work: u64,
}

/// The requests of a class.
#[derive(Debug, Default)]
struct Line {
    /// Those that may start, by virtual deadline and arrival.
    ready: BTreeSet<(Instant, RequestId)>,
    groups: Fair<u64, Group>,
    /// Waiting characters.
    pending: usize,
    /// Waiting work.
    work: u64,
    /// Sum of the shares of groups that have something ready.
    shares: u64,
}

impl Line {
    fn client(&mut self, client: ClientId) -> (&mut Group, u64) {
        (self.groups.held(client.group), client.own)
    }

    /// Adds waiting characters of a client.
    fn wait(&mut self, order: &Order, characters: usize) {
        let work = order.cost() * characters as u64;
        self.pending += characters;
        self.work += work;
        let (group, own) = self.client(order.client);
        group.work += work;
        group.members.held(own).work += work;
    }

    /// Characters of a client no longer wait.
    fn leave(&mut self, order: &Order, characters: usize) {
        let work = order.cost() * characters as u64;
        self.pending -= characters;
        self.work -= work;
        let (group, own) = self.client(order.client);
        group.work -= work;
        group.members.held(own).work -= work;
    }

    fn make_ready(&mut self, client: ClientId, at: (Instant, RequestId)) {
        self.ready.insert(at);
        let (group, own) = self.client(client);
        group.members.held(own).ready.insert(at);
        group.members.set_working(own, true);
        group.share = client.share();
        if self.groups.set_working(client.group, true) {
            self.shares += client.share();
        }
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
            group.members.clean(|member| member.work == 0);
        }
        if group.members.working() == 0 {
            let share = group.share;
            if self.groups.set_working(client.group, false) {
                self.shares -= share;
            }
            self.groups.clean(|group| group.work == 0);
        }
    }

    /// The next request of a client that `may_go`, and how many of its characters may go before
    /// those of other clients.
    fn next(
        &self,
        order: impl Fn(RequestId) -> Option<Order>,
        may_go: impl Fn(&Order) -> bool,
    ) -> Option<(RequestId, usize)> {
        let groups = self.groups.in_order().take(MOST_PASSED);
        let members = groups.flat_map(|(group, ahead_of_groups)| {
            let members = self.groups.get(group).map(|group| &group.members);
            members.into_iter().flat_map(move |members| {
                let order = members.in_order().take(MOST_PASSED);
                order.map(move |(own, ahead)| (members.get(own), ahead_of_groups, ahead))
            })
        });
        for (member, ahead_of_groups, ahead_of_members) in members {
            let &(_, request) = member?.ready.first()?;
            let order = order(request)?;
            if !may_go(&order) {
                continue;
            }
            let of_groups = ahead_of_groups.map(|ahead| ahead / group_cost(&order, 1));
            let of_members = ahead_of_members.map(|ahead| ahead / order.cost());
            let most = of_groups.into_iter().chain(of_members).min();
            return Some((request, most.map_or(usize::MAX, |most| most as usize + 1)));
        }
        None
    }

    fn charge(&mut self, order: &Order, characters: usize) {
        let (group, own) = self.client(order.client);
        group.members.charge(own, order.cost() * characters as u64);
        self.groups
            .charge(order.client.group, group_cost(order, characters));
    }

    /// About how much waiting work goes before `characters` more of a client: of each other client
    /// at most as much as it has waiting itself, times its share.
    fn ahead(&self, order: &Order, characters: usize) -> u64 {
        let more = order.cost() * characters as u64;
        let group = self.groups.get(order.client.group);
        let member = group.and_then(|group| group.members.get(order.client.own));
        let own = more + member.map_or(0, |member| member.work);
        let (members, work) = group.map_or((0, 0), |group| (group.members.working() as u64, group.work));
        let of_group = own.saturating_mul(members.max(1)).min(work + more);
        let of_all = of_group.saturating_mul(self.shares) / order.client.share();
        of_all.min(self.work)
    }
}

/// Where the work of an order with workers is counted: for its client and for its group.
fn running_keys(order: &Order) -> [(Class, Option<u64>, u64); 2] {
    let ClientId { group, own, .. } = order.client;
    [(order.class, Some(own), group), (order.class, None, group)]
}

/// Virtual time of a group for characters of a request.
fn group_cost(order: &Order, characters: usize) -> u64 {
    let cost = (order.cost() * SHARE_UNIT / order.client.share()).max(1);
    cost.saturating_mul(characters as u64)
}

/// How much may be taken at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) characters: usize,
    /// Most work of these characters, in [`Order::work`]'s unit.
    pub(super) work: u64,
    /// Whether one character is taken even if it is more work than that.
    pub(super) at_least_one: bool,
}

/// Taken from the front of the queue.
#[derive(Debug)]
pub(super) enum Take {
    Slice {
        slice: RequestSlice,
        client: ClientId,
        /// Of its characters.
        work: u64,
    },
    Expired {
        request: RequestId,
        waited: Duration,
    },
}

/// The waiting requests. Operations take at most logarithmic time in their number, but for
/// [`Queue::in_the_way`], which looks at each client.
#[derive(Debug, Default)]
pub(super) struct Queue {
    requests: HashMap<RequestId, Waiting>,
    lines: [Line; Class::ALL.len()],
    ready_characters: usize,
    ready_work: u64,
    owners: HashMap<OwnerId, Owner>,
    /// The requests with characters on workers.
    running: HashMap<RequestId, Running>,
    /// Work of these characters, by class and client, and by class and group.
    running_work: HashMap<(Class, Option<u64>, u64), u64>,
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

    /// About how much waiting work goes before a request of `characters` with that order, if it
    /// replaces waiting work of so much.
    pub(super) fn ahead(&self, order: &Order, characters: usize, replaced: u64) -> u64 {
        let line = &self.lines[order.class as usize];
        line.ahead(order, characters).min(line.work - replaced)
    }

    /// Number of characters that may start.
    pub(super) fn ready(&self) -> usize {
        self.ready_characters
    }

    /// How many characters of the mean work of those that may start are at most so much work.
    pub(super) fn characters_within(&self, work: u64) -> usize {
        let mean = self
            .ready_work
            .checked_div(self.ready_characters as u64)
            .unwrap_or(1);
        usize::try_from(work / mean.max(1)).unwrap_or(usize::MAX)
    }

    /// The waiting plan of an owner, which a newer one would replace.
    pub(super) fn waiting_of(&self, owner: OwnerId) -> Option<&Waiting> {
        let waiting = self.owners.get(&owner)?.waiting?;
        self.requests.get(&waiting)
    }

    /// The calls that must go so that `lacking` characters have room for a call of `characters`:
    /// of those who have most work waiting, the least urgent, if possible ones that have not
    /// started. None if the call's own client would have as much waiting as they.
    pub(super) fn in_the_way(
        &self,
        order: &Order,
        characters: usize,
        lacking: usize,
    ) -> Option<Vec<RequestId>> {
        let line = &self.lines[order.class as usize];
        let own = order.client;
        let asked = order.cost() * characters as u64;
        let own_work = self.work_of(order) + asked;
        let mut groups: HashMap<u64, (u64, u64)> = line
            .groups
            .each()
            .map(|(key, group)| (key, (group.work, group.share.max(1))))
            .collect();
        groups.entry(own.group).or_insert((0, own.share())).0 += asked;
        let mut gone: HashMap<(u64, u64), u64> = HashMap::new();
        let (mut chosen, mut freed) = (Vec::new(), 0);
        while freed < lacking {
            let load = |&(work, share): &(u64, u64)| work.saturating_mul(SHARE_UNIT) / share;
            let (&heaviest, _) = groups
                .iter()
                .max_by_key(|&(&key, group)| (load(group), key == own.group, key))?;
            let members = line
                .groups
                .get(heaviest)?
                .members
                .each()
                .map(|(member, of_member)| {
                    let is_own = (heaviest, member) == (own.group, own.own);
                    let more = if is_own { asked } else { 0 };
                    let less = gone.get(&(heaviest, member)).copied().unwrap_or_default();
                    (of_member.work + more - less, !is_own, member)
                });
            let (work, is_other, member) = members.max()?;
            if heaviest == own.group && (!is_other || work <= own_work) {
                return None;
            }
            let request = self.last_of(line.groups.get(heaviest)?.members.get(member)?, &chosen)?;
            let (left, work) = self.requests.get(&request)?.pending();
            chosen.push(request);
            freed += left;
            *gone.entry((heaviest, member)).or_default() += work;
            groups.entry(heaviest).or_default().0 -= work;
        }
        Some(chosen)
    }

    /// The least urgent request but for those in `without`: one of which nothing has started, if
    /// there is one.
    fn last_of(&self, member: &Member, without: &[RequestId]) -> Option<RequestId> {
        let started = |request: &RequestId| self.requests.get(request).is_none_or(|waiting| waiting.next > 0);
        let requests = member.ready.iter().rev().map(|&(_, request)| request);
        let mut others = requests.filter(|request| !without.contains(request));
        let unstarted = others.clone().find(|request| !started(request));
        unstarted.or_else(|| others.next())
    }

    /// Work that waits or is with workers, in the class of an order: of its group, and of its
    /// client.
    pub(super) fn open_work_of(&self, order: &Order) -> [u64; 2] {
        let group = self.lines[order.class as usize].groups.get(order.client.group);
        let waiting = [self.work_of(order), group.map_or(0, |group| group.work)];
        let [of_client, of_group] = running_keys(order).map(|key| self.running_work.get(&key));
        [
            waiting[1] + of_group.copied().unwrap_or_default(),
            waiting[0] + of_client.copied().unwrap_or_default(),
        ]
    }

    /// Waiting work of a client, in the class of an order.
    fn work_of(&self, order: &Order) -> u64 {
        let group = self.lines[order.class as usize].groups.get(order.client.group);
        let member = group.and_then(|group| group.members.get(order.client.own));
        member.map_or(0, |member| member.work)
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
        self.lines[order.class as usize].wait(&order, characters);
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

    /// The request that goes next, and how many characters of it: of the class with the most urgent
    /// request, and there of the client whose turn it is. Clients that may not go are passed over.
    fn next(&self, calls_only: bool, may_go: impl Fn(&Order) -> bool) -> Option<(RequestId, usize)> {
        let order = |request| Some(self.requests.get(&request)?.order);
        let of_class = |class: Class| self.lines[class as usize].next(order, &may_go);
        if calls_only {
            return of_class(Class::Request);
        }
        let mut classes = Class::ALL.map(|class| (self.lines[class as usize].ready.first(), class));
        classes.sort_unstable();
        classes
            .into_iter()
            .find_map(|(first, class)| first.and_then(|_| of_class(class)))
    }

    /// Takes characters for the client whose turn it is, of its own most urgent request. With
    /// `calls_only`, of a call. `allowed` is the most work that a client may have now. Clients that
    /// may have none are passed over, except at the beginning of a batch.
    pub(super) fn take(
        &mut self,
        now: Instant,
        room: Room,
        calls_only: bool,
        allowed: impl Fn(ClientId) -> u64,
    ) -> Option<Take> {
        let has_expired = |order: &Order| order.expires.is_some_and(|expires| expires <= now);
        let may_go =
            |order: &Order| room.at_least_one || has_expired(order) || order.cost() <= allowed(order.client);
        let (request, most) = self.next(calls_only, may_go)?;
        let waiting = self.requests.get_mut(&request)?;
        let class = waiting.order.class;
        let line = &mut self.lines[class as usize];
        let waited = now.saturating_duration_since(waiting.arrived);
        if has_expired(&waiting.order) {
            self.forget(request);
            return Some(Take::Expired { request, waited });
        }
        let order = waiting.order;
        let work = room.work.min(allowed(order.client));
        let within = usize::try_from(work / order.cost()).unwrap_or(usize::MAX);
        let within = within.max(usize::from(room.at_least_one));
        let characters = waiting.left.min(room.characters).min(most).min(within);
        if characters == 0 {
            return None;
        }
        let slice = RequestSlice {
            request,
            class,
            first: waiting.next,
            characters,
            waited,
        };
        waiting.next += characters;
        waiting.left -= characters;
        let (left, at) = (waiting.left, (waiting.due, request));
        let work = order.cost() * characters as u64;
        self.ready_characters -= characters;
        self.ready_work -= work;
        line.charge(&order, characters);
        line.leave(&order, characters);
        if left == 0 {
            self.requests.remove(&request);
            line.remove(order.client, at);
            line.settle(order.client);
        }
        if let Some(id) = order.owner {
            let owner = self.owners.entry(id).or_default();
            if owner.waiting == Some(request) {
                owner.waiting = None;
            }
            owner.active = Some(request);
        }
        let running = self
            .running
            .entry(request)
            .or_insert(Running { order, characters: 0 });
        running.characters += characters;
        for key in running_keys(&order) {
            *self.running_work.entry(key).or_default() += work;
        }
        Some(Take::Slice {
            slice,
            client: order.client,
            work,
        })
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

    /// Records that `characters` of a request have left their worker, and returns their work.
    pub(super) fn finish(&mut self, request: RequestId, characters: usize) -> u64 {
        let Some(running) = self.running.get_mut(&request) else {
            return 0;
        };
        let characters = characters.min(running.characters);
        running.characters -= characters;
        let order = running.order;
        let work = order.cost() * characters as u64;
        let owner = order.owner;
        if running.characters == 0 {
            self.running.remove(&request);
        }
        for key in running_keys(&order) {
            if let Entry::Occupied(mut running) = self.running_work.entry(key) {
                *running.get_mut() -= work;
                if *running.get() == 0 {
                    running.remove();
                }
            }
        }
        if let Some(owner) = owner {
            self.release(owner);
        }
        work
    }

    /// Makes an owner's waiting plan ready if no character of its active plan waits or runs.
    fn release(&mut self, id: OwnerId) {
        let Some(owner) = self.owners.get_mut(&id) else {
            return;
        };
        let active = owner.active;
        let is_open =
            |active: RequestId| self.running.contains_key(&active) || self.requests.contains_key(&active);
        if active.is_some_and(is_open) {
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
        self.ready_work += order.cost() * characters as u64;
    }

    fn settle(&mut self, order: &Order) {
        self.lines[order.class as usize].settle(order.client);
    }

    /// Removes a request from all fields but `owners`. The caller settles its client afterwards.
    fn remove(&mut self, request: RequestId) -> Option<Waiting> {
        let waiting = self.requests.remove(&request)?;
        let line = &mut self.lines[waiting.order.class as usize];
        line.leave(&waiting.order, waiting.left);
        if line.remove(waiting.order.client, (waiting.due, request)) {
            let (characters, work) = waiting.pending();
            self.ready_characters -= characters;
            self.ready_work -= work;
        }
        Some(waiting)
    }
}

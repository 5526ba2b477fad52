//! The queue: waiting requests in their order, and the plans of each owner.

use std::collections::{BTreeSet, HashMap};
use std::time::{Duration, Instant};

use super::event::{RequestId, RequestSlice};
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
    /// Requests that may start, by virtual deadline and arrival.
    ready: BTreeSet<(Instant, RequestId)>,
    /// The calls among them.
    ready_calls: BTreeSet<(Instant, RequestId)>,
    ready_characters: usize,
    pending: [usize; Class::ALL.len()],
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
        self.pending[class as usize]
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
        if let Some(older) = older.and_then(|older| self.remove(older)) {
            due = due.min(older.due);
        }
        self.pending[order.class as usize] += characters;
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
            self.make_ready(order.class, due, request, characters);
        }
        older
    }

    /// Takes up to `room` characters, at least one, of the most urgent request. With `calls_only`,
    /// of the most urgent call.
    pub(super) fn take(&mut self, now: Instant, room: usize, calls_only: bool) -> Option<Take> {
        let &(due, request) = match calls_only {
            true => self.ready_calls.first()?,
            false => self.ready.first()?,
        };
        let waiting = self.requests.get_mut(&request)?;
        let waited = now.saturating_duration_since(waiting.arrived);
        if waiting.order.expires.is_some_and(|expires| expires <= now) {
            self.forget(request);
            return Some(Take::Expired { request, waited });
        }
        let Order { class, owner, .. } = waiting.order;
        let slice = RequestSlice {
            request,
            class,
            first: waiting.next,
            characters: waiting.left.min(room),
            waited,
        };
        waiting.next += slice.characters;
        waiting.left -= slice.characters;
        self.pending[class as usize] -= slice.characters;
        self.ready_characters -= slice.characters;
        if waiting.left == 0 {
            self.requests.remove(&request);
            self.ready.remove(&(due, request));
            self.ready_calls.remove(&(due, request));
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
            self.make_ready(waiting.order.class, waiting.due, next, waiting.left);
        }
    }

    fn make_ready(&mut self, class: Class, due: Instant, request: RequestId, characters: usize) {
        self.ready.insert((due, request));
        if class == Class::Request {
            self.ready_calls.insert((due, request));
        }
        self.ready_characters += characters;
    }

    /// Removes a request from all fields but `owners`.
    fn remove(&mut self, request: RequestId) -> Option<Waiting> {
        let waiting = self.requests.remove(&request)?;
        self.pending[waiting.order.class as usize] -= waiting.left;
        self.ready_calls.remove(&(waiting.due, request));
        if self.ready.remove(&(waiting.due, request)) {
            self.ready_characters -= waiting.left;
        }
        Some(waiting)
    }
}

//! Notes whether some clients call for little while others ask for much. Then each may have only a
//! part of a batch, so that those with little wait for a short time. If all ask for much, they wait
//! for each other anyway, and whole batches serve them faster.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use troupe_base::turns::ClientId;

use crate::order::{Class, Order};

/// For how long it counts that a client asked for much, or called for little.
const MEMORY: Duration = Duration::from_secs(3);
/// Entries from which those that no longer count are forgotten.
const MANY: usize = 64;

/// Whether a request is small, as the open work of its group and its client says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Small {
    /// The group has little open work of the class.
    pub(super) of_group: bool,
    /// The client has little open work of the class.
    pub(super) of_client: bool,
}

/// The latest requests of groups, and of the clients of each group.
#[derive(Debug, Default)]
pub(super) struct Callers {
    groups: Sides,
    clients: HashMap<u64, Sides>,
}

impl Callers {
    /// A request came.
    pub(super) fn note(&mut self, now: Instant, order: &Order, small: Small) {
        let (ClientId { group, own, .. }, is_call) = (order.client, order.class == Class::Request);
        self.groups.note(now, group, is_call, small.of_group);
        if !self.clients.contains_key(&group) && self.clients.len() >= MANY {
            self.clients.retain(|_, sides| sides.counts(now));
        }
        let clients = self.clients.entry(group).or_default();
        clients.note(now, own, is_call, small.of_client);
    }

    /// The parts of the next batch, of at most so much work each.
    pub(super) fn shares(&self, now: Instant, work: u64) -> Shares<'_> {
        Shares {
            now,
            work,
            of_groups: self.groups.are_two(now),
            clients: &self.clients,
            taken: Vec::new(),
        }
    }
}

/// Those who asked for much lately, and those who called for little.
#[derive(Debug, Default)]
struct Sides {
    /// When each made its latest large call.
    large_calls: HashMap<u64, Instant>,
    /// The latest two who asked for much, also by plans.
    much: Latest,
    /// The latest two who called for little, and made no large call lately.
    little: Latest,
}

/// Two keys and when they were noted last, the newer first.
type Latest = [Option<(u64, Instant)>; 2];

fn counts(noted: Instant, now: Instant) -> bool {
    now.saturating_duration_since(noted) < MEMORY
}

impl Sides {
    fn note(&mut self, now: Instant, key: u64, is_call: bool, is_small: bool) {
        let last_large = self.large_calls.get(&key).copied();
        if !is_small {
            put(&mut self.much, key, now);
            if is_call {
                if last_large.is_none() && self.large_calls.len() >= MANY {
                    self.large_calls.retain(|_, noted| counts(*noted, now));
                }
                self.large_calls.insert(key, now);
            }
        } else if is_call && !last_large.is_some_and(|noted| counts(noted, now)) {
            put(&mut self.little, key, now);
        }
    }

    /// Whether one asked for much and another called for little.
    fn are_two(&self, now: Instant) -> bool {
        let lately = |(_, noted): &&(u64, Instant)| counts(*noted, now);
        let mut much = self.much.iter().flatten().filter(lately);
        let little = || self.little.iter().flatten().filter(lately);
        much.any(|(one, _)| little().any(|(other, _)| one != other))
    }

    /// Whether anything here still counts.
    fn counts(&self, now: Instant) -> bool {
        let newest = |[newest, _]: &Latest| newest.is_some_and(|(_, noted)| counts(noted, now));
        newest(&self.much) || newest(&self.little)
    }
}

fn put(latest: &mut Latest, key: u64, now: Instant) {
    let [first, second] = *latest;
    *latest = match first {
        Some((known, _)) if known != key => [Some((key, now)), first],
        _ => [Some((key, now)), second],
    };
}

/// What clients or groups have of a batch.
#[derive(Debug)]
pub(super) struct Shares<'a> {
    now: Instant,
    work: u64,
    /// Whether each group has a part. Otherwise each client has one whose own group has clients
    /// with little and with much, and others have as much as they like: what happens within a
    /// group is no reason for other groups to have less.
    of_groups: bool,
    clients: &'a HashMap<u64, Sides>,
    taken: Vec<(u64, u64)>,
}

impl Shares<'_> {
    /// Whose part a client's characters are of, and how much work it is in all; none without a
    /// limit.
    fn part(&self, client: ClientId) -> Option<(u64, u64)> {
        if self.of_groups {
            return Some((client.group, self.work.saturating_mul(client.share())));
        }
        let of_group = self.clients.get(&client.group)?;
        of_group.are_two(self.now).then_some((client.own, self.work))
    }

    /// The work that a client may still have.
    pub(super) fn left(&self, client: ClientId) -> u64 {
        let Some((key, work)) = self.part(client) else {
            return u64::MAX;
        };
        let taken = self.taken.iter().find(|(of, _)| *of == key);
        work.saturating_sub(taken.map_or(0, |(_, taken)| *taken))
    }

    pub(super) fn take(&mut self, client: ClientId, work: u64) {
        let Some((key, _)) = self.part(client) else {
            return;
        };
        match self.taken.iter_mut().find(|(of, _)| *of == key) {
            Some((_, taken)) => *taken += work,
            None => self.taken.push((key, work)),
        }
    }
}

//! Notes whether some clients call for little while others ask for much. Then each may have only a
//! part of a batch, so that those with little wait for a short time. If all ask for much, they wait
//! for each other anyway, and whole batches serve them faster.

use std::time::{Duration, Instant};

use troupe_base::turns::ClientId;

use crate::order::{Class, Order};

/// Weight of the latest call in the measured shares.
const WEIGHT: f32 = 1.0 / 32.0;
/// Share of small calls above which they count. A client that sends its next large call after each
/// answer has little open work for a moment, so single small calls say nothing.
const MIN_SHARE: f32 = 1.0 / 16.0;
/// Without a call for so long, none is expected.
const MEMORY: Duration = Duration::from_secs(3);

/// The clients of the latest calls.
#[derive(Debug, Default)]
pub(super) struct Callers {
    /// The client of the latest request that was not small.
    large: Option<ClientId>,
    /// Share of small calls of other clients in the group of `large` among the latest calls.
    of_clients: f32,
    /// Share of small calls of other groups.
    of_groups: f32,
    /// When the latest call came.
    called: Option<Instant>,
}

impl Callers {
    /// A request came. It is small if its client has little open work of its class, or only this
    /// one character.
    pub(super) fn came(&mut self, now: Instant, order: &Order, is_small: bool) {
        let client = order.client;
        if !is_small {
            self.large = Some(client);
        }
        if order.class != Class::Request {
            return;
        }
        self.called = Some(now);
        let is_beside = |beside: fn(&ClientId, &ClientId) -> bool| {
            let is_beside = self.large.is_some_and(|large| beside(&large, &client));
            f32::from(u8::from(is_small && is_beside))
        };
        let other = is_beside(|a, b| a.group == b.group && a.own != b.own);
        let other_group = is_beside(|a, b| a.group != b.group);
        self.of_clients += (other - self.of_clients) * WEIGHT;
        self.of_groups += (other_group - self.of_groups) * WEIGHT;
    }

    /// The parts of the next batch, of at most so much work each.
    pub(super) fn shares(&self, now: Instant, work: u64) -> Shares {
        let lately = |called| now.saturating_duration_since(called) < MEMORY;
        let among = match self.large {
            _ if !self.called.is_some_and(lately) => None,
            _ if self.of_groups > MIN_SHARE => Some(Among::Groups),
            Some(large) if self.of_clients > MIN_SHARE => Some(Among::ClientsOf(large.group)),
            _ => None,
        };
        Shares {
            work,
            among,
            taken: Vec::new(),
        }
    }
}

/// Among whom a batch is shared.
#[derive(Debug, Clone, Copy)]
enum Among {
    Groups,
    /// The clients of this group. Other groups have as much as they like: what happens within a
    /// group is no reason for them to have less.
    ClientsOf(u64),
}

/// What clients or groups have of a batch.
#[derive(Debug)]
pub(super) struct Shares {
    work: u64,
    /// None: all have as much as they like.
    among: Option<Among>,
    taken: Vec<(u64, u64)>,
}

impl Shares {
    /// Whose part a client's characters are of, and how much work it is in all; none without a
    /// limit.
    fn part(&self, client: ClientId) -> Option<(u64, u64)> {
        match self.among? {
            Among::Groups => Some((client.group, self.work.saturating_mul(client.share()))),
            Among::ClientsOf(group) => (client.group == group).then_some((client.own, self.work)),
        }
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

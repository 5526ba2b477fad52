//! Notes whether some clients call for little while others ask for much. Then each may have only a
//! part of a batch, so that those with little wait for a short time. If all ask for much, they wait
//! for each other anyway, and whole batches serve them faster.

use std::time::{Duration, Instant};

use troupe_base::turns::ClientId;

use crate::order::{Class, Order};

/// Weight of the latest call in the measured shares.
const WEIGHT: f32 = 1.0 / 32.0;
/// Share of small calls above which they count. A client that sends its next large call after each
/// answer has little waiting for a moment, so single small calls say nothing.
const MIN_SHARE: f32 = 1.0 / 16.0;
/// Without a call for so long, none is expected.
const MEMORY: Duration = Duration::from_secs(3);

/// The clients of the latest calls.
#[derive(Debug, Default)]
pub(super) struct Callers {
    /// The client of the latest request that was not small.
    large: Option<ClientId>,
    /// Share of small calls of other clients among the latest calls.
    of_clients: f32,
    /// The same for other groups.
    of_groups: f32,
    /// When the latest call came.
    called: Option<Instant>,
}

impl Callers {
    /// A request came. It is small if its client has little of its class waiting.
    pub(super) fn came(&mut self, now: Instant, order: &Order, is_small: bool) {
        let client = order.client;
        if !is_small {
            self.large = Some(client);
        }
        if order.class != Class::Request {
            return;
        }
        self.called = Some(now);
        let differs = |differ: fn(&ClientId, &ClientId) -> bool| {
            let differs = self.large.is_some_and(|large| differ(&large, &client));
            f32::from(u8::from(is_small && differs))
        };
        let (other, other_group) = (differs(|a, b| a != b), differs(|a, b| a.group != b.group));
        self.of_clients += (other - self.of_clients) * WEIGHT;
        self.of_groups += (other_group - self.of_groups) * WEIGHT;
    }

    /// The parts of the next batch, of at most so much work each.
    pub(super) fn shares(&self, now: Instant, work: u64) -> Shares {
        let lately = |called| now.saturating_duration_since(called) < MEMORY;
        let is_shared = self.of_clients > MIN_SHARE && self.called.is_some_and(lately);
        Shares {
            work: if is_shared { work } else { u64::MAX },
            of_groups: self.of_groups > MIN_SHARE,
            taken: Vec::new(),
        }
    }
}

/// What clients, or groups if several call, have of a batch.
#[derive(Debug)]
pub(super) struct Shares {
    work: u64,
    of_groups: bool,
    taken: Vec<(u64, u64)>,
}

impl Shares {
    fn key(&self, client: ClientId) -> u64 {
        match self.of_groups {
            true => client.group,
            false => client.own,
        }
    }

    /// The work that a client may still have.
    pub(super) fn left(&self, client: ClientId) -> u64 {
        let key = self.key(client);
        let taken = self.taken.iter().find(|(of, _)| *of == key);
        self.work - taken.map_or(0, |(_, taken)| (*taken).min(self.work))
    }

    pub(super) fn take(&mut self, client: ClientId, work: u64) {
        if self.work == u64::MAX {
            return;
        }
        let key = self.key(client);
        match self.taken.iter_mut().find(|(of, _)| *of == key) {
            Some((_, taken)) => *taken += work,
            None => self.taken.push((key, work)),
        }
    }
}

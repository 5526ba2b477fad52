//! Debts: what clients owe after a queue had no room for their calls.
//!
//! A refused call has a hint when to come again. If the client comes earlier, the server looks at
//! the queue when the call has only begun (`port/early.rs`). This costs a fraction of a call that
//! is read, decoded and then refused.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use http::HeaderValue;
use sha2::{Digest as _, Sha256};
use troupe_base::turns::ClientId;

/// Most debts of an address. A new one replaces the one that ends first.
const MOST_DEBTS: usize = 16;

/// The newest refusal of calls of a client, for one queue.
#[derive(Debug)]
struct Debt {
    /// Name of the queue that had no room.
    queue: Box<str>,
    debtor: Debtor,
    /// When the call may come again.
    until: Instant,
}

/// Who owes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Debtor {
    /// All callers of the address: the server has no keys.
    Address,
    /// Callers whose header has the key of a client.
    Key(KeyHash, ClientId),
}

/// SHA-256 of a header with a key. Keys themselves are neither kept nor compared.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct KeyHash([u8; 32]);

impl KeyHash {
    pub(super) fn of(header: &HeaderValue) -> Self {
        Self(Sha256::digest(header.as_bytes()).into())
    }
}

/// The debts of an address.
#[derive(Debug, Default)]
pub(crate) struct Debts {
    /// Whether there may be a debt. Most addresses never have one.
    any: AtomicBool,
    known: Mutex<Vec<Debt>>,
}

impl Debts {
    fn known(&self) -> MutexGuard<'_, Vec<Debt>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn add(&self, debtor: Debtor, queue: &str, until: Instant) {
        let mut known = self.known();
        let mut same = known.iter_mut();
        let same = same.find(|debt| &*debt.queue == queue && debt.debtor == debtor);
        if let Some(debt) = same {
            debt.until = until;
            return;
        }
        if known.len() >= MOST_DEBTS {
            let first = (0..known.len()).min_by_key(|&place| known[place].until);
            first.map(|place| known.swap_remove(place));
        }
        known.push(Debt {
            queue: queue.into(),
            debtor,
            until,
        });
        self.any.store(true, Ordering::Release);
    }

    /// Whether there is no debt, even if a debt that has ended counts as one.
    pub(crate) fn is_empty(&self) -> bool {
        !self.any.load(Ordering::Acquire)
    }

    /// Who owes something at `now` to this queue, or to any if none is given, if a caller with that
    /// header does. `connected` is the client of the caller's connection.
    pub(super) fn of(
        &self,
        authorization: Option<&HeaderValue>,
        connected: ClientId,
        queue: Option<&str>,
        now: Instant,
    ) -> Option<ClientId> {
        let mut known = self.known();
        known.retain(|debt| debt.until > now);
        if known.is_empty() {
            self.any.store(false, Ordering::Release);
        }
        let fits = |debt: &&Debt| queue.is_none_or(|queue| *debt.queue == *queue);
        known.iter().filter(fits).find_map(|debt| match &debt.debtor {
            Debtor::Address => Some(connected),
            Debtor::Key(hash, client) => {
                let is_same = authorization.is_some_and(|header| KeyHash::of(header) == *hash);
                is_same.then_some(*client)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn client(own: u64) -> ClientId {
        ClientId {
            group: own,
            own,
            share: 1,
        }
    }

    #[test]
    fn a_debt_is_that_of_its_key_and_queue_and_ends() {
        let debts = Debts::default();
        let (key, other) = (
            HeaderValue::from_static("Bearer a"),
            HeaderValue::from_static("Bearer b"),
        );
        let now = Instant::now();
        let of = |header, queue, now| debts.of(header, client(1), Some(queue), now);
        assert_eq!(of(Some(&key), "human", now), None);
        let until = now + Duration::from_secs(5);
        debts.add(Debtor::Key(KeyHash::of(&key), client(3)), "human", until);
        assert_eq!(of(Some(&key), "human", now), Some(client(3)));
        assert_eq!(of(Some(&other), "human", now), None);
        assert_eq!(of(None, "human", now), None);
        assert_eq!(of(Some(&key), "g1", now), None);
        assert_eq!(debts.of(Some(&key), client(1), None, now), Some(client(3)));
        assert!(!debts.is_empty());
        assert_eq!(of(Some(&key), "human", until), None);
        assert!(debts.is_empty());
    }

    #[test]
    fn without_keys_all_callers_of_an_address_owe_whatever_their_headers_say() {
        let debts = Debts::default();
        let now = Instant::now();
        debts.add(Debtor::Address, "human", now + Duration::from_secs(5));
        let made_up = HeaderValue::from_static("Bearer made-up");
        for header in [None, Some(&made_up)] {
            assert_eq!(debts.of(header, client(7), Some("human"), now), Some(client(7)));
        }
    }

    #[test]
    fn the_newest_debts_are_kept() {
        let debts = Debts::default();
        let now = Instant::now();
        for queue in 0..40u64 {
            let until = now + Duration::from_secs(1 + queue);
            debts.add(Debtor::Address, &queue.to_string(), until);
        }
        let kept: Vec<u64> = (0..40)
            .filter(|queue| debts.of(None, client(1), Some(&queue.to_string()), now).is_some())
            .collect();
        assert_eq!(kept, Vec::from_iter(24..40));
    }
}

//! Debts: what clients owe after a queue had no room for their calls.
//!
//! A refused call has a hint when to come again. If the client comes earlier, the server looks at
//! its queues before it reads the call (`port/early.rs`). This costs a fraction of a call that is
//! read, decoded and then refused.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use http::HeaderValue;
use troupe_base::turns::ClientId;

/// The newest refusal of a client's call.
#[derive(Debug, Clone)]
pub struct Debt {
    /// Name of the queue that had no room.
    pub queue: Arc<str>,
    /// The client, as the queue knows it.
    pub client: ClientId,
    /// The header with the client's key. Callers with another one owe nothing.
    authorization: Option<HeaderValue>,
    /// When the call may come again.
    until: Instant,
}

/// The newest debt on a connection.
#[derive(Debug, Default)]
pub(crate) struct Debts {
    /// Whether there may be a debt. Most connections never have one.
    any: AtomicBool,
    newest: Mutex<Option<Debt>>,
}

impl Debts {
    fn newest(&self) -> MutexGuard<'_, Option<Debt>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn add(
        &self,
        client: ClientId,
        authorization: Option<&HeaderValue>,
        queue: &str,
        wait: Duration,
    ) {
        let until = Instant::now() + wait;
        let mut newest = self.newest();
        match &mut *newest {
            Some(debt)
                if &*debt.queue == queue
                    && debt.client == client
                    && debt.authorization.as_ref() == authorization =>
            {
                debt.until = until;
            }
            _ => {
                *newest = Some(Debt {
                    queue: queue.into(),
                    client,
                    authorization: authorization.cloned(),
                    until,
                });
            }
        }
        self.any.store(true, Ordering::Release);
    }

    /// Whether there is no debt, even if a debt that has ended counts as one.
    pub(crate) fn is_empty(&self) -> bool {
        !self.any.load(Ordering::Acquire)
    }

    /// The debt of a caller with this header at `now`.
    pub(crate) fn of(&self, authorization: Option<&HeaderValue>, now: Instant) -> Option<Debt> {
        let mut newest = self.newest();
        if newest.as_ref().is_some_and(|debt| debt.until <= now) {
            *newest = None;
            self.any.store(false, Ordering::Release);
            return None;
        }
        let debt = newest.as_ref()?;
        (debt.authorization.as_ref() == authorization).then(|| debt.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_debt_is_that_of_its_client_and_ends() {
        let debts = Debts::default();
        let (key, other) = (
            HeaderValue::from_static("Bearer a"),
            HeaderValue::from_static("Bearer b"),
        );
        let now = Instant::now();
        assert!(debts.of(Some(&key), now).is_none());
        let client = ClientId {
            group: 3,
            own: 3,
            share: 1,
        };
        debts.add(client, Some(&key), "human", Duration::from_secs(5));
        let debt = debts.of(Some(&key), now).unwrap();
        assert_eq!((&*debt.queue, debt.client), ("human", client));
        assert!(debts.of(Some(&other), now).is_none() && debts.of(None, now).is_none());
        let later = now + Duration::from_secs(6);
        assert!(debts.of(Some(&key), later).is_none());
    }
}

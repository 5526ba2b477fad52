//! Sessions that a client asked for and that are not on this server.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::SessionError;
use troupe_base::tenant::Tenant;

/// Maximum number of remembered ids. They take a few megabytes.
const MAX_AWAY: usize = 65_536;
/// Time in which the store is not asked again for a session. Its owner may give it up at any time.
const ASK_AGAIN: Duration = Duration::from_millis(250);
/// Time for which a failed look for a session is remembered.
const FAILED: Duration = Duration::from_secs(1);
/// Time after the end of a lease in which its owner is still named: longer than calls wait here.
const STALE: Duration = Duration::from_secs(10);

/// Why a session is not here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Away {
    why: Why,
    /// When the lease ends, or the answer is old.
    until: Instant,
    /// From when on the store should be asked again.
    again: Instant,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Why {
    /// Another server has a lease of it.
    Elsewhere { owner: String },
    /// The store did not answer.
    NoStore { reason: String },
    /// There is no room for it.
    TooMany { open: usize, limit: usize },
}

impl Away {
    /// The server at `owner` has a lease.
    pub(super) fn of(owner: String, ends_in: Duration, now: Instant) -> Self {
        Self::new(Why::Elsewhere { owner }, ends_in, now)
    }

    /// The store did not answer.
    pub(super) fn no_store(reason: String, now: Instant) -> Self {
        Self::new(Why::NoStore { reason }, FAILED, now)
    }

    /// There is no room for another session.
    pub(super) fn no_room(open: usize, limit: usize, now: Instant) -> Self {
        Self::new(Why::TooMany { open, limit }, FAILED, now)
    }

    fn new(why: Why, holds: Duration, now: Instant) -> Self {
        Self {
            why,
            until: now + holds,
            again: now + holds.min(ASK_AGAIN),
        }
    }

    /// Whether the store should be asked again.
    pub(super) fn is_old(&self, now: Instant) -> bool {
        now >= self.again
    }

    /// The error for a call at `now`. It outlives the lease, because the call may be late, and
    /// until the store is asked again nothing else is known. `None` if it is too old.
    pub(super) fn error(&self, id: &str, field: String, now: Instant) -> Option<SessionError> {
        if now.saturating_duration_since(self.until) >= STALE {
            return None;
        }
        let left = self.until.saturating_duration_since(now);
        let id = id.to_owned();
        Some(match &self.why {
            Why::Elsewhere { owner } if owner.is_empty() => SessionError::Moved { id, field },
            Why::Elsewhere { owner } => SessionError::Elsewhere {
                what: "session",
                name: id,
                owner: owner.clone(),
                ends_in_ms: u64::try_from(left.as_millis()).unwrap_or(u64::MAX),
                field,
            },
            Why::NoStore { reason } => SessionError::NoStore {
                reason: reason.clone(),
                field,
            },
            Why::TooMany { open, limit } => SessionError::TooMany {
                open: *open,
                limit: *limit,
                place: "",
            },
        })
    }
}

/// A session's tenant and id.
type Name = (Tenant, Arc<str>);

/// What is known about sessions elsewhere.
#[derive(Debug, Default)]
pub(super) struct AwayTable(HashMap<Name, Away>);

impl AwayTable {
    pub(super) fn note(&mut self, name: Name, away: Away, now: Instant) {
        if self.0.len() >= MAX_AWAY {
            self.0.retain(|_, away| away.until > now);
        }
        // What is forgotten is only asked for again.
        if self.0.len() >= MAX_AWAY {
            self.0.clear();
        }
        self.0.insert(name, away);
    }

    pub(super) fn forget(&mut self, name: &Name) {
        self.0.remove(name);
    }

    pub(super) fn get(&self, name: &Name) -> Option<&Away> {
        self.0.get(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_names_the_owner_until_the_store_is_asked_again() {
        let (now, mut table) = (Instant::now(), AwayTable::default());
        let name = |id: &str| (None, Arc::from(id));
        let away = Away::of("10.0.0.2:8080".to_owned(), Duration::from_millis(900), now);
        table.note(name("hero"), away, now);
        let error_at = |at| {
            table
                .get(&name("hero"))
                .unwrap()
                .error("hero", "id".to_owned(), at)
        };
        assert!(error_at(now + Duration::from_millis(10_900)).is_none());
        for (at_ms, left_ms) in [(300, 600), (900, 0), (10_899, 0)] {
            let at = now + Duration::from_millis(at_ms);
            let error = error_at(at).unwrap();
            let wanted =
                format!("session \"hero\" is on the server 10.0.0.2:8080, whose lease ends in {left_ms} ms");
            assert_eq!(error.to_string(), wanted);
        }
        let is_old = |ms| {
            table
                .get(&name("hero"))
                .unwrap()
                .is_old(now + Duration::from_millis(ms))
        };
        assert!(!is_old(249) && is_old(250));
    }

    #[test]
    fn the_table_has_an_end() {
        let (now, mut table) = (Instant::now(), AwayTable::default());
        for number in 0..=MAX_AWAY {
            let name = (None, Arc::from(number.to_string()));
            // Half of them are over when the table is full.
            let at = if number % 2 == 0 { now } else { now + FAILED };
            table.note(name, Away::no_store(String::new(), at), now + FAILED);
            assert!(table.0.len() <= MAX_AWAY);
        }
        assert_eq!(table.0.len(), MAX_AWAY / 2 + 1);
    }
}

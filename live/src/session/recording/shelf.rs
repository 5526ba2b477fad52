//! The recordings of a server.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use troupe_base::tenant::Tenant;

use super::tape::Tape;

/// Maximum number of recordings of all tenants together.
pub const MAX_RECORDINGS: usize = 32;
/// Time for which a recording is kept after its session ended.
const KEPT: Duration = Duration::from_secs(3600);

/// The recordings of all tenants. Beyond [`MAX_RECORDINGS`] a new one takes the place of another.
#[derive(Debug, Default)]
pub(crate) struct Shelf(Mutex<Vec<Entry>>);

#[derive(Debug)]
struct Entry {
    tenant: Tenant,
    id: Arc<str>,
    tape: Arc<Tape>,
}

impl Shelf {
    /// Adds the recording of a session that opened at `now`. The recording of an earlier session of
    /// this id goes. If there is no room, first one goes whose session ended, then one of the same
    /// tenant, each time the oldest.
    pub(super) fn add(&self, tenant: &Tenant, id: &Arc<str>, tape: Arc<Tape>, now: Instant) {
        let mut entries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        entries.retain(|entry| {
            let same = entry.tenant == *tenant && entry.id == *id;
            !same && !entry.is_old(now)
        });
        if entries.len() >= MAX_RECORDINGS {
            // Of equals this finds the first, which is the oldest.
            let least = (0..entries.len()).min_by_key(|&index| {
                let entry = &entries[index];
                (entry.tape.over().is_none(), entry.tenant != *tenant)
            });
            if let Some(least) = least {
                entries.remove(least).tape.discard();
            }
        }
        entries.push(Entry {
            tenant: tenant.clone(),
            id: id.clone(),
            tape,
        });
    }

    /// The recording of a tenant's session.
    pub(super) fn find(&self, tenant: &Tenant, id: &str, now: Instant) -> Option<Arc<Tape>> {
        let mut entries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        entries.retain(|entry| !entry.is_old(now));
        let own = |entry: &&Entry| entry.tenant == *tenant && *entry.id == *id;
        entries.iter().find(own).map(|entry| entry.tape.clone())
    }

    /// Forgets recordings that were kept for long enough at `now`.
    pub(crate) fn sweep(&self, now: Instant) {
        let mut entries = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        entries.retain(|entry| !entry.is_old(now));
    }
}

impl Entry {
    fn is_old(&self, now: Instant) -> bool {
        let over = self.tape.over();
        over.is_some_and(|over| now.saturating_duration_since(over) >= KEPT)
    }
}

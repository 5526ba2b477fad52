//! What is on its way here from the shared store: sessions, and objects of scenes. A second call
//! for it waits until it is here, because the lease is this server's before that.

use std::collections::HashSet;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// The ids of what calls bring here.
#[derive(Debug, Default)]
pub(super) struct Coming {
    ids: Mutex<HashSet<String>>,
    changed: Condvar,
}

/// What one call brings. It counts as coming until this is dropped.
#[must_use]
pub(super) struct Brought<'a> {
    all: &'a Coming,
    /// Those that were not here when the call began.
    pub(super) ids: Vec<String>,
}

impl Coming {
    /// Waits for those of `ids` that another call brings, and begins to bring those that `lacks`
    /// then still names. A call that has begun never waits, so two cannot wait for each other. This
    /// blocks.
    pub(super) fn begin(&self, mut ids: Vec<String>, lacks: impl Fn(&str) -> bool) -> Brought<'_> {
        let mut coming = self.lock();
        while ids.iter().any(|id| coming.contains(id)) {
            coming = self.changed.wait(coming).unwrap_or_else(PoisonError::into_inner);
        }
        ids.retain(|id| lacks(id));
        coming.extend(ids.iter().cloned());
        Brought { all: self, ids }
    }

    /// Whether a call brings it now.
    pub(super) fn has(&self, id: &str) -> bool {
        self.lock().contains(id)
    }

    fn lock(&self) -> MutexGuard<'_, HashSet<String>> {
        self.ids.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Brought<'_> {
    fn drop(&mut self) {
        let mut coming = self.all.lock();
        for id in &self.ids {
            coming.remove(id);
        }
        drop(coming);
        self.all.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use super::*;

    fn ids(ids: &[&str]) -> Vec<String> {
        ids.iter().map(|&id| id.to_owned()).collect()
    }

    #[test]
    fn a_second_call_waits_for_what_the_first_brings_and_for_nothing_else() {
        let (coming, is_here) = (Coming::default(), AtomicBool::new(false));
        let first = coming.begin(ids(&["a", "b"]), |_| true);
        assert_eq!(coming.begin(ids(&["c"]), |_| true).ids, ids(&["c"]));
        std::thread::scope(|scope| {
            let second = scope.spawn(|| {
                let lacks = |id: &str| id != "a" || !is_here.load(Ordering::SeqCst);
                coming.begin(ids(&["a", "c"]), lacks).ids.clone()
            });
            std::thread::sleep(Duration::from_millis(50));
            assert!(!second.is_finished());
            is_here.store(true, Ordering::SeqCst);
            drop(first);
            assert_eq!(second.join().unwrap(), ids(&["c"]));
        });
        assert!(coming.lock().is_empty());
    }
}

//! How far the store is behind, also while a write hangs.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use troupe_base::telemetry::{Gauge, Labels, Metric, Telemetry};

const AGE: Metric = Metric::new(
    "troupe_store_age_seconds",
    "Age of the oldest change of sessions and scenes that may not be in the store",
);

/// Age of the oldest unkept change from which on the server is not ready.
pub const MAX_STORE_AGE: Duration = Duration::from_secs(5);

/// What the store lacks. The keeper updates it, and others read it while the keeper writes.
#[derive(Debug)]
pub struct Backlog {
    state: Mutex<State>,
    age: Gauge,
    is_shared: bool,
}

#[derive(Debug)]
struct State {
    /// All changes before this are in the store.
    kept_until: Instant,
    /// Sessions with changes that were seen and are not in the store.
    sessions: usize,
    /// Why the last write failed. `None` after a write that succeeded.
    error: Option<String>,
}

/// The store is too far behind.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the store of sessions is {} s behind, allowed: at most {} s; {reason}",
    age.as_secs(),
    MAX_STORE_AGE.as_secs()
)]
pub struct StoreBehind {
    /// Age of the oldest change that is not in the store.
    pub age: Duration,
    /// Why, as far as it is known.
    pub reason: String,
}

impl Backlog {
    pub(super) fn new(telemetry: &Telemetry, is_shared: bool) -> Self {
        Self {
            state: Mutex::new(State {
                kept_until: Instant::now(),
                sessions: 0,
                error: None,
            }),
            age: telemetry.gauge(&AGE, &Labels::default()),
            is_shared,
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn set(&self, kept_until: Instant, sessions: usize) {
        let mut state = self.state();
        (state.kept_until, state.sessions) = (kept_until, sessions);
    }

    pub(super) fn set_error(&self, error: Option<String>) {
        self.state().error = error;
    }

    /// Every change that is older than this is in the store.
    pub fn age(&self) -> Duration {
        self.state().kept_until.elapsed()
    }

    /// Number of sessions with changes that the keeper has seen and has not written.
    pub fn sessions(&self) -> usize {
        self.state().sessions
    }

    /// Why changes are not in the store, as far as it is known.
    pub fn reason(&self) -> String {
        let error = self.state().error.clone();
        error.unwrap_or_else(|| "a write to the store has not ended".to_owned())
    }

    /// Updates the metric.
    pub fn look(&self) {
        self.age.set(self.age().as_secs_f64());
    }

    /// Whether other servers use the store, too. Then this server stays ready while the store is
    /// behind: the others lack it as well, and a router would have none left.
    pub fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// Checks that no unkept change is older than [`MAX_STORE_AGE`].
    ///
    /// # Errors
    /// [`StoreBehind`].
    pub fn check(&self) -> Result<(), StoreBehind> {
        let age = self.age();
        match age > MAX_STORE_AGE {
            true => Err(StoreBehind {
                age,
                reason: self.reason(),
            }),
            false => Ok(()),
        }
    }
}

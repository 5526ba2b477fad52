//! The clock for the expiry of sessions.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// A clock, which tests can replace. Clones are the same clock.
#[derive(Clone)]
pub struct TimeSource(Arc<dyn Fn() -> Instant + Send + Sync>);

impl TimeSource {
    /// Makes a clock from `now`, which must not go back.
    pub fn new(now: impl Fn() -> Instant + Send + Sync + 'static) -> Self {
        Self(Arc::new(now))
    }

    /// Reads the clock.
    pub fn now(&self) -> Instant {
        (self.0)()
    }
}

impl Default for TimeSource {
    /// The system's monotonic clock.
    fn default() -> Self {
        Self::new(Instant::now)
    }
}

impl fmt::Debug for TimeSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("TimeSource")
    }
}

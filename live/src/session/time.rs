//! Where the time of expiry comes from.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// Tells the time; tests bring their own. Clones tell the same.
#[derive(Clone)]
pub struct TimeSource(Arc<dyn Fn() -> Instant + Send + Sync>);

impl TimeSource {
    /// A source that asks `now`, which must not go back.
    pub fn new(now: impl Fn() -> Instant + Send + Sync + 'static) -> Self {
        Self(Arc::new(now))
    }

    /// The time now.
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

//! The target of the loops.

use std::future::Future;

use crate::measure::Outcome;

/// A server, as the loops see it.
pub trait Target: Send + Sync + 'static {
    /// Sends one request and waits for its answer. Calls of the same `caller` use the same
    /// connection. `number` chooses the request.
    fn call(&self, caller: u64, number: u64) -> impl Future<Output = Outcome> + Send;

    /// Number of right answers so far that were fully decoded and checked.
    fn verified(&self) -> u64 {
        0
    }
}

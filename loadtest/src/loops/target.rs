//! The target of the loops.

use std::future::Future;

use crate::measure::Outcome;

/// Something that answers single requests.
pub trait Target: Send + Sync + 'static {
    /// Sends one request and waits for its answer. Each `caller` uses one connection. `number`
    /// chooses the request.
    fn call(&self, caller: u64, number: u64) -> impl Future<Output = Outcome> + Send;

    /// Right answers so far that were decoded and checked whole.
    fn verified(&self) -> u64 {
        0
    }
}

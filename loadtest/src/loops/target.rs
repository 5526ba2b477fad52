//! What the loops ask.

use std::future::Future;

use crate::measure::Outcome;

/// Something that answers single requests.
pub trait Target: Send + Sync + 'static {
    /// Sends one request and waits for its answer. `caller` tells callers apart that each use one
    /// connection, `number` chooses the request.
    fn call(&self, caller: u64, number: u64) -> impl Future<Output = Outcome> + Send;

    /// Answers so far that were decoded and checked whole, and right.
    fn verified(&self) -> u64 {
        0
    }
}

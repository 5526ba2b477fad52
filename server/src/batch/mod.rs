//! Batching: concurrent requests share one inference call.
//!
//! [`scheduler`] decides (a pure state machine), [`Batcher`] drives it: a task that owns the scheduler and the waiting
//! work, and a thread that owns the engine. They talk over channels, so no lock is held anywhere.

mod driver;
pub mod scheduler;

pub use driver::{Batcher, EngineFactory, Served, SubmitError};

//! Batching: concurrent requests share network calls.
//!
//! [`scheduler`] decides (a pure state machine), [`Batcher`] drives it. A pack has workers:
//! threads, each with a generator of its own. No thread or task stands between callers and workers.
//! The scheduler and the waiting work are behind one lock, which is held for a few microseconds: by
//! a caller to put its request in, and by a worker between two steps to hand out what the last one
//! made and to take what comes next. An idle worker [spins](parker) for a moment and then parks; a
//! request that finds one wakes it.
//!
//! Why not a task with channels: where inference keeps all cores busy, whoever is to form the next
//! batch first waits for a core, and the worker with it. Measured in four pairs of runs with 64
//! callers, an engine that spins for 20 ms a batch, and a load average of 13 on two cores: a worker
//! stood idle for 7.2 to 9.3 ms between two batches (mean) where a task formed them, and for 0.7 to
//! 1.2 ms where it does so itself. `troupe_worker_gap_duration_seconds` shows it in a running
//! server.

mod batcher;
mod error;
mod metrics;
mod order;
mod parker;
pub mod scheduler;
mod served;
mod shared;
mod state;
mod trace;
mod worker;

pub use batcher::{Answer, Batcher, AnswerStream};
pub use error::SubmitError;
pub use metrics::{PackMetrics, Rejection};
pub use order::{Class, Order, OwnerId};
pub use served::{Piece, Served, ServedStep};
pub use trace::{trace_queue, trace_served, trace_step};
pub use worker::GeneratorFactory;

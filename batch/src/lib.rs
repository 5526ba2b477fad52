//! Batching: concurrent requests share network calls.
//!
//! The [`scheduler`] is a pure state machine that decides, and [`Batcher`] drives it. A pack has
//! workers: threads, each with its own generator. The scheduler and the waiting work are behind one
//! lock, which is held for a few microseconds. A caller takes it to add its request. A worker takes
//! it between two steps, to deliver the results of the last step and to get its next jobs. An idle
//! worker [spins](parker) for a moment and then parks. A new request wakes an idle worker.
//!
//! Why there is no batching task between callers and workers: if inference keeps all cores busy,
//! such a task first waits for a core, and the worker waits for the task. Measured in four pairs of
//! runs with 64 callers, an engine that spins for 20 ms per batch, and a load average of 13 on two
//! cores: with a batching task a worker was idle for 7.2 to 9.3 ms between two batches (mean). When
//! workers form their batches themselves, it was idle for 0.7 to 1.2 ms. In a running server
//! `troupe_worker_gap_duration_seconds` shows this time.

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

pub use batcher::{Answer, AnswerStream, Batcher, Leaving};
pub use error::SubmitError;
pub use metrics::{PackMetrics, Rejection};
pub use order::{Class, Order, OwnerId};
pub use served::{Piece, Served, ServedStep};
pub use trace::{trace_queue, trace_served, trace_step};
pub use worker::GeneratorFactory;

//! Batching: concurrent requests share inference calls.
//!
//! [`scheduler`] decides (a pure state machine), [`Batcher`] drives it. An engine has lanes: threads, each with a
//! pipeline of its own. There is no thread or task between callers and lanes. The scheduler and the waiting work are
//! behind one lock, which is held for a few microseconds: by a caller to put its request in, and by a lane to hand in
//! what it has done, call by call, and to cut its next batch, which it then runs at once. An idle lane [listens](bells) for a moment and then
//! sleeps; a request that finds one wakes it.
//!
//! Why not a task with channels: where inference keeps all cores busy, whoever is to cut the next batch first waits for a
//! core, and the lane with it. Measured in four pairs of runs, a debug build on two cores that had far more to do (load
//! average 13), an engine that only spins for 20 ms a batch of 16, one lane, 64 callers: from a batch's end to the start of
//! the next, a lane stood idle for 7.2 to 9.3 ms on average (median 3.8 to 7.4 ms) where a task on the runtime cut its
//! batches, and for 0.7 to 1.2 ms (median below 0.25 ms) where it cuts them itself. What is left is probably the callers that
//! an answer wakes, and that take the core for a moment. `troupe_lane_gap_duration_seconds` shows it in a running server.

mod bells;
mod core;
mod driver;
mod gauge;
mod lane;
mod metrics;
mod order;
pub mod scheduler;

pub use driver::{Answer, Batcher, EngineFactory, Served, SubmitError};
pub use gauge::EngineGauge;
pub use metrics::{PackMetrics, Rejection};
pub use order::{Class, Order, OwnerId};

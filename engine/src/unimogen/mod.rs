//! UniMoGen: one diffusion network that moves bodies of any skeleton along paths
//! (docs/unimogen-pack.md).
//!
//! A character of J joints has J + 1 rows. A call of the network takes the rows of any characters,
//! one after another, without padding. The reference is `training/troupe_training/models/unimogen`.

mod batch;
mod generator;
mod job;
mod network;
mod noise;
mod probe;
mod rows;
mod schedule;

pub use batch::Call;
pub(crate) use generator::LIVE_FRAMES;
pub use generator::{CALL_ROWS, UniMoGen};
pub use network::Denoiser;
pub use probe::probe_task;

/// Numbers of a row in one frame.
pub const ROW_CHANNELS: usize = 6;
/// Numbers of a path in one frame: velocity to the left and ahead, turn rate.
pub const PATH_FEATURES: usize = 3;

#[cfg(test)]
mod generator_tests;
#[cfg(test)]
mod tests;

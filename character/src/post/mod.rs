//! Post-processing: turns a generator's numbers into frames.

mod apart;
mod arms;
mod feet;
mod frames;
mod hinges;
mod legs;

pub(crate) use arms::clear_arms;
pub(crate) use feet::{bits_of, hold_live, plant};
pub use feet::{contact_bits, hold_between};
pub use frames::{NonFinite, check_finite, parent_relative, roots, to_world_rotations};
pub use hinges::{HingeColumns, RateColumns, onto_hinges};
pub(crate) use legs::part_legs;

/// Frames on either side of a keyframe over which the error of its pose fades out.
pub const PIN_REACH_FRAMES: usize = 8;

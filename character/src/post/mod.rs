//! Post-processing: what is done to a generator's numbers until they are frames.

mod feet;
mod frames;
mod hinges;
mod legs;

pub(crate) use feet::bits_of;
pub use feet::{contact_bits, hold_between, hold_live};
pub use frames::{NonFinite, check_finite, parent_relative, roots, to_world_rotations};
pub use hinges::{HingeColumns, onto_hinges};
pub(crate) use legs::part_legs;

/// Frames on either side of a keyframe over which what its pose still lacks fades out.
pub const PIN_REACH_FRAMES: usize = 8;

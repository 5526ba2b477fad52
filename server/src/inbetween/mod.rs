//! In-betweening: from a request to the stages' input, and from their output to frames.
//!
//! [`prepare`] checks every value of a request and moves each character into its segment frame (the projected root of
//! the last context frame at the origin, heading 0), where the model works. [`finish`] turns what the stages made into
//! frames: world rotations to parent-relative ones, roots and poses pinned to the keyframes, the segment frame undone, feet
//! that stand held still, a robot's poses brought onto its hinges.

mod context;
mod feet;
mod field;
mod finish;
mod hinges;
mod keyframe;
mod prepare;

#[cfg(test)]
pub(crate) use prepare::tests as prepare_tests;

pub use context::{ContextFrame, check_context};
pub(crate) use feet::{contact_bits, hold_live};
pub use field::{FieldError, Path};
pub use finish::{NonFinite, finish};
pub(crate) use finish::{check_finite, parent_relative, roots, to_world_rotations};
pub(crate) use keyframe::{Checked, KeyWriter};
pub use prepare::{Given, Parts, Plan, RequestLimits, prepare};

/// Largest distance of any keyframe from the last context frame, in metres.
pub const MAX_DISTANCE_M: f32 = 1e4;
/// Largest distance of any given height from the ground, in metres.
pub const MAX_HEIGHT_M: f32 = 100.0;
/// How far apart the heights that one keyframe gives may be, in metres.
pub const HEIGHT_TOLERANCE_M: f32 = 1e-3;
/// How far a keyframe's heading may be from that of its pose, in radians.
pub const HEADING_TOLERANCE: f32 = 0.01;
/// Largest given velocity of a keyframe, in m/s along an axis and in rad/s.
pub const MAX_VELOCITY: f32 = 1e3;
/// How far outside of its hinge's limits an angle of a keyframe may be, radians; it is taken as the limit.
pub const ANGLE_TOLERANCE_RAD: f32 = 0.01;
/// Most bytes of a character's id.
pub const MAX_ID_BYTES: usize = 128;
/// Frames on either side of a keyframe over which what its pose still lacks fades out.
pub const PIN_REACH_FRAMES: usize = 8;
/// Most passes of the pose stage.
pub const MAX_POSE_STEPS: u32 = 10;
/// Highest sampling temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;
/// How far a rotation's length may be from 1.
pub const UNIT_TOLERANCE: f32 = 1e-3;

//! In-betweening: from a request to the stages' input, and from their output to frames.
//!
//! [`prepare`] checks every value of a request and moves each character into its segment frame (the projected root of
//! the last context frame at the origin, heading 0), where the model works. [`finish`] turns what the stages made into
//! frames: world rotations to parent-relative ones, roots and poses pinned to the keyframes, the segment frame undone, feet
//! that stand held still, a robot's poses brought onto its hinges.

mod context;
mod finish;
mod generate;
mod hinges;
mod keyframe;
#[cfg(test)]
mod live_equals_tests;
mod prepare;

pub use context::{ContextFrame, check_context};
pub use finish::finish;
pub use generate::{MAX_GENERATED_FRAMES, MAX_PROMPT_CHARS, PartWriter, prepare_generate};
pub use prepare::{Parts, Plan, RequestLimits, prepare};

/// Largest distance of any keyframe from the last context frame, in metres.
pub const MAX_DISTANCE_M: f32 = 1e4;
/// How far apart the heights that one keyframe gives may be, in metres.
pub const HEIGHT_TOLERANCE_M: f32 = 1e-3;
/// Largest given velocity of a keyframe, in m/s along an axis and in rad/s.
pub const MAX_VELOCITY: f32 = 1e3;
/// How far outside of its hinge's limits an angle of a keyframe may be, radians; it is taken as the limit.
pub const ANGLE_TOLERANCE_RAD: f32 = 0.01;
/// Most bytes of a character's id.
pub const MAX_ID_BYTES: usize = 128;
/// Most passes of the pose stage.
pub const MAX_POSE_STEPS: u32 = 10;
/// Highest sampling temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;

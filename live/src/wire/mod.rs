//! Values of messages: checked, brought into native units and axes, and back.
//!
//! Conventions are dealt with here, at the edge; everything that comes out is in metres, radians
//! and the native axes. [`units`] has single values, [`keyframe`] keyframes, [`context`] those that
//! a live character begins with.

mod context;
mod hinges;
pub mod keyframe;
pub mod units;

pub use troupe_character::limits::MAX_DISTANCE_M;

pub use context::{ContextFrame, check_context, check_frame, to_native};

/// How far apart the heights that one keyframe gives may be, in metres.
pub const HEIGHT_TOLERANCE_M: f32 = 1e-3;
/// Largest given velocity of a keyframe, in m/s along an axis and in rad/s.
pub const MAX_VELOCITY: f32 = 1e3;
/// How far outside of its hinge's limits an angle of a keyframe may be, radians; it is taken as the
/// limit.
pub const ANGLE_TOLERANCE_RAD: f32 = 0.01;
/// Highest sampling temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;
/// Most characters of a sentence to act out.
pub const MAX_PROMPT_CHARS: usize = 1000;

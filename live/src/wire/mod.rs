//! Checks the values of messages and converts between them and native units and axes.
//!
//! The rest of the crate knows only metres, radians and the native axes. [`units`] handles single
//! values, [`keyframe`] keyframes, [`context`] the keyframes from which a live character starts,
//! and [`body`] skeletons of joints.

mod body;
mod context;
mod hinges;
pub mod keyframe;
mod measure;
mod skeleton;
pub mod units;

pub use troupe_character::limits::MAX_DISTANCE_M;

pub use body::inline_body;
pub use context::check_frame;
pub(crate) use context::{ContextFrame, check_context, to_native};
pub use measure::Measure;
pub use skeleton::{joint_message, robot_message, vector_message};
pub(crate) use units::named;

/// Maximum difference between the heights that one keyframe gives in several fields, metres.
pub const HEIGHT_TOLERANCE_M: f32 = 1e-3;
/// Maximum velocity of a keyframe: m/s along an axis, and rad/s.
pub(crate) const MAX_VELOCITY: f32 = 1e3;
/// An angle of a keyframe may exceed its hinge's limits by this much, radians. It is then set to
/// the limit.
pub(crate) const ANGLE_TOLERANCE_RAD: f32 = 0.01;
/// Maximum sampling temperature.
pub const MAX_TEMPERATURE: f32 = 2.0;
/// Maximum length of a sentence to act out, characters.
pub const MAX_PROMPT_CHARS: usize = 1000;

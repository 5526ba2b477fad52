//! Smart objects (paper section 6.2): turn an object's keyframes and a character's state into
//! keyframe constraints.
//!
//! * [`Approach`] steers the character to where the first set begins, by
//!   [`LocomotionCommand`](super::LocomotionCommand)s.
//! * [`Interaction`] is the state machine of the sets: which motion is wanted next and when, and
//!   what happens as the frames go by.
//! * [`Key`] is a full keyframe: root and pose, with single joints brought to their points by
//!   inverse kinematics. [`targets`] turns keys into what the networks are asked for.
//!
//! All of it is pure: it knows no clock, no scene and no networks. Frames count on the character's
//! timeline.

mod approach;
mod interaction;
mod key;
pub mod recipe;

pub use approach::{Approach, Entry, Going, Here};
pub use interaction::{Input, Interaction, Output, Stretch, Want};
pub use key::{BodyParts, Key, KeyframeError, Unreachable, Way, keys, stance_frames, suits_stance, targets};

/// A frame of the character's timeline.
pub type Frame = i64;

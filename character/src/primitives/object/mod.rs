//! Smart objects (paper section 6.2): from an object's keyframes and a character's state to
//! keyframe constraints.
//!
//! * [`Approach`] steers the character to where the first set begins, as a
//!   [`LocomotionCommand`](super::LocomotionCommand).
//! * [`Interaction`] is the state machine of the sets: which one's motion is wanted next and from
//!   which frame on, and what happens as the frames go by.
//! * [`Key`] is a keyframe worked out in full: where the root is and the whole pose, single joints
//!   brought to their points by inverse kinematics. [`targets`] makes of them what the networks are
//!   asked for.
//!
//! All of it is pure: it knows no clock, no scene and no networks. Frames are those of the
//! character's timeline.

mod approach;
mod interaction;
mod key;
pub mod recipe;

pub use approach::{Approach, Entry, Going, Here};
pub use interaction::{Input, Interaction, Output, Stretch, Want};
pub use key::{BodyParts, Key, KeyframeError, Unreachable, Way, keys, stance_frames, suits_stance, targets};

/// A frame of the character's timeline.
pub type Frame = i64;

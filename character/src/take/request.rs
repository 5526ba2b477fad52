//! The description of a motion: its body, its segments, and its constraints.

use std::sync::Arc;

use troupe_motion::model::{Body, KeyTensors, Rig};
use troupe_motion::{Quat, Vec3};

use super::ground::Ground;
use super::onto::Onto;
use crate::Size;
use crate::live::request::Context;
use crate::style::Style;

/// The body of a take, with the values that its network needs.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The body's skeleton, and the sizes of windows.
    pub rig: Arc<Rig>,
    /// Rotations of the pose at rest, one a joint, relative to the parents. In this pose the body
    /// stands and faces +Z.
    pub rest: Vec<Quat>,
    /// Height of the root in the pose at rest, metres.
    pub rest_height_m: f32,
    /// Set for a body whose network follows paths; none for one whose network takes keyframes.
    pub follower: Option<Follower>,
}

/// The values that a network for paths needs besides a path.
#[derive(Debug, Clone)]
pub struct Follower {
    /// The body in the network's format.
    pub body: Arc<Body>,
    /// The words that the network knows, in the order of its inputs.
    pub words: Arc<[String]>,
    /// Steps of the sampler if the take names none.
    pub steps: u32,
}

/// One motion to make, or several samples of it.
#[derive(Debug, Clone)]
pub struct Take {
    /// The body that moves.
    pub subject: Subject,
    /// Segments of the motion in order, at least one.
    pub segments: Vec<TakeSegment>,
    /// Constraints on the motion.
    pub wanted: Wanted,
    /// Seed of all random choices.
    pub seed: u64,
    /// Frames to make, at the body's own rate.
    pub frames: usize,
    /// Frame rates of body and answer.
    pub clock: Clock,
    /// Whether standing feet are held still.
    pub hold_feet: bool,
    /// Frames of the transition to a segment of words from the one before.
    pub transition: usize,
    /// Whether the last frame has the pose of the first. It may be at another position.
    pub is_loop: bool,
    /// Style of the motion, and options of the sampler.
    pub look: Look,
    /// Frames that go before the motion's first one. Only for takes in parts.
    pub past: Option<Context>,
    /// Whether each window is final once it is made, see [`Making::part`](super::Making::part). It
    /// meets whole poses alone: such a take has no effectors, parts of poses, ground or loop, and
    /// its path is a guide.
    pub in_parts: bool,
    /// The body of the answer, and what it must meet; none for the take's own. Then `wanted` only
    /// guides the take's body. Not for takes in parts.
    pub onto: Option<Onto>,
}

/// Style of the motion, and options of the sampler.
#[derive(Debug, Clone, Default)]
pub struct Look {
    /// For a body that takes keyframes: how it walks between them.
    pub style: Option<Arc<Style>>,
    /// For a body that follows paths: one of [`Follower::words`].
    pub word: Option<String>,
    /// 0 for the likeliest choices, above 0 to sample.
    pub temperature: f32,
    /// Steps of a sampler; none for the default.
    pub steps: Option<u32>,
    /// Strength of the word; none for 1.
    pub guidance: Option<f32>,
}

impl Take {
    /// Whether a segment is motion for words.
    pub(super) fn speaks(&self) -> bool {
        self.segments.iter().any(|segment| segment.prompt != Prompt::Free)
    }

    /// The size of the answer's body, for errors and notes about the take's.
    pub(super) fn size(&self) -> Size {
        let scale = self.onto.as_ref().map(|onto| onto.retargeter().scale());
        scale.map_or_else(Size::default, |scale| Size::new(scale, 0.0))
    }
}

/// A part of the motion with its own prompt.
#[derive(Debug, Clone, PartialEq)]
pub struct TakeSegment {
    /// The frame after the last one of the segment, at the body's rate.
    pub end: usize,
    /// Replaces the take's seed for this segment.
    pub seed: Option<u64>,
    /// The request for this segment.
    pub prompt: Prompt,
}

/// A motion in the format of generators, relative to its first root.
pub type MotionFrames = Arc<[KeyTensors]>;

/// The request for a segment.
#[derive(Debug, Clone, PartialEq)]
pub enum Prompt {
    /// Any motion that meets the constraints.
    Free,
    /// Motion for a text.
    Words(String),
    /// Motion similar to another one: the generator describes that one in words, and makes motion
    /// for the words.
    Like(MotionFrames),
}

/// Frame rates of a body and of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Frames a second of the body.
    pub native_fps: f32,
    /// Frames a second of the answer.
    pub fps: f32,
    /// Number of frames of the answer.
    pub frames: usize,
}

impl Clock {
    /// Whether the answer's frame rate differs from the body's.
    pub fn resamples(&self) -> bool {
        (self.fps - self.native_fps).abs() > 1e-3
    }

    /// The body's frame at the time of a frame of the answer; may be a fraction.
    pub fn native(&self, frame: usize) -> f32 {
        match self.resamples() {
            true => frame as f32 * (self.native_fps / self.fps),
            false => frame as f32,
        }
    }

    /// Number of frames that the generator must make.
    pub fn native_frames(&self) -> usize {
        self.native(self.frames.saturating_sub(1)).ceil() as usize + 1
    }
}

/// The constraints on a motion. Frames are the body's, and heights count from the ground.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Positions of the root over the ground, in the order of their frames.
    pub path: Vec<Knot>,
    /// Poses and partial poses, in the order of their frames, at most one a frame.
    pub keys: Vec<PoseKey>,
    /// Positions of joints, in the order of their frames.
    pub effectors: Vec<Effector>,
    /// The surface below the motion.
    pub ground: Ground,
}

/// A position of the root over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// The frame; may be a fraction.
    pub frame: f32,
    /// World x and z, metres.
    pub place: [f32; 2],
    /// Heading in radians; none leaves it free.
    pub heading: Option<f32>,
}

/// A pose, or a partial pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseKey {
    /// The frame with this pose.
    pub frame: usize,
    /// One entry a joint: joint 0 in world space, others relative to their parents.
    pub rotations: Vec<Option<Quat>>,
    /// World position of the root, metres; none leaves it free.
    pub root: Option<Vec3>,
}

impl PoseKey {
    /// All rotations; none for a partial pose.
    pub fn whole(&self) -> Option<Vec<Quat>> {
        self.rotations.iter().copied().collect()
    }
}

/// The position of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effector {
    /// The frame of the constraint.
    pub frame: usize,
    /// Index into the skeleton's joints.
    pub joint: usize,
    /// World position, metres.
    pub point: Vec3,
    /// World rotation; none leaves it free.
    pub rotation: Option<Quat>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_may_have_another_frame_rate_than_the_body() {
        let clock = |fps, frames| Clock {
            native_fps: 30.0,
            fps,
            frames,
        };
        assert_eq!(clock(30.0, 90).native_frames(), 90);
        assert!(!clock(30.0, 90).resamples());
        assert_eq!(clock(60.0, 91).native_frames(), 46);
        assert_eq!(clock(24.0, 25).native_frames(), 31);
        assert_eq!(clock(24.0, 25).native(24), 30.0);
        assert_eq!(clock(24.0, 1).native_frames(), 1);
    }
}

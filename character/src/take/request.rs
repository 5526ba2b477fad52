//! What a motion is made of: its body, its segments, and what it must meet.

use std::sync::Arc;

use troupe_motion::model::{Body, KeyTensors, Rig};
use troupe_motion::{Quat, Vec3};

use super::ground::Ground;
use crate::style::Style;

/// The body of a take, and how its network is asked.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The skeleton and the sizes of windows.
    pub rig: Arc<Rig>,
    /// Rotations of the pose at rest, one a joint, relative to the parents. It stands and faces +Z.
    pub rest: Vec<Quat>,
    /// Height of the root in that pose, metres.
    pub rest_height_m: f32,
    /// Set for a body whose network takes paths; none for one that takes keyframes.
    pub follower: Option<Follower>,
}

/// What a network that takes paths needs beside a path.
#[derive(Debug, Clone)]
pub struct Follower {
    /// The body as the network reads it.
    pub body: Arc<Body>,
    /// The words that the network knows, in the order of its inputs.
    pub words: Arc<[String]>,
    /// Steps of the sampler for a take that names none.
    pub steps: u32,
}

/// One motion to make, or several samples of it.
#[derive(Debug, Clone)]
pub struct Take {
    /// The body.
    pub subject: Subject,
    /// Segments of the motion, one after another; at least one.
    pub parts: Vec<Part>,
    /// Constraints.
    pub wanted: Wanted,
    /// All random choices follow from it.
    pub seed: u64,
    /// Frames to make, at the body's own rate.
    pub frames: usize,
    /// Frame rates of body and answer.
    pub clock: Clock,
    /// Whether feet that stand are held still.
    pub hold_feet: bool,
    /// Frames over which a segment of words leads over from the one before.
    pub transition: usize,
    /// Whether the last frame is the first one, carried along the way.
    pub is_loop: bool,
    /// How to move.
    pub look: Look,
}

/// How to move.
#[derive(Debug, Clone, Default)]
pub struct Look {
    /// Of a body that takes keyframes: how it walks between them.
    pub style: Option<Arc<Style>>,
    /// Of a body that takes paths: one of [`Follower::words`].
    pub word: Option<String>,
    /// 0 for the most likely choices, above 0 to sample.
    pub temperature: f32,
    /// Steps of a sampler; none for the usual ones.
    pub steps: Option<u32>,
    /// How much the word counts; none for 1.
    pub guidance: Option<f32>,
}

/// A segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The frame behind its last one.
    pub end: usize,
    /// Replaces the take's seed.
    pub seed: Option<u64>,
    /// What to do.
    pub prompt: Prompt,
}

/// A motion as a generator reads it, in the frame of its first root.
pub type MotionFrames = Arc<[KeyTensors]>;

/// What a segment asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Prompt {
    /// Whatever suits the constraints.
    Free,
    /// To act out words.
    Words(String),
    /// Motion like another: the generator puts that into words, and acts them out.
    Like(MotionFrames),
}

/// The frames of an answer beside those that the body has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Frames a second of the body.
    pub native_fps: f32,
    /// Frames a second of the answer.
    pub fps: f32,
    /// Frames of the answer.
    pub frames: usize,
}

impl Clock {
    /// Whether the answer has a frame rate of its own.
    pub fn resamples(&self) -> bool {
        (self.fps - self.native_fps).abs() > 1e-3
    }

    /// The body's frame at a frame of the answer, between frames too.
    pub fn native(&self, frame: usize) -> f32 {
        match self.resamples() {
            true => frame as f32 * (self.native_fps / self.fps),
            false => frame as f32,
        }
    }

    /// Frames that the generator makes.
    pub fn native_frames(&self) -> usize {
        self.native(self.frames.saturating_sub(1)).ceil() as usize + 1
    }
}

/// What a motion must meet. Frames are the body's, and heights count from the ground.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Places of the root over the ground, in the order of their frames.
    pub path: Vec<Knot>,
    /// Poses and parts of poses, in the order of their frames, at most one a frame.
    pub keys: Vec<PoseKey>,
    /// Places of joints, in the order of their frames.
    pub effectors: Vec<Effector>,
    /// The surface below.
    pub ground: Ground,
}

/// A place of the root over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// The frame, between frames too.
    pub frame: f32,
    /// World x and z, metres.
    pub place: [f32; 2],
    /// Radians; none leaves it to the motion.
    pub heading: Option<f32>,
}

/// A pose, or a part of one.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseKey {
    /// The frame that has it.
    pub frame: usize,
    /// One entry a joint: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Option<Quat>>,
    /// World place of the root, metres.
    pub root: Option<Vec3>,
}

impl PoseKey {
    /// All rotations; none for a part of a pose.
    pub fn whole(&self) -> Option<Vec<Quat>> {
        self.rotations.iter().copied().collect()
    }
}

/// The place of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effector {
    /// The frame that has it.
    pub frame: usize,
    /// Index into the skeleton's joints.
    pub joint: usize,
    /// World place, metres.
    pub point: Vec3,
    /// World rotation.
    pub rotation: Option<Quat>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_may_have_a_frame_rate_of_its_own() {
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

//! A checked request, in the model's own frames.

use std::sync::Arc;

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use troupe_character::style::Style;
use troupe_motion::{Quat, Vec3};

use super::ground::Ground;
use super::model::Model;
use super::reference::Frames;
use super::skeleton::Joints;

/// What is to be made: one request.
#[derive(Debug, Clone)]
pub struct Take {
    /// Of what.
    pub model: Model,
    /// How the request orders the joints.
    pub joints: Arc<Joints>,
    /// What to do, one after another; at least one.
    pub parts: Vec<Part>,
    /// What to meet.
    pub wanted: Wanted,
    /// How many times.
    pub samples: usize,
    /// Of all choices.
    pub seed: u64,
    /// Frames of the model.
    pub frames: usize,
    /// Of the answer.
    pub clock: Clock,
    /// Whether feet that stand are held still.
    pub hold_feet: bool,
    /// Frames of the model over which words lead over from what was before.
    pub transition: usize,
    /// Whether the end meets the start.
    pub is_loop: bool,
    /// How to move.
    pub look: Look,
    /// What was done otherwise than asked.
    pub notes: Vec<Note>,
}

/// How to move.
#[derive(Debug, Clone, Default)]
pub struct Look {
    /// Of models that walk.
    pub style: Option<Arc<Style>>,
    /// Of models that follow: a word.
    pub word: Option<String>,
    /// Sampling temperature.
    pub temperature: f32,
    /// Steps of a sampler.
    pub steps: Option<u32>,
    /// Guidance of a sampler.
    pub guidance: Option<f32>,
}

/// A segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Its last frame and one more, of the model.
    pub end: usize,
    /// Its own seed.
    pub seed: Option<u64>,
    /// What to do.
    pub prompt: Prompt,
}

/// What a segment asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Prompt {
    /// Whatever suits the constraints.
    Free,
    /// To act out words.
    Words(String),
    /// Motion like another: its words are acted out.
    Like(Frames),
}

/// The frames of an answer beside those of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Frames a second of the model.
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

    /// The model's frame at a frame of the answer, between frames too.
    pub fn native(&self, frame: usize) -> f32 {
        match self.resamples() {
            true => frame as f32 * (self.native_fps / self.fps),
            false => frame as f32,
        }
    }

    /// Frames that the model makes.
    pub fn native_frames(&self) -> usize {
        self.native(self.frames.saturating_sub(1)).ceil() as usize + 1
    }
}

/// What a motion must meet; frames are the model's, and heights count from the ground.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Where the root is over the ground, by frame.
    pub path: Vec<Knot>,
    /// Poses and parts of poses, by frame, one a frame.
    pub keys: Vec<PoseKey>,
    /// Where joints are, by frame.
    pub effectors: Vec<Effector>,
    /// What it stands on.
    pub ground: Ground,
}

/// A place of the root over the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// The frame, between frames too.
    pub frame: f32,
    /// World x and z, metres.
    pub place: [f32; 2],
    /// Radians.
    pub heading: Option<f32>,
}

/// A pose, or a part of one.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseKey {
    /// The frame.
    pub frame: usize,
    /// The given rotations, one a joint.
    pub rotations: Vec<Option<Quat>>,
    /// World place of the root, metres.
    pub root: Option<Vec3>,
}

impl PoseKey {
    /// All rotations, where all are given.
    pub fn whole(&self) -> Option<Vec<Quat>> {
        self.rotations.iter().copied().collect()
    }
}

/// The place of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effector {
    /// The frame.
    pub frame: usize,
    /// The joint.
    pub joint: usize,
    /// World place, metres.
    pub point: Vec3,
    /// World rotation.
    pub rotation: Option<Quat>,
}

/// Something that a client should know of an answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Note {
    /// A word for it.
    pub code: &'static str,
    /// `info` or `warning`.
    pub severity: &'static str,
    /// For people.
    pub message: String,
}

impl Note {
    /// Something that is good to know.
    pub fn info(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: "info",
            message: message.into(),
        }
    }

    /// Something that is not as it was asked for.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            severity: "warning",
            ..Self::info(code, message)
        }
    }
}

/// A generator of the choices of one sample.
pub fn dice(seed: u64, sample: usize) -> ChaCha8Rng {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    dice.set_stream(sample as u64);
    dice
}

/// The seed of a window of a sample.
pub fn window_seed(seed: u64, sample: usize, window: usize) -> u64 {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    // Stream 0 of each sample is that of `dice`.
    dice.set_stream(((window as u64 + 1) << 32) | sample as u64);
    dice.next_u64()
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

    #[test]
    fn each_window_of_each_sample_has_a_seed_of_its_own() {
        let mut seeds: Vec<u64> = (0..4)
            .flat_map(|sample| (0..4).map(move |window| window_seed(7, sample, window)))
            .collect();
        assert_eq!(seeds[0], window_seed(7, 0, 0));
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 16);
    }
}

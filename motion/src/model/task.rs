//! What a generator is asked for, in the segment frame.

use std::sync::Arc;

use super::{Body, Dims, GLOBAL_ROOT, LOCAL_ROOT, RootOverride};
use crate::root::wrap_angle;

/// One keyframe as networks read it, in the segment frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeyTensors {
    /// Velocity x and z (m/s), angular velocity (rad/s), height (m).
    pub local_root: Option<[f32; LOCAL_ROOT]>,
    /// Position (m), cosine and sine of the heading.
    pub global_root: Option<[f32; GLOBAL_ROOT]>,
    /// Pose feature, `joints * 9`.
    pub pose: Option<Box<[f32]>>,
}

/// A path that the root is drawn to (root interpolation, paper section 6.1 and figure 14).
///
/// It acts between the root stage and the pose stage, behind the context frames. A frame is moved
/// by the ratios of what lies between r_g3 and the path. Frames beyond the path's end are moved as
/// its last frame is.
#[derive(Debug, Clone, PartialEq)]
pub struct RootGuide {
    /// `[frames][x, y, z, heading]` from the segment's first frame on: metres and radians, in the
    /// segment frame.
    pub path: Box<[[f32; 4]]>,
    /// 0 keeps r_g3's place on the ground, 1 takes the path's; up to 1.2.
    pub position_ratio: f32,
    /// 0 keeps r_g3's height, 1 takes the path's.
    pub height_ratio: f32,
    /// 0 keeps r_g3's heading, 1 takes the path's; up to 1.2.
    pub heading_ratio: f32,
}

impl RootGuide {
    /// Moves `roots`, frames of [`GLOBAL_ROOT`] numbers, from frame `first` on.
    pub fn apply(&self, roots: &mut [f32], first: usize) {
        // Of the last frame on the path: offset in x, y and z, cosine and sine of the turn.
        let mut shift = [0.0, 0.0, 0.0, 1.0, 0.0];
        for (frame, root) in roots.chunks_exact_mut(GLOBAL_ROOT).enumerate().skip(first) {
            let &mut [x, y, z, cos, sin] = root else { continue };
            if let Some(&[to_x, to_y, to_z, to_heading]) = self.path.get(frame) {
                let turn = self.heading_ratio * wrap_angle(to_heading - sin.atan2(cos));
                shift = [
                    self.position_ratio * (to_x - x),
                    self.height_ratio * (to_y - y),
                    self.position_ratio * (to_z - z),
                    turn.cos(),
                    turn.sin(),
                ];
            }
            let [shift_x, shift_y, shift_z, turn_cos, turn_sin] = shift;
            root[0] = x + shift_x;
            root[1] = y + shift_y;
            root[2] = z + shift_z;
            root[3] = cos * turn_cos - sin * turn_sin;
            root[4] = sin * turn_cos + cos * turn_sin;
        }
    }
}

/// A pose between context and targets.
#[derive(Debug, Clone, PartialEq)]
pub struct GapPose {
    /// Frame of the segment; one that the segment does not have is left out.
    pub frame: usize,
    /// Pose feature, `joints * 9`, in the segment frame.
    pub pose: Box<[f32]>,
}

/// Keyframes to meet, checked and in the segment frame.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyframeTask {
    /// The pack's number of context keyframes, the first frames of the segment.
    pub context: Vec<KeyTensors>,
    /// One or more target keyframes, the last frames of the segment.
    pub targets: Vec<KeyTensors>,
    /// Frames of the segment, where the request fixes them.
    pub frames: Option<usize>,
    /// Which token counts the root stage may choose, from the pack's minimum on; at least one.
    pub allowed_counts: Vec<bool>,
    /// Seed of all random choices.
    pub seed: u64,
    /// 0 for the most likely choice, above 0 to sample: token count, pose tokens, and the root
    /// trajectory where the pack's [`Dims::root_choices`] are not 0.
    pub temperature: f32,
    /// Passes of the pose stage.
    pub pose_steps: u32,
    /// Where to draw the root, if anywhere.
    pub root_guide: Option<RootGuide>,
    /// Roots that the decoder gets in the place of the predicted ones, if any. The pose stage does
    /// not see them.
    pub root_override: Option<RootOverride>,
    /// Poses between context and targets.
    pub gap_poses: Vec<GapPose>,
}

impl KeyframeTask {
    /// Frames of the segment, once its token count is known.
    pub fn frames(&self, dims: &Dims, tokens: usize) -> usize {
        self.frames.unwrap_or(tokens * dims.frames_per_token)
    }

    /// The frame of each target keyframe in a segment of `frames` frames.
    pub fn target_frames(&self, frames: usize) -> impl Iterator<Item = usize> {
        frames - self.targets.len()..frames
    }
}

/// A path to follow, by a body of any skeleton, in the segment frame.
///
/// The answer has as many frames as the path. Its root is the network's own, not drawn to path or
/// keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct PathTask {
    /// What is to move.
    pub body: Arc<Body>,
    /// The first frames: none to begin anywhere, or as many as the pack has context frames. A
    /// keyframe counts where it has both a global root and a pose.
    pub context: Vec<KeyTensors>,
    /// The last frames, at most as many as the pack has targets; as the context.
    pub targets: Vec<KeyTensors>,
    /// `[frames][x, z, heading]`, metres and radians. It passes the roots of context and targets.
    /// Frames are as many as a segment of the pack may have, whole tokens.
    pub path: Box<[[f32; 3]]>,
    /// A weight for each word of the pack; all zero for no style.
    pub style: Vec<f32>,
    /// Steps of the sampler, from 1 to the pack's diffusion steps.
    pub steps: u32,
    /// 1 has the style as it was trained, more exaggerates it.
    pub guidance: f32,
    /// Seed of all random choices.
    pub seed: u64,
}

/// How tokens are chosen. What is left out is as the pack says.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SamplingTask {
    /// 0 for the most likely choice, above 0 to sample.
    pub temperature: Option<f32>,
    /// How many of the likeliest tokens may be chosen; 0 for all of them.
    pub top_k: Option<u32>,
    /// The likeliest tokens that may be chosen are together at least so likely; 1 for all of them.
    pub top_p: Option<f32>,
    /// What logits of the last tokens are weakened by; 1 for nothing.
    pub repetition: Option<f32>,
}

impl SamplingTask {
    /// At that temperature, and as the pack says otherwise.
    pub fn at(temperature: f32) -> Self {
        Self {
            temperature: Some(temperature),
            ..Self::default()
        }
    }
}

/// What sounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sound {
    /// Music, for dances.
    Music,
    /// Speech, for gestures.
    Speech,
}

/// Audio as the codes of a pack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Audio {
    /// What sounds.
    pub sound: Sound,
    /// Its codes.
    pub codes: Vec<u32>,
}

/// A second character of a task, and more.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AgentTask {
    /// What it is to do, in words.
    pub text: String,
    /// Frames that go before, as many as those of the first.
    pub context: Vec<KeyTensors>,
}

/// Words to act out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PromptTask {
    /// What to do, in words. Beside a context, targets or audio it may be empty.
    pub text: String,
    /// Frames that go before, oldest first, in the segment frame; none to begin anywhere.
    pub context: Vec<KeyTensors>,
    /// Frames that come after, oldest first, in the segment frame; none to end anywhere. Then
    /// `frames` is those between.
    pub targets: Vec<KeyTensors>,
    /// What is to be danced or spoken to.
    pub audio: Option<Audio>,
    /// Other characters of the same motion.
    pub others: Vec<AgentTask>,
    /// Frames to make, where the caller fixes them.
    pub frames: Option<usize>,
    /// Seed of all random choices.
    pub seed: u64,
    /// How tokens are chosen.
    pub sampling: SamplingTask,
    /// Whether frames are to leave while later ones are made. Else all leave together, for less
    /// work.
    pub in_parts: bool,
    /// Steps of the pack's flow decoder: its frames are finer, and leave together. 0 for the plain
    /// decoder.
    pub flow_steps: u32,
}

/// What a motion is to be put into.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Telling {
    /// Words.
    #[default]
    Words,
    /// Codes of audio that goes with it.
    Audio(Sound),
}

/// A motion to put into words.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DescribeTask {
    /// The motion's frames, in the frame of its first root.
    pub frames: Vec<KeyTensors>,
    /// Frames of other characters, as many as those of the first.
    pub others: Vec<Vec<KeyTensors>>,
    /// What to put it into.
    pub into: Telling,
    /// Seed of all random choices.
    pub seed: u64,
    /// How tokens are chosen.
    pub sampling: SamplingTask,
}

/// What one job asks of a generator.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// Fill the gap between context and target keyframes.
    Keyframes(KeyframeTask),
    /// Follow a path.
    Path(PathTask),
    /// Act out words.
    Prompt(PromptTask),
    /// Put a motion into words.
    Describe(DescribeTask),
}

impl Task {
    /// What a pack must be able to do for this.
    pub fn needs(&self) -> super::Capability {
        match self {
            Self::Keyframes(_) => super::Capability::Inbetween,
            Self::Path(_) => super::Capability::Path,
            Self::Prompt(_) => super::Capability::Text,
            Self::Describe(_) => super::Capability::Describe,
        }
    }
}

impl From<KeyframeTask> for Task {
    fn from(task: KeyframeTask) -> Self {
        Self::Keyframes(task)
    }
}

impl From<PathTask> for Task {
    fn from(task: PathTask) -> Self {
        Self::Path(task)
    }
}

impl From<PromptTask> for Task {
    fn from(task: PromptTask) -> Self {
        Self::Prompt(task)
    }
}

impl From<DescribeTask> for Task {
    fn from(task: DescribeTask) -> Self {
        Self::Describe(task)
    }
}

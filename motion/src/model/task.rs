//! The tasks of a generator, in the segment frame.

use std::sync::Arc;

use super::{Body, Dims, GLOBAL_ROOT, LOCAL_ROOT, RootOverride};
use crate::root::wrap_angle;

/// A keyframe as networks read it, in the segment frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeyTensors {
    /// Velocity x and z (m/s), angular velocity (rad/s), height (m).
    pub local_root: Option<[f32; LOCAL_ROOT]>,
    /// Position (m), cosine and sine of the heading.
    pub global_root: Option<[f32; GLOBAL_ROOT]>,
    /// Pose feature, `joints * 9`.
    pub pose: Option<Box<[f32]>>,
}

/// A path that pulls the root (root interpolation, paper section 6.1 and figure 14).
///
/// It acts between the root stage and the pose stage, on the frames after the context. A frame
/// moves from r_g3 towards the path by the ratios. Frames beyond the path's end move like its last
/// frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RootGuide {
    /// `[frames][x, y, z, heading]` from the segment's first frame on, metres and radians, in the
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
        // For the last frame on the path: offset in x, y and z, cosine and sine of the turn.
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
    /// Index of the segment's frame. A pose beyond the segment's end is ignored.
    pub frame: usize,
    /// Pose feature, `joints * 9`, in the segment frame.
    pub pose: Box<[f32]>,
}

/// Keyframes to meet, checked and in the segment frame.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyframeTask {
    /// The first frames of the segment: the pack's number of context keyframes.
    pub context: Vec<KeyTensors>,
    /// The last frames of the segment: one or more target keyframes.
    pub targets: Vec<KeyTensors>,
    /// Frames of the segment. `None`: the root stage chooses.
    pub frames: Option<usize>,
    /// Which token counts the root stage may choose, from the pack's minimum on; at least one.
    pub allowed_counts: Vec<bool>,
    /// Seed of all random choices.
    pub seed: u64,
    /// 0 for the most likely choice, above 0 to sample. It applies to the token count, the pose
    /// tokens, and the root trajectory if the pack has [`Dims::root_choices`].
    pub temperature: f32,
    /// Number of passes of the pose stage.
    pub pose_steps: u32,
    /// The path that pulls the root, if any.
    pub root_guide: Option<RootGuide>,
    /// Roots that the decoder gets instead of the predicted ones, if any. The pose stage does not
    /// see them.
    pub root_override: Option<RootOverride>,
    /// Poses between context and targets.
    pub gap_poses: Vec<GapPose>,
}

impl KeyframeTask {
    /// Frames of the segment, for a known token count.
    pub fn frames(&self, dims: &Dims, tokens: usize) -> usize {
        self.frames.unwrap_or(tokens * dims.frames_per_token)
    }

    /// The frame of each target keyframe in a segment of `frames` frames.
    pub fn target_frames(&self, frames: usize) -> impl Iterator<Item = usize> {
        frames - self.targets.len()..frames
    }
}

/// A path to follow, for a body of any skeleton, in the segment frame.
///
/// The answer has as many frames as the path. Its root is the network's own, and not pulled to path
/// or keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct PathTask {
    /// The body that moves.
    pub body: Arc<Body>,
    /// The first frames: none to begin anywhere, or the pack's number of context frames. A keyframe
    /// counts only with both a global root and a pose.
    pub context: Vec<KeyTensors>,
    /// The last frames, like the context: at most the pack's number of targets.
    pub targets: Vec<KeyTensors>,
    /// `[frames][x, z, heading]`, metres and radians. The roots of context and targets lie on it.
    /// The number of frames must be allowed for a segment of the pack: whole tokens.
    pub path: Box<[[f32; 3]]>,
    /// Whether the root may sway about the path as the body's clips do: not if the path is a root
    /// that sways already.
    pub sways: bool,
    /// A weight for each word of the pack; all zero without a style.
    pub style: Vec<f32>,
    /// Number of the sampler's steps, 1 to the pack's diffusion steps.
    pub steps: u32,
    /// 1 shows the style as it was trained; more exaggerates it.
    pub guidance: f32,
    /// Seed of all random choices.
    pub seed: u64,
}

/// How tokens are sampled. Missing values come from the pack.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SamplingTask {
    /// 0 for the most likely choice, above 0 to sample.
    pub temperature: Option<f32>,
    /// Number of the likeliest tokens to choose from; 0 for all.
    pub top_k: Option<u32>,
    /// The likeliest tokens to choose from have at least this probability together; 1 for all.
    pub top_p: Option<f32>,
    /// Divisor for the logits of recent tokens; 1 for none.
    pub repetition: Option<f32>,
}

impl SamplingTask {
    /// Sampling at this temperature, otherwise as the pack says.
    pub fn at(temperature: f32) -> Self {
        Self {
            temperature: Some(temperature),
            ..Self::default()
        }
    }
}

/// A kind of sound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sound {
    /// Music, to dance to.
    Music,
    /// Speech, to gesture to.
    Speech,
}

/// Audio as the codes of a pack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Audio {
    /// The kind of sound.
    pub sound: Sound,
    /// Codes of the pack's audio vocabulary.
    pub codes: Vec<u32>,
}

/// A further character of a task.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AgentTask {
    /// What the character does, in words.
    pub text: String,
    /// Frames before the motion, as many as those of the first character.
    pub context: Vec<KeyTensors>,
}

/// A text to make motion of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PromptTask {
    /// What the character does, in words. May be empty together with a context, targets or audio.
    pub text: String,
    /// Frames before the motion, oldest first, in the segment frame. Empty to begin anywhere.
    pub context: Vec<KeyTensors>,
    /// Frames after the motion, oldest first, in the segment frame. Empty to end anywhere. With
    /// targets, `frames` counts the frames between.
    pub targets: Vec<KeyTensors>,
    /// Sound that the motion goes with.
    pub audio: Option<Audio>,
    /// Further characters of the same motion.
    pub others: Vec<AgentTask>,
    /// Number of frames to make. `None`: the model chooses.
    pub frames: Option<usize>,
    /// Seed of all random choices.
    pub seed: u64,
    /// How tokens are chosen.
    pub sampling: SamplingTask,
    /// Whether frames are handed out while later ones are made. Otherwise all come together, for
    /// less work.
    pub in_parts: bool,
    /// Steps of the pack's flow decoder, whose frames are finer and come together. 0 for the plain
    /// decoder.
    pub flow_steps: u32,
}

/// The form in which a motion is described.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Telling {
    /// As a text.
    #[default]
    Words,
    /// As codes of sound that goes with it.
    Audio(Sound),
}

/// A motion to describe.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DescribeTask {
    /// The motion's frames, in the segment frame of its first root.
    pub frames: Vec<KeyTensors>,
    /// Frames of further characters, as many as those of the first.
    pub others: Vec<Vec<KeyTensors>>,
    /// The form of the description.
    pub into: Telling,
    /// Seed of all random choices.
    pub seed: u64,
    /// How tokens are chosen.
    pub sampling: SamplingTask,
}

/// What a job asks of a generator.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// Fill the gap between context and target keyframes.
    Keyframes(KeyframeTask),
    /// Follow a path.
    Path(PathTask),
    /// Make motion of a text.
    Prompt(PromptTask),
    /// Describe a motion.
    Describe(DescribeTask),
}

impl Task {
    /// How much work the task is for its pack, relative to other tasks: frames times passes of the
    /// networks. At least 1.
    pub fn work(&self) -> u32 {
        let (frames, passes) = match self {
            // Root stage and decoder run once each.
            Self::Keyframes(task) => (task.frames.unwrap_or(SOME_FRAMES), task.pose_steps.max(1) + 2),
            // With guidance each step runs without the style too.
            Self::Path(task) if task.guidance != 1.0 => (task.path.len(), 2 * task.steps),
            Self::Path(task) => (task.path.len(), task.steps),
            Self::Prompt(task) => {
                let frames = task.frames.unwrap_or(SOME_FRAMES);
                (frames * (1 + task.others.len()), 1 + task.flow_steps)
            }
            Self::Describe(task) => (task.frames.len() * (1 + task.others.len()), 1),
        };
        work_of(frames, passes)
    }

    /// The capability that a pack needs for this task.
    pub fn needs(&self) -> super::Capability {
        match self {
            Self::Keyframes(_) => super::Capability::Inbetween,
            Self::Path(_) => super::Capability::Path,
            Self::Prompt(_) => super::Capability::Text,
            Self::Describe(_) => super::Capability::Describe,
        }
    }
}

/// Assumed if the network chooses.
const SOME_FRAMES: usize = 64;

/// The [work](Task::work) of a task that is not known yet: one pass of each of three stages.
pub const USUAL_WORK: u32 = 3 * SOME_FRAMES as u32;

/// The [work](Task::work) of `passes` passes over `frames` frames.
pub fn work_of(frames: usize, passes: u32) -> u32 {
    u32::try_from(frames.max(1)).map_or(u32::MAX, |frames| frames.saturating_mul(passes.max(1)))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_frames_times_passes() {
        let keyframes = |pose_steps| KeyframeTask {
            context: Vec::new(),
            targets: Vec::new(),
            frames: Some(50),
            allowed_counts: Vec::new(),
            seed: 0,
            temperature: 0.0,
            pose_steps,
            root_guide: None,
            root_override: None,
            gap_poses: Vec::new(),
        };
        let [one, ten] = [1, 10].map(|steps| Task::from(keyframes(steps)).work());
        assert_eq!((one, ten), (150, 600));
        let prompt = |frames, flow_steps| PromptTask {
            frames,
            flow_steps,
            ..PromptTask::default()
        };
        assert_eq!(Task::from(prompt(Some(40), 0)).work(), 40);
        assert_eq!(Task::from(prompt(Some(40), 3)).work(), 160);
        assert_eq!(Task::from(prompt(None, 0)).work(), 64);
        let two = PromptTask {
            others: vec![AgentTask::default()],
            ..prompt(Some(40), 0)
        };
        assert_eq!(Task::from(two).work(), 80);
        assert_eq!(Task::from(DescribeTask::default()).work(), 1);
    }
}

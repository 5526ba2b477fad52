//! The sizes of a pack, and the tensors of its stages that follow from them.

use super::Stage;

/// Numbers of a pose feature a joint: position (3) and 6D rotation (6).
pub const POSE_FEATURES: usize = troupe_motion::features::FEATURES_PER_JOINT;
/// Numbers of a local root: velocity x and z, angular velocity, height.
pub const LOCAL_ROOT: usize = 4;
/// Numbers of a global root: position (3), cosine and sine of the heading.
pub const GLOBAL_ROOT: usize = 5;
/// Numbers of a 6D rotation.
pub const SIX_D: usize = 6;

/// Sizes of a pack. Everything else (tensor shapes, request limits) follows from these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dims {
    /// Joints of the skeleton.
    pub joints: usize,
    /// Contact joints.
    pub contacts: usize,
    /// Codebooks of a token.
    pub heads: usize,
    /// Codes of a codebook.
    pub codes: usize,
    /// Fewest tokens of a segment.
    pub min_tokens: usize,
    /// Most tokens of a segment.
    pub max_tokens: usize,
    /// Frames of one token.
    pub frames_per_token: usize,
    /// Context keyframes of a request, the first frames of the segment.
    pub context_frames: usize,
    /// Most target keyframes of a request.
    pub max_targets: usize,
}

/// Element type of a tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TensorType {
    /// 32-bit float.
    F32,
    /// 64-bit integer.
    I64,
}

/// One tensor of a stage; its first axis, the batch, is left out of `shape`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorSpec {
    /// Its name in the ONNX file.
    pub name: &'static str,
    /// Its element type.
    pub ty: TensorType,
    /// Its axes after the batch; time, where it is one of them, at its longest.
    pub shape: Vec<usize>,
    /// Whether the first axis of `shape` is time that a graph may leave open.
    pub open_time: bool,
}

impl TensorSpec {
    /// Elements of one batch row.
    pub fn row(&self) -> usize {
        self.shape.iter().product()
    }

    fn over_time(self) -> Self {
        Self {
            open_time: true,
            ..self
        }
    }
}

impl Dims {
    /// Fewest frames of a segment.
    pub fn min_frames(&self) -> usize {
        self.min_tokens * self.frames_per_token
    }

    /// Most frames of a segment, and the longest frame axis of a tensor.
    pub fn max_frames(&self) -> usize {
        self.max_tokens * self.frames_per_token
    }

    /// How many token counts there are to choose from.
    pub fn counts(&self) -> usize {
        self.max_tokens - self.min_tokens + 1
    }

    /// Keyframe slots of the root stage: the context frames, then the segment's last frames.
    pub fn slots(&self) -> usize {
        self.context_frames + self.max_targets
    }

    /// Numbers of one pose feature.
    pub fn pose(&self) -> usize {
        self.joints * POSE_FEATURES
    }

    /// Tokens that a segment of `frames` frames needs.
    pub fn tokens_for(&self, frames: usize) -> usize {
        frames.div_ceil(self.frames_per_token)
    }

    /// Input tensors of a stage, in the order in which the engine hands them over. Time is open where a graph takes any
    /// number N of tokens from the fewest to the most, and N times [`Self::frames_per_token`] frames.
    pub fn inputs(&self, stage: Stage) -> Vec<TensorSpec> {
        let (slots, counts, frames) = (self.slots(), self.counts(), self.max_frames());
        match stage {
            Stage::Root => vec![
                f32s("key_local_root", &[slots, LOCAL_ROOT]),
                f32s("key_global_root", &[slots, GLOBAL_ROOT]),
                f32s("key_pose", &[slots, self.pose()]),
                f32s("has_local_root", &[slots]),
                f32s("has_global_root", &[slots]),
                f32s("has_pose", &[slots]),
                f32s("allowed_counts", &[counts]),
                f32s("count_noise", &[counts]),
            ],
            Stage::Pose | Stage::Decoder => vec![
                i64s("tokens", &[self.max_tokens, self.heads]).over_time(),
                i64s("num_tokens", &[]),
                f32s("global_root", &[frames, GLOBAL_ROOT]).over_time(),
                f32s("frame_pose", &[frames, self.pose()]).over_time(),
                f32s("frame_mask", &[frames]).over_time(),
            ],
        }
    }

    /// Output tensors of a stage.
    pub fn outputs(&self, stage: Stage) -> Vec<TensorSpec> {
        let frames = self.max_frames();
        match stage {
            Stage::Root => vec![
                i64s("num_tokens", &[]),
                f32s("count_probs", &[self.counts()]),
                f32s("global_root", &[frames, GLOBAL_ROOT]),
            ],
            Stage::Pose => vec![f32s("logits", &[self.max_tokens, self.heads, self.codes])],
            Stage::Decoder => vec![
                f32s("rotations", &[frames, self.joints, SIX_D]),
                // An ONNX graph must not give an output the name of an input.
                f32s("refined_root", &[frames, GLOBAL_ROOT]),
                f32s("contacts", &[frames, self.contacts]),
            ],
        }
    }
}

fn f32s(name: &'static str, shape: &[usize]) -> TensorSpec {
    TensorSpec {
        name,
        ty: TensorType::F32,
        shape: shape.to_vec(),
        open_time: false,
    }
}

fn i64s(name: &'static str, shape: &[usize]) -> TensorSpec {
    TensorSpec {
        name,
        ty: TensorType::I64,
        shape: shape.to_vec(),
        open_time: false,
    }
}

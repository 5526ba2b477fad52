//! The tensors of the three stages, computed from a pack's sizes (docs/motionbricks-pack.md).

use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT, SIX_D};

use crate::pack::Stage;

/// Element type of a tensor in the ONNX files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TensorType {
    /// 32-bit float.
    F32,
    /// 64-bit integer.
    I64,
}

/// One tensor of a stage. `shape` leaves out the first axis, which is the batch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TensorSpec {
    /// The tensor's name in the ONNX file.
    pub name: &'static str,
    /// The type of one element.
    pub ty: TensorType,
    /// The axes after the batch. A time axis has its greatest length.
    pub shape: Vec<usize>,
    /// Whether the first axis of `shape` is time: a graph may leave its length open.
    pub open_time: bool,
}

impl TensorSpec {
    /// Elements of one row of a batch.
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

/// The tensors of the stages of a pack with these sizes.
pub trait StageTensors {
    /// Input tensors of a stage, in the order in which the engine passes them. Time is open if a
    /// graph takes any number N of tokens from the fewest to the most, and N times
    /// [`Dims::frames_per_token`] frames.
    fn inputs(&self, stage: Stage) -> Vec<TensorSpec>;

    /// Output tensors of a stage, in the order in which the engine reads them.
    fn outputs(&self, stage: Stage) -> Vec<TensorSpec>;
}

impl StageTensors for Dims {
    fn inputs(&self, stage: Stage) -> Vec<TensorSpec> {
        let (slots, counts, frames) = (self.slots(), self.counts(), self.max_frames());
        match stage {
            Stage::Root => {
                let mut inputs = vec![
                    f32s("key_local_root", &[slots, LOCAL_ROOT]),
                    f32s("key_global_root", &[slots, GLOBAL_ROOT]),
                    f32s("key_pose", &[slots, self.pose()]),
                    f32s("has_local_root", &[slots]),
                    f32s("has_global_root", &[slots]),
                    f32s("has_pose", &[slots]),
                    f32s("allowed_counts", &[counts]),
                    f32s("count_noise", &[counts]),
                ];
                if self.root_choices > 0 {
                    inputs.push(f32s("root_noise", &[self.root_choices]));
                }
                inputs
            }
            Stage::Pose | Stage::Decoder => vec![
                i64s("tokens", &[self.max_tokens, self.heads]).over_time(),
                i64s("num_tokens", &[]),
                f32s("global_root", &[frames, GLOBAL_ROOT]).over_time(),
                f32s("frame_pose", &[frames, self.pose()]).over_time(),
                f32s("frame_mask", &[frames]).over_time(),
            ],
        }
    }

    fn outputs(&self, stage: Stage) -> Vec<TensorSpec> {
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

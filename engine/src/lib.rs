//! Inference: the three stages of a pack behind the [`Stages`] trait, and the [`Pipeline`] that
//! takes a batch of characters through them. One thread owns a pipeline. Only OpenVINO's networks
//! are shared: see [`onnx::NetworkPool`].
//!
//! [`onnx::OnnxStages`] runs the stages on ONNX Runtime. Other engines (and tests) implement
//! [`Stages`].

pub mod accuracy;
mod checks;
mod choice;
#[cfg(any(test, feature = "testing"))]
pub mod families;
mod fill;
pub mod generator;
pub mod gpu;
pub mod machine;
mod made_up;
mod motionbricks;
pub mod onnx;
pub mod pack;
mod pipeline;
mod random;
mod raw;
mod sampling;
mod select;
mod sizes;
#[cfg_attr(
    not(any(test, feature = "testing")),
    allow(dead_code, unused_imports, reason = "some of it is for `families` alone")
)]
mod sonic_planner;
mod specs;
mod tensors;
#[cfg(any(test, feature = "testing"))]
pub mod toy;
mod trial;
#[cfg_attr(
    not(any(test, feature = "testing")),
    allow(dead_code, unused_imports, reason = "some of it is for `families` alone")
)]
mod unimogen;
#[cfg_attr(
    not(any(test, feature = "testing")),
    allow(dead_code, unused_imports, reason = "some of it is for `families` alone")
)]
mod vermo;

use crate::pack::{Family, Stage};

pub use checks::CheckCache;
pub use choice::{AccuracyCheck, EngineChoice, EngineKind, Workers};
pub use pipeline::{Pipeline, RowAnswer, StageTimes, TrialRun, length_of, lengths};
pub use raw::{RawLoop, straight_walk};
pub use select::{Check, Decision, Selector};
pub use sizes::BatchSizes;
pub use tensors::{DecoderOutput, PoseOutput, RootInput, RootOutput, Rows, TokenInput};
pub use trial::{NetworkLoop, Networks};

/// Runs the networks of one pack.
///
/// `rows` is the batch size of the call. The token axis of the pose stage and the decoder is
/// [`TokenInput::length`], one of [`lengths`]. Unless the engine takes [any
/// batch](Stages::any_batch), `rows` is one of [`BatchSizes`], so that it sees only a few shapes,
/// all of them during warm-up. Only the first `rows` rows of inputs and outputs count. Inputs have
/// memory for more, up to a multiple of 8, with values of other batches. A row's result must not
/// depend on the other rows.
pub trait Stages: Send {
    /// Whether batches of any size are as fast as those of the warm-up. Batches are then not
    /// padded, and warm-up is short.
    fn any_batch(&self) -> bool {
        false
    }

    /// Whether the engine opens further shapes in the background when they are needed. Warm-up then
    /// uses only the smallest batch.
    fn opens_on_demand(&self) -> bool {
        false
    }

    /// Whether the pose stage and the decoder accept calls shorter than the pack's longest segment.
    fn any_length(&self) -> bool {
        true
    }

    /// Computes token count and root trajectory from constraints.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails; the whole batch fails with it.
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError>;

    /// Computes the logits of every pose token.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails; the whole batch fails with it.
    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError>;

    /// Computes frames from tokens.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails; the whole batch fails with it.
    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError>;
}

/// Why inference failed.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// The ONNX Runtime library is missing or unusable.
    #[error("ONNX Runtime: {0}. Run `make runtime` to fetch it, or set ORT_DYLIB_PATH to libonnxruntime")]
    Library(String),
    /// The configuration names an engine that cannot serve.
    #[error("the engine {engine} cannot serve: {reason}")]
    Unusable {
        /// Name of the engine.
        engine: EngineKind,
        /// Why it cannot serve.
        reason: String,
    },
    /// This engine has no generator for the pack's family.
    #[error("the family {family:?} is unknown; allowed: {}", Family::ALL.map(Family::name).join(", "))]
    UnknownFamily {
        /// The family in the manifest.
        family: String,
    },
    /// A network does not load.
    #[error("cannot load {file}: {reason}")]
    Load {
        /// Name of its file.
        file: &'static str,
        /// The runtime's message.
        reason: String,
    },
    /// A network whose tensors differ from the contract.
    #[error("{file}: {problem}")]
    Signature {
        /// Name of its file.
        file: &'static str,
        /// Which tensor differs, what it is and what it must be.
        problem: String,
    },
    /// A stage failed.
    #[error("the {} stage failed: {reason}", stage.name())]
    Run {
        /// The stage at fault.
        stage: Stage,
        /// The runtime's message.
        reason: String,
    },
    /// A stage gave values out of the contract.
    #[error("the {} stage gave {problem}", stage.name())]
    Output {
        /// The stage at fault.
        stage: Stage,
        /// What is wrong with its output.
        problem: String,
    },
    /// A network of a family without stages failed, or gave values out of the contract.
    #[error("{file}: {problem}")]
    Network {
        /// Name of its file.
        file: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// A task is out of the pack's ranges.
    #[error("the task's {field} is {found}; allowed: {allowed}")]
    Task {
        /// The field at fault.
        field: &'static str,
        /// The value that it has.
        found: String,
        /// The values that are allowed.
        allowed: String,
    },
    /// The pack has no networks for a task of this kind.
    #[error("the pack has no networks for such a task")]
    WrongTask,
    /// The engine panicked, which is a defect. It still takes the next batch.
    #[error("the engine panicked: {0}")]
    Panicked(String),
    /// The thread that owns the engine has ended.
    #[error("the engine has stopped")]
    Stopped,
}

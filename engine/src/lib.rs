//! Inference: the three stages of a pack behind the [`Stages`] trait, and the [`Pipeline`] that
//! takes a batch of characters through them. One thread owns a pipeline. Only networks of OpenVINO
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
pub mod machine;
mod motionbricks;
pub mod onnx;
pub mod pack;
mod pipeline;
mod random;
mod raw;
mod sampling;
mod select;
mod sizes;
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
/// `rows` is the batch size of the call, and the token axis of the pose stage and the decoder is
/// [`TokenInput::length`], one of [`lengths`]. Unless it takes [any batch](Stages::any_batch),
/// `rows` is one of [`BatchSizes`]: an engine sees few different shapes, all of them during
/// warm-up. Only the first `rows` rows of inputs and outputs count; inputs have room for more, up
/// to a multiple of 8, which hold values of other batches. A row's result must not depend on the
/// other rows.
pub trait Stages: Send {
    /// Whether a batch of any size is as fast as those of the warm-up. Then batches are not padded,
    /// and warm-up is short.
    fn any_batch(&self) -> bool {
        false
    }

    /// Whether the engine opens more shapes in the background as they are asked for. Then warm-up
    /// meets the smallest batch alone.
    fn opens_on_demand(&self) -> bool {
        false
    }

    /// Whether the pose stage and the decoder take calls that are shorter than the pack's longest
    /// segment.
    fn any_length(&self) -> bool {
        true
    }

    /// Token count and root trajectory from constraints.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails; the whole batch fails with it.
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError>;

    /// Logits of every pose token.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails; the whole batch fails with it.
    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError>;

    /// Frames from tokens.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails; the whole batch fails with it.
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
    /// An engine that was asked for by name and does not serve.
    #[error("the engine {engine} cannot serve: {reason}")]
    Unusable {
        /// The engine.
        engine: EngineKind,
        /// Why not.
        reason: String,
    },
    /// A pack of a family that this engine has no generator for.
    #[error("the family {family:?} is unknown; allowed: {}", Family::ALL.map(Family::name).join(", "))]
    UnknownFamily {
        /// What the manifest names.
        family: String,
    },
    /// A stage that does not load.
    #[error("cannot load {file}: {reason}")]
    Load {
        /// The stage's file.
        file: &'static str,
        /// What the runtime says.
        reason: String,
    },
    /// A stage whose tensors differ from the contract.
    #[error("{file}: {problem}")]
    Signature {
        /// The stage's file.
        file: &'static str,
        /// Which tensor, what it is and what it must be.
        problem: String,
    },
    /// A run that failed.
    #[error("the {} stage failed: {reason}", stage.name())]
    Run {
        /// The stage.
        stage: Stage,
        /// What the runtime says.
        reason: String,
    },
    /// A run that gave values out of the contract.
    #[error("the {} stage gave {problem}", stage.name())]
    Output {
        /// The stage.
        stage: Stage,
        /// What is wrong with its output.
        problem: String,
    },
    /// A network of a family without stages that failed, or gave values out of the contract.
    #[error("{file}: {problem}")]
    Network {
        /// The network's file.
        file: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// A task out of the pack's ranges.
    #[error("the task's {field} is {found}; allowed: {allowed}")]
    Task {
        /// The task's field.
        field: &'static str,
        /// What it holds.
        found: String,
        /// What it may hold.
        allowed: String,
    },
    /// A task of a kind that the pack has no networks for.
    #[error("the pack has no networks for such a task")]
    WrongTask,
    /// A run that panicked: a defect of the engine. It takes the next batch all the same.
    #[error("the engine panicked: {0}")]
    Panicked(String),
    /// The thread that owns the engine has ended.
    #[error("the engine has stopped")]
    Stopped,
}

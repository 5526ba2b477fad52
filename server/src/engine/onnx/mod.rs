//! The stages on ONNX Runtime, loaded at run time from the library that `ORT_DYLIB_PATH` names.

mod runtime;
mod session;
mod signature;

use ort::session::{Session, SessionOutputs};
use ort::value::{PrimitiveTensorElementType, TensorRef};

use super::{
    DecoderOutput, EngineError, EngineKind, PoseOutput, RootInput, RootOutput, Rows, Stages, TokenInput,
};
use crate::pack::{Dims, GLOBAL_ROOT, LOCAL_ROOT, Pack, Stage};

pub use runtime::{LIBRARY_VARIABLE, Runtime};
pub use session::SessionOptions;
use signature::{check_signature, takes_any_length};

/// The three sessions of a pack, for one lane.
pub struct OnnxStages {
    engine: EngineKind,
    dims: Dims,
    any_length: bool,
    root: Session,
    pose: Session,
    decoder: Session,
}

impl OnnxStages {
    /// Loads the stages of `pack` for one lane, and checks their tensors against the pack's sizes.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`], which name the file.
    pub fn load(runtime: &Runtime, pack: &Pack, options: SessionOptions) -> Result<Self, EngineError> {
        let session = |stage: Stage| {
            let session = session::open(runtime, options, &pack.stage_file(stage)).map_err(|reason| {
                EngineError::Load {
                    file: stage.file_name(),
                    reason,
                }
            })?;
            check_signature(&pack.dims, stage, session.inputs(), session.outputs()).map_err(|problem| {
                EngineError::Signature {
                    file: stage.file_name(),
                    problem,
                }
            })?;
            Ok(session)
        };
        let (root, pose, decoder) = (
            session(Stage::Root)?,
            session(Stage::Pose)?,
            session(Stage::Decoder)?,
        );
        let any_length = [(Stage::Pose, &pose), (Stage::Decoder, &decoder)]
            .into_iter()
            .all(|(stage, session)| takes_any_length(&pack.dims, stage, session.inputs()));
        Ok(Self {
            engine: options.engine,
            dims: pack.dims,
            any_length,
            root,
            pose,
            decoder,
        })
    }
}

impl Stages for OnnxStages {
    fn any_batch(&self) -> bool {
        self.engine.takes_any_batch()
    }

    /// True where the graphs leave their time axis open. Packs of format 1 may fix it at the longest segment.
    fn any_length(&self) -> bool {
        self.any_length
    }

    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        let failed = |error: ort::Error| run_error(Stage::Root, &error);
        let (slots, counts) = (self.dims.slots(), self.dims.counts());
        let outputs = self
            .root
            .run(ort::inputs! {
                "key_local_root" => view(rows, &[slots, LOCAL_ROOT], &input.key_local_root).map_err(failed)?,
                "key_global_root" => view(rows, &[slots, GLOBAL_ROOT], &input.key_global_root).map_err(failed)?,
                "key_pose" => view(rows, &[slots, self.dims.pose()], &input.key_pose).map_err(failed)?,
                "has_local_root" => view(rows, &[slots], &input.has_local_root).map_err(failed)?,
                "has_global_root" => view(rows, &[slots], &input.has_global_root).map_err(failed)?,
                "has_pose" => view(rows, &[slots], &input.has_pose).map_err(failed)?,
                "allowed_counts" => view(rows, &[counts], &input.allowed_counts).map_err(failed)?,
                "count_noise" => view(rows, &[counts], &input.count_noise).map_err(failed)?,
            })
            .map_err(failed)?;
        copy_out(
            Stage::Root,
            &outputs,
            "num_tokens",
            output.num_tokens.first_mut(rows),
        )?;
        copy_out(
            Stage::Root,
            &outputs,
            "count_probs",
            output.count_probs.first_mut(rows),
        )?;
        copy_out(
            Stage::Root,
            &outputs,
            "global_root",
            output.global_root.first_mut(rows),
        )
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        let outputs = run_tokens(&self.dims, Stage::Pose, &mut self.pose, rows, input)?;
        copy_out(Stage::Pose, &outputs, "logits", output.logits.first_mut(rows))
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        let outputs = run_tokens(&self.dims, Stage::Decoder, &mut self.decoder, rows, input)?;
        copy_out(
            Stage::Decoder,
            &outputs,
            "rotations",
            output.rotations.first_mut(rows),
        )?;
        copy_out(
            Stage::Decoder,
            &outputs,
            "refined_root",
            output.global_root.first_mut(rows),
        )?;
        copy_out(
            Stage::Decoder,
            &outputs,
            "contacts",
            output.contacts.first_mut(rows),
        )
    }
}

/// Runs the pose stage or the decoder: both read the same tensors.
fn run_tokens<'s>(
    dims: &Dims,
    stage: Stage,
    session: &'s mut Session,
    rows: usize,
    input: &TokenInput,
) -> Result<SessionOutputs<'s>, EngineError> {
    let failed = |error: ort::Error| run_error(stage, &error);
    let tokens = input.length();
    let frames = tokens * dims.frames_per_token;
    session
        .run(ort::inputs! {
            "tokens" => view(rows, &[tokens, dims.heads], &input.tokens).map_err(failed)?,
            "num_tokens" => view(rows, &[], &input.num_tokens).map_err(failed)?,
            "global_root" => view(rows, &[frames, GLOBAL_ROOT], &input.global_root).map_err(failed)?,
            "frame_pose" => view(rows, &[frames, dims.pose()], &input.frame_pose).map_err(failed)?,
            "frame_mask" => view(rows, &[frames], &input.frame_mask).map_err(failed)?,
        })
        .map_err(failed)
}

/// The first `rows` rows as a tensor that borrows them.
fn view<'a, T>(rows: usize, shape: &[usize], data: &'a Rows<T>) -> ort::Result<TensorRef<'a, T>>
where
    T: PrimitiveTensorElementType + std::fmt::Debug + Copy + Default + 'static,
{
    let full: Vec<usize> = std::iter::once(rows).chain(shape.iter().copied()).collect();
    TensorRef::from_array_view((full, data.first(rows)))
}

fn copy_out<T: PrimitiveTensorElementType + Copy>(
    stage: Stage,
    outputs: &SessionOutputs<'_>,
    name: &str,
    into: &mut [T],
) -> Result<(), EngineError> {
    let problem = |problem: String| EngineError::Output { stage, problem };
    let value = outputs.get(name).ok_or_else(|| problem(format!("no {name}")))?;
    let (shape, data) = value
        .try_extract_tensor::<T>()
        .map_err(|error| run_error(stage, &error))?;
    if data.len() != into.len() {
        return Err(problem(format!(
            "{name} of shape {shape:?}, expected {} elements",
            into.len()
        )));
    }
    into.copy_from_slice(data);
    Ok(())
}

fn run_error(stage: Stage, error: &ort::Error) -> EngineError {
    EngineError::Run {
        stage,
        reason: one_line(error),
    }
}

/// What the runtime says, without its line breaks.
fn one_line(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

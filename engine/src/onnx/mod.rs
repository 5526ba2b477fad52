//! The stages on ONNX Runtime, loaded at run time from the library that `ORT_DYLIB_PATH` names.

mod calls;
mod network;
mod runtime;
mod session;
mod signature;

use std::ops::Range;

use ort::session::SessionOutputs;
use ort::value::{PrimitiveTensorElementType, TensorRef};
use serde::Serialize;
use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT};

use super::{
    DecoderOutput, EngineError, EngineKind, PoseOutput, RootInput, RootOutput, Rows, Stages, TokenInput,
    lengths,
};
use crate::pack::{Pack, Stage};

use calls::CALL_ROWS;
use network::{FixedNetworks, Network};
pub use runtime::{LIBRARY_VARIABLE, Runtime};
pub use session::SessionOptions;
use signature::{check_signature, takes_any_length};

/// Most bytes of files that a lane's networks of fixed shapes may be made of: each is made of that of its stage, and the more
/// there are the longer the server takes to start.
const MOST_FIXED_BYTES: u64 = 256 << 20;
/// Memory that an open network of a fixed shape takes, in multiples of its file of 16-bit weights: 11.8 measured with OpenVINO
/// 2025.4 and the default pack. ONNX Runtime, OpenVINO and its kernels hold the weights four times, in 32 bits; the rest is
/// the graph and the kernels themselves.
const MEMORY_OF_FILE: u64 = 12;

/// How an engine takes batches of a pack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Batching {
    /// Whether a batch of any size is as fast as one that was met before. Else batches are padded to few sizes.
    pub any_size: bool,
    /// The most characters that a batch usually has.
    pub usual_most: usize,
    /// The most characters of one call, where batches are cut into calls; else 0.
    pub call_rows: usize,
}

impl Batching {
    /// Of an engine that nothing is known of.
    pub const UNKNOWN: Self = Self {
        any_size: false,
        usual_most: 32,
        call_rows: 0,
    };

    /// ONNX Runtime's own CPU kernels are made for all shapes; with OpenVINO there are networks for calls of up to 8, where
    /// it has `fixed_shapes`; GPUs make kernels for each shape.
    pub fn of(engine: EngineKind, fixed_shapes: bool) -> Self {
        match engine {
            EngineKind::Cpu => Self {
                any_size: true,
                ..Self::UNKNOWN
            },
            EngineKind::OpenvinoBf16 if fixed_shapes => Self {
                any_size: true,
                usual_most: 16,
                call_rows: CALL_ROWS[CALL_ROWS.len() - 1],
            },
            EngineKind::OpenvinoBf16 | EngineKind::Cuda | EngineKind::Tensorrt => Self::UNKNOWN,
        }
    }
}

/// Why there are no networks of fixed shapes for every size of a call, and behind the root stage for every length, on `lanes`
/// lanes with `memory_bytes` of memory between them. None where they fit.
pub fn no_fixed_shapes(pack: &Pack, lanes: usize, memory_bytes: u64) -> Option<&'static str> {
    misfit(fixed_file_bytes(pack), lanes, memory_bytes)
}

fn misfit(file_bytes: u64, lanes: usize, memory_bytes: u64) -> Option<&'static str> {
    if file_bytes > MOST_FIXED_BYTES {
        return Some("the pack is too large for one of each");
    }
    (file_bytes * MEMORY_OF_FILE * lanes as u64 > memory_bytes)
        .then_some("there is no memory for one of each")
}

/// Bytes of the files that a lane's networks of fixed shapes are made of.
fn fixed_file_bytes(pack: &Pack) -> u64 {
    let lengths = lengths(&pack.rig.dims, true).len() as u64;
    let bytes = Stage::ALL.into_iter().map(|stage| {
        let file = std::fs::metadata(pack.stage_file(stage)).map_or(0, |file| file.len());
        file * CALL_ROWS.len() as u64 * if stage == Stage::Root { 1 } else { lengths }
    });
    bytes.sum()
}

/// The three stages of a pack, for one lane.
pub struct OnnxStages {
    engine: EngineKind,
    dims: Dims,
    any_length: bool,
    root: Network,
    pose: Network,
    decoder: Network,
}

impl OnnxStages {
    /// Loads the stages of `pack` for one lane, and checks their tensors against the pack's sizes.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`], which name the file.
    pub fn load(runtime: &Runtime, pack: &Pack, options: SessionOptions) -> Result<Self, EngineError> {
        let network = |stage| load_network(runtime, pack, options, stage);
        let (root, _) = network(Stage::Root)?;
        let (pose, pose_any_length) = network(Stage::Pose)?;
        let (decoder, decoder_any_length) = network(Stage::Decoder)?;
        Ok(Self {
            engine: options.engine,
            dims: pack.rig.dims,
            any_length: pose_any_length && decoder_any_length,
            root,
            pose,
            decoder,
        })
    }

    fn has_fixed_shapes(&self) -> bool {
        let networks = [&self.root, &self.pose, &self.decoder];
        networks
            .iter()
            .all(|network| matches!(network, Network::Fixed(_)))
    }
}

/// A stage's networks, and whether it takes segments of any length.
fn load_network(
    runtime: &Runtime,
    pack: &Pack,
    options: SessionOptions,
    stage: Stage,
) -> Result<(Network, bool), EngineError> {
    let file = pack.stage_file(stage);
    let open = |options: SessionOptions| {
        session::open(runtime, options, &file, &[]).map_err(|reason| EngineError::Load {
            file: stage.file_name(),
            reason,
        })
    };
    // OpenVINO makes kernels as it opens a graph; what the graph looks like the CPU's own provider tells sooner.
    let looks = match options.engine {
        EngineKind::OpenvinoBf16 => SessionOptions {
            engine: EngineKind::Cpu,
            ..options
        },
        _ => options,
    };
    let session = open(looks)?;
    check_signature(&pack.rig.dims, stage, session.inputs(), session.outputs()).map_err(|problem| {
        EngineError::Signature {
            file: stage.file_name(),
            problem,
        }
    })?;
    let any_length = takes_any_length(&pack.rig.dims, stage, session.inputs());
    if options.engine != EngineKind::OpenvinoBf16 {
        return Ok((Network::Open(session), any_length));
    }
    let fixed = options
        .fixed_shapes
        .then(|| FixedNetworks::new(runtime, options, file.clone(), stage, pack.rig.dims, &session))
        .flatten();
    let network = match fixed {
        Some(networks) => Network::Fixed(Box::new(networks)),
        None => Network::Open(open(options)?),
    };
    Ok((network, any_length))
}

impl Stages for OnnxStages {
    /// False with OpenVINO for graphs that are large or do not name their open axes.
    fn any_batch(&self) -> bool {
        self.engine == EngineKind::Cpu || self.has_fixed_shapes()
    }

    fn call_rows(&self) -> &[usize] {
        match self.has_fixed_shapes() {
            true => &CALL_ROWS,
            false => &[],
        }
    }

    /// True where the graphs leave their time axis open. Packs of format 1 may fix it at the longest segment.
    fn any_length(&self) -> bool {
        self.any_length
    }

    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        let (slots, counts, pose) = (self.dims.slots(), self.dims.counts(), self.dims.pose());
        let inputs = |call: Range<usize>| {
            Ok(ort::inputs! {
                "key_local_root" => view(&call, &[slots, LOCAL_ROOT], &input.key_local_root)?,
                "key_global_root" => view(&call, &[slots, GLOBAL_ROOT], &input.key_global_root)?,
                "key_pose" => view(&call, &[slots, pose], &input.key_pose)?,
                "has_local_root" => view(&call, &[slots], &input.has_local_root)?,
                "has_global_root" => view(&call, &[slots], &input.has_global_root)?,
                "has_pose" => view(&call, &[slots], &input.has_pose)?,
                "allowed_counts" => view(&call, &[counts], &input.allowed_counts)?,
                "count_noise" => view(&call, &[counts], &input.count_noise)?,
            })
        };
        let length = self.dims.max_tokens;
        self.root.run(Stage::Root, rows, length, inputs, |call, outputs| {
            let from = Outputs::new(Stage::Root, outputs, call, rows);
            from.copy("num_tokens", &mut output.num_tokens)?;
            from.copy("count_probs", &mut output.count_probs)?;
            from.copy("global_root", &mut output.global_root)
        })
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        let inputs = |call| token_inputs(&self.dims, input, &call);
        self.pose
            .run(Stage::Pose, rows, input.length(), inputs, |call, outputs| {
                Outputs::new(Stage::Pose, outputs, call, rows).copy("logits", &mut output.logits)
            })
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        let inputs = |call| token_inputs(&self.dims, input, &call);
        self.decoder
            .run(Stage::Decoder, rows, input.length(), inputs, |call, outputs| {
                let from = Outputs::new(Stage::Decoder, outputs, call, rows);
                from.copy("rotations", &mut output.rotations)?;
                from.copy("refined_root", &mut output.global_root)?;
                from.copy("contacts", &mut output.contacts)
            })
    }
}

/// What the pose stage and the decoder read: both the same tensors.
fn token_inputs<'a>(
    dims: &Dims,
    input: &'a TokenInput,
    call: &Range<usize>,
) -> ort::Result<network::Inputs<'a>> {
    let tokens = input.length();
    let frames = tokens * dims.frames_per_token;
    Ok(ort::inputs! {
        "tokens" => view(call, &[tokens, dims.heads], &input.tokens)?,
        "num_tokens" => view(call, &[], &input.num_tokens)?,
        "global_root" => view(call, &[frames, GLOBAL_ROOT], &input.global_root)?,
        "frame_pose" => view(call, &[frames, dims.pose()], &input.frame_pose)?,
        "frame_mask" => view(call, &[frames], &input.frame_mask)?,
    })
}

/// The rows of a call as a tensor that borrows them.
fn view<'a, T>(call: &Range<usize>, shape: &[usize], data: &'a Rows<T>) -> ort::Result<TensorRef<'a, T>>
where
    T: PrimitiveTensorElementType + std::fmt::Debug + Copy + Default + 'static,
{
    let full: Vec<usize> = std::iter::once(call.len()).chain(shape.iter().copied()).collect();
    TensorRef::from_array_view((full, data.range(call.clone())))
}

/// What a call gave.
struct Outputs<'a, 's> {
    stage: Stage,
    outputs: &'a SessionOutputs<'s>,
    /// Its rows, padding included.
    call: Range<usize>,
    /// Its rows without padding.
    wanted: Range<usize>,
}

impl<'a, 's> Outputs<'a, 's> {
    /// Of a call for a batch of `rows` rows.
    fn new(stage: Stage, outputs: &'a SessionOutputs<'s>, call: Range<usize>, rows: usize) -> Self {
        Self {
            stage,
            outputs,
            wanted: call.start..call.end.min(rows),
            call,
        }
    }

    fn copy<T>(&self, name: &str, into: &mut Rows<T>) -> Result<(), EngineError>
    where
        T: PrimitiveTensorElementType + Copy + Default,
    {
        let stage = self.stage;
        let problem = |problem: String| EngineError::Output { stage, problem };
        let value = self
            .outputs
            .get(name)
            .ok_or_else(|| problem(format!("no {name}")))?;
        let (shape, data) = value
            .try_extract_tensor::<T>()
            .map_err(|error| run_error(stage, &error))?;
        let expected = self.call.len() * into.width();
        if data.len() != expected {
            return Err(problem(format!(
                "{name} of shape {shape:?}, expected {expected} elements"
            )));
        }
        let into = into.range_mut(self.wanted.clone());
        into.copy_from_slice(&data[..into.len()]);
        Ok(())
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_of_fixed_shapes_must_fit_into_the_memory() {
        let misfit = |file_mib: u64, lanes, memory_gib: u64| misfit(file_mib << 20, lanes, memory_gib << 30);
        assert_eq!(misfit(64, 1, 1), None);
        assert_eq!(misfit(64, 8, 6), None);
        assert_eq!(misfit(64, 2, 1), Some("there is no memory for one of each"));
        assert_eq!(misfit(64, 8, 5), Some("there is no memory for one of each"));
        assert_eq!(misfit(256, 1, 3), None);
        assert_eq!(
            misfit(257, 1, 1024),
            Some("the pack is too large for one of each")
        );
    }
}

//! Networks on ONNX Runtime, loaded at run time from the library that `ORT_DYLIB_PATH` names.

mod calls;
mod denoiser;
mod exit;
mod network;
mod openvino;
mod outlets;
mod planner;
mod pool;
mod provider;
mod runtime;
mod session;
mod signature;
pub(crate) mod vermo;
mod weights;

use std::ops::Range;

use serde::Serialize;
use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT};

use super::{
    DecoderOutput, EngineError, EngineKind, PoseOutput, RootInput, RootOutput, Rows, Stages, TokenInput,
};
use crate::pack::{Pack, Stage};
use crate::vermo::SLOTS;

use calls::CALL_ROWS;
pub use denoiser::OnnxDenoiser;
use network::{FixedNetworks, Given, Inputs, Network, Number};
pub use planner::OnnxPlanner;
pub use pool::NetworkPool;
use pool::PackWorker;
pub use runtime::{LIBRARY_VARIABLE, Runtime};
pub use session::{Growth, SessionOptions};
use signature::{check_signature, takes_any_length};

/// The batches that suit an engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Batching {
    /// Whether a batch of any size is as fast as one of a known size. Otherwise batches are padded
    /// to a few sizes.
    pub any_size: bool,
    /// The usual largest number of characters in a batch.
    pub usual_most: usize,
    /// Most characters of one call if batches are split into calls, otherwise 0.
    pub call_rows: usize,
}

impl Batching {
    /// The batches of an unknown engine.
    pub const UNKNOWN: Self = Self {
        any_size: false,
        usual_most: 32,
        call_rows: 0,
    };

    /// ONNX Runtime's own CPU kernels work for all shapes. With `fixed_shapes`, OpenVINO has
    /// networks for calls of up to 8. GPUs make kernels for each shape.
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

    /// For a VerMo pack: jobs join and leave between tokens.
    pub(crate) fn of_vermo() -> Self {
        Self {
            any_size: true,
            usual_most: SLOTS,
            call_rows: 0,
        }
    }

    /// For a pack of NVIDIA's planner: a call is one job, and more would only wait at the worker.
    pub(crate) fn of_sonic_planner() -> Self {
        Self {
            any_size: true,
            usual_most: 1,
            call_rows: 0,
        }
    }

    /// For a UniMoGen pack: its jobs have different shapes.
    pub(crate) fn of_unimogen(engine: EngineKind) -> Self {
        Self {
            any_size: true,
            usual_most: match engine {
                EngineKind::Cpu | EngineKind::OpenvinoBf16 => UNIMOGEN_JOBS,
                EngineKind::Cuda | EngineKind::Tensorrt => Self::UNKNOWN.usual_most,
            },
            call_rows: 0,
        }
    }
}

/// Jobs that a UniMoGen pack takes on a CPU. A step is a call for one job, so more jobs would only
/// wait at the worker.
const UNIMOGEN_JOBS: usize = 4;

/// Why a pack has no networks of fixed shapes. None if it has them: they can be made, and the
/// indispensable ones fit into `memory_bytes`.
pub fn no_fixed_shapes(runtime: &Runtime, pack: &Pack, memory_bytes: u64) -> Option<String> {
    if let Err(reason) = runtime.openvino() {
        return Some(reason);
    }
    let least = pool::least_bytes(pack);
    (least > memory_bytes).then(|| {
        let mib = |bytes: u64| bytes.div_ceil(1 << 20);
        format!(
            "those of fixed shapes take {} MiB at least, and its part of network_memory_mib is {}",
            mib(least),
            memory_bytes >> 20
        )
    })
}

/// The three stages of a pack, for one worker.
pub struct OnnxStages {
    engine: EngineKind,
    dims: Dims,
    any_length: bool,
    root: Network,
    pose: Network,
    decoder: Network,
    /// Counts the workers of networks of fixed shapes.
    _worker: Option<PackWorker>,
}

impl OnnxStages {
    /// Loads the stages of `pack` for one worker, and checks their tensors against the pack's
    /// sizes. Networks of fixed shapes come from `pool`.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`], with the file.
    pub fn load(
        runtime: &Runtime,
        pack: &Pack,
        options: SessionOptions,
        pool: &NetworkPool,
    ) -> Result<Self, EngineError> {
        let stages = |any_length, [root, pose, decoder]: [Network; 3], worker| Self {
            engine: options.engine,
            dims: pack.rig.dims,
            any_length,
            root,
            pose,
            decoder,
            _worker: worker,
        };
        if options.engine == EngineKind::OpenvinoBf16 && options.fixed_shapes {
            let networks = pool.pack(runtime, pack, options.threads, || {
                let any = [Stage::Root, Stage::Pose, Stage::Decoder].map(|stage| look(runtime, pack, stage));
                let [root, pose, decoder] = any;
                Ok(root? && pose? && decoder?)
            })?;
            let any_length = networks.any_length;
            let worker = PackWorker::new(networks);
            let network = |stage| {
                Network::Fixed(FixedNetworks {
                    pool: pool.clone(),
                    graph: worker.graph(stage).clone(),
                    growth: options.growth,
                })
            };
            let networks = [
                network(Stage::Root),
                network(Stage::Pose),
                network(Stage::Decoder),
            ];
            return Ok(stages(any_length, networks, Some(worker)));
        }
        let network = |stage: Stage| {
            // OpenVINO makes kernels when it opens a graph. The CPU's own provider shows sooner
            // what the graph looks like.
            let looked = match options.engine {
                EngineKind::OpenvinoBf16 => Some(look(runtime, pack, stage)?),
                _ => None,
            };
            let session = open(runtime, pack, stage, options)?;
            match looked {
                Some(any_length) => Ok((Network::Open(session), any_length)),
                None => {
                    let any_length = looks(pack, stage, &session)?;
                    Ok((Network::Open(session), any_length))
                }
            }
        };
        let (root, _) = network(Stage::Root)?;
        let (pose, pose_any_length) = network(Stage::Pose)?;
        let (decoder, decoder_any_length) = network(Stage::Decoder)?;
        Ok(stages(
            pose_any_length && decoder_any_length,
            [root, pose, decoder],
            None,
        ))
    }

    fn has_fixed_shapes(&self) -> bool {
        matches!(self.root, Network::Fixed(_))
    }
}

fn open(
    runtime: &Runtime,
    pack: &Pack,
    stage: Stage,
    options: SessionOptions,
) -> Result<ort::session::Session, EngineError> {
    session::open(runtime, options, &pack.stage_file(stage), None).map_err(|reason| unloaded(stage, reason))
}

fn unloaded(stage: Stage, reason: String) -> EngineError {
    EngineError::Load {
        file: stage.file_name(),
        reason,
    }
}

/// Checks a stage's tensors without preparing it to run. Answers whether it accepts segments of any
/// length.
fn look(runtime: &Runtime, pack: &Pack, stage: Stage) -> Result<bool, EngineError> {
    let session =
        session::look(runtime, &pack.stage_file(stage)).map_err(|reason| unloaded(stage, reason))?;
    looks(pack, stage, &session)
}

fn looks(pack: &Pack, stage: Stage, session: &ort::session::Session) -> Result<bool, EngineError> {
    check_signature(&pack.rig.dims, stage, session.inputs(), session.outputs()).map_err(|problem| {
        EngineError::Signature {
            file: stage.file_name(),
            problem,
        }
    })?;
    Ok(takes_any_length(&pack.rig.dims, stage, session.inputs()))
}

impl Stages for OnnxStages {
    /// False for large graphs with OpenVINO.
    fn any_batch(&self) -> bool {
        self.engine == EngineKind::Cpu || self.has_fixed_shapes()
    }

    fn opens_on_demand(&self) -> bool {
        self.has_fixed_shapes()
    }

    /// True if the graphs leave their time axis open. Packs of format 1 may fix it at the longest
    /// segment.
    fn any_length(&self) -> bool {
        self.any_length
    }

    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        let (slots, counts, pose) = (self.dims.slots(), self.dims.counts(), self.dims.pose());
        let choices = self.dims.root_choices;
        let inputs = |call: Range<usize>| {
            let mut inputs = vec![
                view(
                    "key_local_root",
                    &call,
                    &[slots, LOCAL_ROOT],
                    &input.key_local_root,
                ),
                view(
                    "key_global_root",
                    &call,
                    &[slots, GLOBAL_ROOT],
                    &input.key_global_root,
                ),
                view("key_pose", &call, &[slots, pose], &input.key_pose),
                view("has_local_root", &call, &[slots], &input.has_local_root),
                view("has_global_root", &call, &[slots], &input.has_global_root),
                view("has_pose", &call, &[slots], &input.has_pose),
                view("allowed_counts", &call, &[counts], &input.allowed_counts),
                view("count_noise", &call, &[counts], &input.count_noise),
            ];
            if choices > 0 {
                inputs.push(view("root_noise", &call, &[choices], &input.root_noise));
            }
            inputs
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

/// The inputs of the pose stage and the decoder, which read the same tensors.
fn token_inputs<'a>(dims: &Dims, input: &'a TokenInput, call: &Range<usize>) -> Inputs<'a> {
    let tokens = input.length();
    let frames = tokens * dims.frames_per_token;
    vec![
        view("tokens", call, &[tokens, dims.heads], &input.tokens),
        view("num_tokens", call, &[], &input.num_tokens),
        view("global_root", call, &[frames, GLOBAL_ROOT], &input.global_root),
        view("frame_pose", call, &[frames, dims.pose()], &input.frame_pose),
        view("frame_mask", call, &[frames], &input.frame_mask),
    ]
}

/// The rows of a call as a tensor that borrows them.
fn view<'a, T: Number>(
    name: &'static str,
    call: &Range<usize>,
    shape: &[usize],
    data: &'a Rows<T>,
) -> (&'static str, network::View<'a>) {
    let full = std::iter::once(call.len()).chain(shape.iter().copied()).collect();
    (name, T::view(full, data.range(call.clone())))
}

/// The outputs of a call.
struct Outputs<'a, 's> {
    stage: Stage,
    outputs: &'a Given<'a, 's>,
    /// Rows of the call, padding included.
    call: Range<usize>,
    /// Rows of the call without padding.
    wanted: Range<usize>,
}

impl<'a, 's> Outputs<'a, 's> {
    /// The outputs of a call for a batch of `rows` rows.
    fn new(stage: Stage, outputs: &'a Given<'a, 's>, call: Range<usize>, rows: usize) -> Self {
        Self {
            stage,
            outputs,
            wanted: call.start..call.end.min(rows),
            call,
        }
    }

    fn copy<T>(&self, name: &str, into: &mut Rows<T>) -> Result<(), EngineError>
    where
        T: Number,
    {
        let stage = self.stage;
        let problem = |problem: String| EngineError::Output { stage, problem };
        let data = self.outputs.get::<T>(name).map_err(problem)?;
        let expected = self.call.len() * into.width();
        if data.len() != expected {
            return Err(problem(format!(
                "{name} of {} elements, expected {expected}",
                data.len()
            )));
        }
        let into = into.range_mut(self.wanted.clone());
        into.copy_from_slice(&data[..into.len()]);
        Ok(())
    }
}

fn run_error(stage: Stage, error: &dyn std::fmt::Display) -> EngineError {
    EngineError::Run {
        stage,
        reason: one_line(error),
    }
}

/// The runtime's message without line breaks.
fn one_line(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

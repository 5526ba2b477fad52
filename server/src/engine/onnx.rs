//! The stages on ONNX Runtime, loaded at run time from the library that `ORT_DYLIB_PATH` names.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ort::environment::{Environment, GlobalThreadPoolOptions};
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{Session, SessionOutputs};
use ort::value::{Outlet, PrimitiveTensorElementType, TensorElementType, TensorRef, ValueType};

use super::{DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, Rows, Stages, TokenInput};
use crate::pack::{Dims, GLOBAL_ROOT, LOCAL_ROOT, Pack, Stage, TensorSpec, TensorType};

/// Names the environment variable with the path of the ONNX Runtime library.
pub const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// How ONNX Runtime uses the machine. There is one runtime, with one thread pool, a process: the first one made sets
/// the options for all that follow.
#[derive(Debug, Clone)]
pub struct RuntimeOptions {
    /// The library; `None` reads `ORT_DYLIB_PATH`.
    pub library: Option<PathBuf>,
    /// Threads of the pool that all stages share; 0 takes as many as the process may use (cgroup limits included).
    pub threads: usize,
    /// Whether idle threads of the pool spin for a moment before they sleep: a little faster, at the cost of CPU.
    pub spin: bool,
}

/// The runtime, ready to load stages.
#[derive(Clone)]
pub struct Runtime(Environment);

impl Runtime {
    /// Loads the library, or gives the runtime that this process already has.
    ///
    /// # Errors
    /// [`EngineError::Library`], which says how to get the library.
    pub fn new(options: &RuntimeOptions) -> Result<Self, EngineError> {
        static CURRENT: Mutex<Option<Runtime>> = Mutex::new(None);
        let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = &*current {
            return Ok(runtime.clone());
        }
        let runtime = Self::load(options)?;
        *current = Some(runtime.clone());
        Ok(runtime)
    }

    fn load(options: &RuntimeOptions) -> Result<Self, EngineError> {
        let named = options
            .library
            .clone()
            .or_else(|| std::env::var_os(LIBRARY_VARIABLE).map(PathBuf::from));
        let path = named.ok_or_else(|| EngineError::Library(format!("{LIBRARY_VARIABLE} is not set")))?;
        // ort looks up relative paths beside the executable, users mean the working directory.
        let path = std::path::absolute(&path).unwrap_or(path);
        if !path.is_file() {
            return Err(EngineError::Library(format!(
                "there is no library at {}",
                path.display()
            )));
        }
        let library = |error: &dyn std::fmt::Display| EngineError::Library(error.to_string());
        let threads = match options.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        };
        let pool = GlobalThreadPoolOptions::default()
            .with_intra_threads(threads)
            .and_then(|pool| pool.with_inter_threads(1))
            .and_then(|pool| pool.with_spin_control(options.spin))
            .map_err(|error| library(&error))?;
        let environment = ort::init_from(&path)
            .map_err(|error| library(&error))?
            .with_name("troupe")
            .with_telemetry(false)
            .with_global_thread_pool(pool)
            .build()
            .map_err(|error| library(&error))?;
        tracing::info!(library = %path.display(), threads, "ONNX Runtime loaded");
        Ok(Self(environment))
    }
}

/// The three sessions of a pack.
pub struct OnnxStages {
    dims: Dims,
    any_length: bool,
    root: Session,
    pose: Session,
    decoder: Session,
}

impl OnnxStages {
    /// Loads the stages of `pack` and checks their tensors against the pack's sizes.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`], which name the file.
    pub fn load(runtime: &Runtime, pack: &Pack) -> Result<Self, EngineError> {
        let session = |stage: Stage| {
            let session = open(runtime, &pack.stage_file(stage)).map_err(|reason| EngineError::Load {
                file: stage.file_name(),
                reason,
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
            dims: pack.dims,
            any_length,
            root,
            pose,
            decoder,
        })
    }
}

fn open(runtime: &Runtime, path: &Path) -> Result<Session, String> {
    Session::builder(&runtime.0)
        .map_err(|error| error.to_string())?
        .with_optimization_level(GraphOptimizationLevel::All)
        .map_err(|error| error.to_string())?
        // A plan of the memory for each of many shapes: measured to gain nothing, and to slow small batches down.
        .with_memory_pattern(false)
        .map_err(|error| error.to_string())?
        .commit_from_file(path)
        .map_err(|error| error.to_string())
}

impl Stages for OnnxStages {
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
        reason: error.to_string(),
    }
}

/// Compares a stage's tensors with what the pack's sizes ask for. More outputs than the server reads are fine.
fn check_signature(dims: &Dims, stage: Stage, inputs: &[Outlet], outputs: &[Outlet]) -> Result<(), String> {
    let (wanted_inputs, wanted_outputs) = (dims.inputs(stage), dims.outputs(stage));
    for spec in &wanted_inputs {
        check_outlet("input", spec, inputs)?;
    }
    for spec in &wanted_outputs {
        check_outlet("output", spec, outputs)?;
    }
    match inputs
        .iter()
        .find(|outlet| !wanted_inputs.iter().any(|spec| spec.name == outlet.name()))
    {
        Some(extra) => Err(format!("unknown input {}", extra.name())),
        None => Ok(()),
    }
}

/// Whether every time axis among a stage's inputs is open.
fn takes_any_length(dims: &Dims, stage: Stage, inputs: &[Outlet]) -> bool {
    let mut over_time = dims.inputs(stage).into_iter().filter(|spec| spec.open_time);
    over_time.all(|spec| {
        inputs.iter().filter(|outlet| outlet.name() == spec.name).all(
            |outlet| matches!(outlet.dtype(), ValueType::Tensor { shape, .. } if shape.get(1) == Some(&-1)),
        )
    })
}

fn check_outlet(kind: &str, spec: &TensorSpec, outlets: &[Outlet]) -> Result<(), String> {
    let name = spec.name;
    let outlet = outlets
        .iter()
        .find(|outlet| outlet.name() == name)
        .ok_or(format!("the {kind} {name} is missing"))?;
    let ValueType::Tensor { ty, shape, .. } = outlet.dtype() else {
        return Err(format!("the {kind} {name} is no tensor"));
    };
    let wanted_type = match spec.ty {
        TensorType::F32 => TensorElementType::Float32,
        TensorType::I64 => TensorElementType::Int64,
    };
    if *ty != wanted_type {
        return Err(format!(
            "the {kind} {name} has elements of {ty:?}, expected {wanted_type:?}"
        ));
    }
    // An output's axes may be left open by the exporter (-1); every run checks its length.
    let open = |index: usize| kind == "output" || (index == 0 && spec.open_time);
    let fits = shape.len() == spec.shape.len() + 1
        && shape[0] == -1
        && shape[1..]
            .iter()
            .zip(&spec.shape)
            .enumerate()
            .all(|(index, (&axis, &wanted))| axis == wanted as i64 || (axis == -1 && open(index)));
    if !fits {
        let wanted: Vec<String> = spec.shape.iter().map(usize::to_string).collect();
        return Err(format!(
            "the {kind} {name} has the shape {shape:?}, expected [batch, {}] with a free batch axis",
            wanted.join(", ")
        ));
    }
    Ok(())
}

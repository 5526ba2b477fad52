//! One stage's session on the engine of choice.

use std::path::Path;

use ort::ep::{self, ArbitrarilyConfigurableExecutionProvider as _, ExecutionProviderDispatch};
use ort::logging::LogLevel;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;

use super::{Runtime, exit, one_line};
use crate::EngineKind;

/// How a worker's networks run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SessionOptions {
    /// The engine.
    pub engine: EngineKind,
    /// Threads of the worker, its own among them.
    pub threads: usize,
    /// Whether threads that wait for work spin for a moment before they sleep: a little faster, at
    /// the cost of CPU. With one thread there is nobody to wait for.
    pub spin: bool,
    /// Whether OpenVINO has a network for each shape: see [`super::no_fixed_shapes`].
    pub fixed_shapes: bool,
    /// When more of those are opened than a pack needs at least.
    pub growth: Growth,
}

/// When networks of fixed shapes are opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Growth {
    /// Those that a pack needs at least serve everything.
    None,
    /// In the background, while others serve.
    Background,
    /// When a call of their shape is first made, which waits, and whatever the budget: for
    /// measurements.
    AtOnce,
}

/// Opens the graph in `path` to look at its tensors, not to run it: nothing is optimised.
pub(super) fn look(runtime: &Runtime, path: &Path) -> Result<Session, String> {
    Session::builder(runtime.environment())
        .and_then(|builder| Ok(builder.with_optimization_level(GraphOptimizationLevel::Disable)?))
        .and_then(|mut builder| builder.commit_from_file(path))
        .map_err(|error| one_line(&error))
}

/// Opens the graph in `path`. OpenVINO keeps the kernels that it makes for each shape, `kernels` of
/// them, or as many as it does by itself.
pub(super) fn open(
    runtime: &Runtime,
    options: SessionOptions,
    path: &Path,
    kernels: Option<usize>,
) -> Result<Session, String> {
    let builder = Session::builder(runtime.environment())
        .map_err(|error| one_line(&error))?
        .with_optimization_level(GraphOptimizationLevel::All)
        .map_err(|error| one_line(&error))?
        // A plan of the memory for each of many shapes: measured to gain nothing, and to slow small
        // batches down.
        .with_memory_pattern(false)
        .map_err(|error| one_line(&error))?
        .with_intra_threads(match options.engine {
            // It has threads of its own, and a worker many sessions.
            EngineKind::OpenvinoBf16 => 1,
            EngineKind::Cpu | EngineKind::Cuda | EngineKind::Tensorrt => options.threads,
        })
        .map_err(|error| one_line(&error))?
        .with_inter_threads(1)
        .map_err(|error| one_line(&error))?
        .with_intra_op_spinning(options.spin)
        .map_err(|error| one_line(&error))?;
    let mut builder = match provider(options, kernels) {
        Some(provider) => builder
            .with_execution_providers([provider.error_on_failure()])
            .map_err(|error| one_line(&error))?
            // It warns of every graph that some nodes of it, for shapes, stay with the CPU's own
            // kernels.
            .with_log_level(LogLevel::Error)
            .map_err(|error| one_line(&error))?,
        None => builder,
    };
    let session = builder.commit_from_file(path).map_err(|error| one_line(&error))?;
    if options.engine == EngineKind::OpenvinoBf16 {
        exit::register();
    }
    Ok(session)
}

fn provider(options: SessionOptions, kernels: Option<usize>) -> Option<ExecutionProviderDispatch> {
    match options.engine {
        EngineKind::Cpu => None,
        EngineKind::OpenvinoBf16 => Some(openvino(options.threads, kernels).build()),
        EngineKind::Cuda => Some(ep::CUDA::default().build()),
        EngineKind::Tensorrt => Some(ep::TensorRT::default().build()),
    }
}

/// OpenVINO on the CPU in bf16. Without pinning: workers know nothing of each other, and would all
/// sit on the first cores.
fn openvino(threads: usize, kernels: Option<usize>) -> ep::OpenVINO {
    let mut properties = serde_json::json!({
        "INFERENCE_PRECISION_HINT": "bf16",
        "INFERENCE_NUM_THREADS": threads.to_string(),
        "NUM_STREAMS": "1",
        "ENABLE_CPU_PINNING": "NO",
    });
    if let Some(kernels) = kernels {
        properties["CPU_RUNTIME_CACHE_CAPACITY"] = kernels.to_string().into();
    }
    let properties = serde_json::json!({ "CPU": properties });
    ep::OpenVINO::default()
        .with_device_type("CPU")
        .with_arbitrary_config("load_config", properties.to_string())
}

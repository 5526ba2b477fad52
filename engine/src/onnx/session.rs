//! A stage's session on the chosen engine.

use std::path::Path;

use ort::ep::{self, ArbitrarilyConfigurableExecutionProvider as _, ExecutionProviderDispatch};
use ort::logging::LogLevel;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;

use super::{Runtime, exit, one_line};
use crate::EngineKind;
use crate::gpu::GpuShare;

/// Options for a worker's networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SessionOptions {
    /// The engine that runs them.
    pub engine: EngineKind,
    /// Number of the worker's threads, its own included.
    pub threads: usize,
    /// Whether threads spin briefly before they sleep while they wait for work: slightly faster, at
    /// the cost of CPU time. A single thread has nothing to wait for.
    pub spin: bool,
    /// Whether OpenVINO has a network for each shape: see [`super::no_fixed_shapes`].
    pub fixed_shapes: bool,
    /// When more networks are opened than the indispensable ones.
    pub growth: Growth,
    /// The GPU of engines that run on one.
    pub gpu: GpuShare,
}

/// When networks of fixed shapes are opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Growth {
    /// Never: the indispensable ones serve everything.
    None,
    /// In the background, while others serve.
    Background,
    /// At the first call of their shape, which waits, and whatever the budget. For measurements.
    AtOnce,
}

/// Opens the graph in `path` to inspect its tensors, without optimising it for running.
pub(super) fn look(runtime: &Runtime, path: &Path) -> Result<Session, String> {
    Session::builder(runtime.environment())
        .and_then(|builder| Ok(builder.with_optimization_level(GraphOptimizationLevel::Disable)?))
        .and_then(|mut builder| builder.commit_from_file(path))
        .map_err(|error| one_line(&error))
}

/// Opens the graph in `path`. OpenVINO keeps the kernels of `kernels` shapes, or its own default
/// number.
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
        // A memory plan for each of many shapes: measured to gain nothing, and to slow small
        // batches down.
        .with_memory_pattern(false)
        .map_err(|error| one_line(&error))?
        .with_intra_threads(match options.engine {
            // OpenVINO has its own threads, and a worker has many sessions.
            EngineKind::OpenvinoBf16 => 1,
            EngineKind::Cpu | EngineKind::Cuda | EngineKind::Tensorrt => options.threads,
        })
        .map_err(|error| one_line(&error))?
        .with_inter_threads(1)
        .map_err(|error| one_line(&error))?
        .with_intra_op_spinning(options.spin)
        .map_err(|error| one_line(&error))?;
    runtime.load_needed(options.engine)?;
    let graph_bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    let mut builder = match provider(options, kernels, graph_bytes) {
        Some(provider) => builder
            .with_execution_providers([provider.error_on_failure()])
            .map_err(|error| one_line(&error))?
            // It warns about every graph that some of its nodes, those for shapes, stay with the
            // CPU's own kernels.
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

fn provider(
    options: SessionOptions,
    kernels: Option<usize>,
    graph_bytes: u64,
) -> Option<ExecutionProviderDispatch> {
    let device = i32::try_from(options.gpu.device).unwrap_or(i32::MAX);
    match options.engine {
        EngineKind::Cpu => None,
        EngineKind::OpenvinoBf16 => Some(openvino(options.threads, kernels).build()),
        EngineKind::Cuda => {
            let mut cuda = ep::CUDA::default().with_device_id(device);
            if let Some(bytes) = options.gpu.of_graph(graph_bytes) {
                // Doubling would pass a limit long before the memory is needed.
                let small_steps = ep::ArenaExtendStrategy::SameAsRequested;
                cuda = cuda
                    .with_memory_limit(bytes)
                    .with_arena_extend_strategy(small_steps);
            }
            Some(cuda.build())
        }
        EngineKind::Tensorrt => Some(ep::TensorRT::default().with_device_id(device).build()),
    }
}

/// OpenVINO on the CPU in bf16. Without pinning: workers do not know of each other, and would all
/// use the first cores.
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

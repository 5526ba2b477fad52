//! The graphs of a pack's stages, and the networks of fixed shapes made from them.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::state::Key;
use crate::onnx::Runtime;
use crate::onnx::exit::Owned;
use crate::onnx::openvino::{Compiled, OpenVino};
use crate::pack::{Pack, Stage};
use crate::specs::StageTensors as _;
use crate::{EngineError, lengths};
use troupe_motion::model::Dims;

/// Memory of an open network besides its weights in 16 bits: graph and kernels, bytes. Measured
/// with OpenVINO 2025.4.
const NETWORK_BYTES: u64 = 13 << 20;

/// Memory of the indispensable networks, bytes: one of every length.
pub(in crate::onnx) fn least_bytes(pack: &Pack) -> u64 {
    let count = lengths(&pack.rig.dims, true).len() as u64;
    let bytes = Stage::ALL.into_iter().map(|stage| {
        let each = network_bytes(std::fs::metadata(pack.stage_file(stage)).map_or(0, |file| file.len()));
        each * if stage == Stage::Root { 1 } else { count }
    });
    bytes.sum()
}

fn network_bytes(file_bytes: u64) -> u64 {
    file_bytes + NETWORK_BYTES
}

/// A stage's graph, from which networks are compiled.
pub(in crate::onnx) struct Graph {
    pub(super) id: u64,
    openvino: Arc<OpenVino>,
    model: Mutex<Owned<openvino::Model>>,
    pub(super) stage: Stage,
    pub(super) dims: Dims,
    threads: usize,
    /// Estimated memory of a network, bytes.
    pub(super) bytes: u64,
    /// Number of workers that run it.
    workers: Arc<AtomicUsize>,
}

/// The graphs of a pack.
pub(in crate::onnx) struct PackNetworks {
    graphs: [Arc<Graph>; 3],
    lengths: Vec<usize>,
    pub(in crate::onnx) any_length: bool,
    /// Number of workers that run them.
    workers: Arc<AtomicUsize>,
}

impl PackNetworks {
    /// Reads a pack's graphs, which run on `threads` threads. No network is open yet.
    pub(super) fn read(
        runtime: &Runtime,
        pack: &Pack,
        threads: usize,
        any_length: bool,
    ) -> Result<Self, EngineError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let openvino = runtime.openvino().map_err(EngineError::Library)?;
        let workers = Arc::new(AtomicUsize::new(0));
        let graph = |stage: Stage| {
            let file = pack.stage_file(stage);
            let load = |reason| EngineError::Load {
                file: stage.file_name(),
                reason,
            };
            let model = openvino.read(&file).map_err(load)?;
            Ok(Arc::new(Graph {
                id: NEXT.fetch_add(1, Ordering::Relaxed),
                openvino: openvino.clone(),
                model: Mutex::new(model),
                stage,
                dims: pack.rig.dims,
                threads,
                bytes: network_bytes(std::fs::metadata(&file).map_or(0, |file| file.len())),
                workers: workers.clone(),
            }))
        };
        Ok(Self {
            graphs: [graph(Stage::Root)?, graph(Stage::Pose)?, graph(Stage::Decoder)?],
            lengths: lengths(&pack.rig.dims, any_length),
            any_length,
            workers,
        })
    }

    /// The graphs of all stages.
    pub(super) fn graphs(&self) -> &[Arc<Graph>] {
        &self.graphs
    }

    /// The indispensable networks, as graphs and lengths. Stages alternate, because each compiles
    /// one network at a time.
    pub(super) fn least(&self) -> Vec<(&Arc<Graph>, usize)> {
        let [root, pose, decoder] = &self.graphs;
        let others = self
            .lengths
            .iter()
            .flat_map(|&length| [(pose, length), (decoder, length)]);
        std::iter::once((root, root.dims.max_tokens))
            .chain(others)
            .collect()
    }
}

impl Graph {
    /// Number of workers that run it.
    pub(super) fn workers(&self) -> usize {
        self.workers.load(Ordering::Relaxed)
    }

    /// Compiles a network. It has not run yet.
    pub(super) fn compile(&self, key: Key) -> Result<Compiled, EngineError> {
        let inputs: Vec<(&'static str, Vec<usize>)> = self
            .dims
            .inputs(self.stage)
            .into_iter()
            .map(|mut spec| {
                if spec.open_time {
                    spec.shape[0] = spec.shape[0] * key.length / self.dims.max_tokens;
                }
                let shape = std::iter::once(key.rows).chain(spec.shape);
                (spec.name, shape.collect())
            })
            .collect();
        let outputs = self.dims.outputs(self.stage).into_iter().map(|spec| spec.name);
        let outputs: Vec<&'static str> = outputs.collect();
        let mut model = self.model.lock().unwrap_or_else(PoisonError::into_inner);
        self.openvino
            .compile(&mut model, &inputs, &outputs, self.threads)
            .map_err(|reason| EngineError::Load {
                file: self.stage.file_name(),
                reason,
            })
    }
}

/// A worker that runs a pack's networks. It is counted until it is dropped.
pub(in crate::onnx) struct PackWorker {
    networks: Arc<PackNetworks>,
}

impl PackWorker {
    pub(in crate::onnx) fn new(networks: Arc<PackNetworks>) -> Self {
        networks.workers.fetch_add(1, Ordering::Relaxed);
        Self { networks }
    }

    pub(in crate::onnx) fn graph(&self, stage: Stage) -> &Arc<Graph> {
        match stage {
            Stage::Root => &self.networks.graphs[0],
            Stage::Pose => &self.networks.graphs[1],
            Stage::Decoder => &self.networks.graphs[2],
        }
    }
}

impl Drop for PackWorker {
    fn drop(&mut self) {
        self.networks.workers.fetch_sub(1, Ordering::Relaxed);
    }
}

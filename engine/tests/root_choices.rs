//! Tests of root trajectories drawn from noise, with ONNX Runtime. They need the library
//! (`make runtime`).
//!
//! The pack is the robot's, whose root stage has no noise input. The tests add a root stage that
//! adds a mix of its noise to the trajectory's x and z.

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

use std::path::{Path, PathBuf};

use onnx_rs::ast::{
    DataType, Dimension, Graph, Node, OpType, TensorProto, TensorShape, TensorShapeDimension,
    TensorTypeProto, TypeProto, TypeValue, ValueInfo,
};
use troupe_engine::accuracy::{Probe, compare, probe};
use troupe_engine::gpu::GpuOptions;
use troupe_engine::machine::Machine;
use troupe_engine::onnx::{Growth, NetworkPool, OnnxStages, Runtime};
use troupe_engine::pack::{Pack, Stage};
use troupe_engine::{
    AccuracyCheck, CheckCache, EngineChoice, EngineError, EngineKind, Pipeline, Selector, Stages, Workers,
};
use troupe_motion::model::{GLOBAL_ROOT, KeyframeTask, Motion};

/// Numbers that a trajectory is drawn from.
const CHOICES: usize = 16;
/// Name of the root stage's output for trajectories.
const TRAJECTORY: &str = "global_root";

fn robot() -> Pack {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1");
    Pack::load(&folder).unwrap()
}

/// The shift of the trajectory by one of the numbers: x and z in metres.
fn way(choice: usize) -> [f32; 2] {
    let angle = choice as f32;
    [0.02 * angle.sin(), 0.02 * angle.cos()]
}

/// The robot's pack with other files: its root stage takes `choices` numbers, and the manifest
/// names `promised`.
fn drawing(name: &str, choices: usize, promised: usize) -> Pack {
    let mut pack = robot();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for stage in Stage::ALL {
        let file = std::fs::read(pack.stage_file(stage)).unwrap();
        let file = match stage {
            Stage::Root if choices > 0 => with_noise(&file, choices),
            _ => file,
        };
        std::fs::write(folder.join(stage.file_name()), file).unwrap();
    }
    pack.manifest.root_choices = (promised > 0).then_some(promised);
    let manifest = pack.manifest;
    Pack::from_manifest(manifest, &folder).unwrap()
}

/// A root stage that shifts the trajectory of `file` by its noise.
fn with_noise(file: &[u8], choices: usize) -> Vec<u8> {
    let mut model = onnx_rs::parse(file).unwrap();
    let graph = model.graph.as_mut().unwrap();
    for node in &mut graph.node {
        for output in node.output.iter_mut().filter(|output| **output == TRAJECTORY) {
            *output = "likeliest";
        }
    }
    let mut weights = vec![0.0; choices * GLOBAL_ROOT];
    for (choice, weights) in weights.chunks_mut(GLOBAL_ROOT).enumerate() {
        let [x, z] = way(choice);
        (weights[0], weights[2]) = (x, z);
    }
    let shape = vec![choices as i64, GLOBAL_ROOT as i64];
    graph
        .initializer
        .push(TensorProto::from_f32("ways", shape, weights));
    graph
        .initializer
        .push(TensorProto::from_i64("time_axis", vec![1], vec![1]));
    add(graph, OpType::MatMul, &["root_noise", "ways"], "mix");
    add(graph, OpType::Unsqueeze, &["mix", "time_axis"], "move");
    add(graph, OpType::Add, &["likeliest", "move"], TRAJECTORY);
    graph.input.push(noise_input(choices));
    onnx_rs::encode(&model)
}

fn add<'a>(graph: &mut Graph<'a>, op_type: OpType<'a>, input: &[&'a str], output: &'a str) {
    graph.node.push(Node {
        op_type,
        input: input.to_vec(),
        output: vec![output],
        name: output,
        ..Node::default()
    });
}

fn noise_input(choices: usize) -> ValueInfo<'static> {
    let axis = |value| TensorShapeDimension {
        value,
        denotation: "",
    };
    let shape = TensorShape {
        dim: vec![
            axis(Dimension::Param("batch")),
            axis(Dimension::Value(choices as i64)),
        ],
    };
    ValueInfo {
        name: "root_noise",
        r#type: Some(TypeProto {
            value: Some(TypeValue::Tensor(TensorTypeProto {
                elem_type: DataType::Float,
                shape: Some(shape),
            })),
            denotation: "",
        }),
        ..ValueInfo::default()
    }
}

fn selector() -> Selector {
    Selector {
        runtime: Runtime::new(None).unwrap(),
        machine: Machine::detect(),
        choice: EngineChoice::Auto,
        accuracy_check: AccuracyCheck::Enforce,
        workers: Workers { count: 1, threads: 1 },
        packs: 1,
        gpu: GpuOptions::default(),
        spin: false,
        pool: NetworkPool::new(2 << 30),
        growth: Growth::AtOnce,
        cache: CheckCache::new(None),
    }
}

/// The engines that can run on this machine.
fn engines(selector: &Selector) -> Vec<EngineKind> {
    let runs = |engine: &EngineKind| {
        let missing = selector.missing(*engine);
        if let Some(missing) = &missing {
            println!("{engine} is not tested on this machine: {missing}");
        }
        missing.is_none()
    };
    EngineKind::ALL.into_iter().filter(runs).collect()
}

fn run(pipeline: &mut Pipeline, items: &[KeyframeTask]) -> Vec<Motion> {
    let (answers, _) = pipeline.run(items).unwrap();
    answers.into_iter().map(Result::unwrap).collect()
}

/// The tasks of the accuracy check at `temperature`.
fn tasks(selector: &Selector, pack: &Pack, temperature: f32) -> Vec<KeyframeTask> {
    let reference = selector.load(pack, EngineKind::Cpu).unwrap();
    let Probe { batches, .. } = probe(pack, Box::new(reference)).unwrap();
    let mut tasks = batches.concat();
    tasks.truncate(7);
    for (seed, task) in tasks.iter_mut().enumerate() {
        (task.seed, task.temperature) = (seed as u64, temperature);
    }
    tasks
}

/// The root trajectory as the root stage gave it.
fn trajectory(motion: &Motion) -> &[f32] {
    &motion.trace.as_deref().unwrap().root_r_g3
}

#[test]
fn at_temperature_0_roots_equal_those_of_the_pack_without_choices() {
    let (selector, plain) = (selector(), robot());
    let drawing = drawing("choices-zero", CHOICES, CHOICES);
    let items = tasks(&selector, &plain, 0.0);
    for engine in engines(&selector) {
        let motions = [&plain, &drawing].map(|pack| {
            let stages = selector.load(pack, engine).unwrap();
            run(&mut Pipeline::new(pack.rig.dims, Box::new(stages), 8), &items)
        });
        assert!(motions[0] == motions[1], "{engine}");
    }
}

#[test]
fn above_temperature_0_the_seed_moves_the_root_alone_and_in_a_batch() {
    let selector = selector();
    let pack = drawing("choices-drawn", CHOICES, CHOICES);
    let likeliest = tasks(&selector, &pack, 0.0);
    let drawn = tasks(&selector, &pack, 1.0);
    for engine in engines(&selector) {
        let stages = selector.load(&pack, engine).unwrap();
        let mut pipeline = Pipeline::new(pack.rig.dims, Box::new(stages), 8);
        pipeline.warm_up().unwrap();
        let (before, after) = (run(&mut pipeline, &likeliest), run(&mut pipeline, &drawn));
        let mut moves = Vec::new();
        for (before, after) in before.iter().zip(&after) {
            // The tasks fix the length, so both networks choose the same.
            let (before, after) = (trajectory(before), trajectory(after));
            assert_eq!(before.len(), after.len());
            let step = [0, 2].map(|axis| after[axis] - before[axis]);
            let last = before.len() - GLOBAL_ROOT;
            for (axis, step) in [0, 2].into_iter().zip(step) {
                assert!(
                    (after[last + axis] - before[last + axis] - step).abs() < 1e-4,
                    "{engine}"
                );
            }
            // Sixteen numbers that shift by 2 cm each: a standard deviation of 5.7 cm along each
            // axis.
            assert!(
                step[0].hypot(step[1]) > 1e-3 && step[0].hypot(step[1]) < 0.4,
                "{step:?}"
            );
            moves.push(step);
        }
        for (index, step) in moves.iter().enumerate() {
            assert!(!moves[..index].contains(step), "{engine}: seeds {moves:?}");
        }
        for (item, together) in drawn.iter().zip(&after) {
            assert!(
                run(&mut pipeline, std::slice::from_ref(item))[0] == *together,
                "{engine}"
            );
        }
    }
}

#[test]
fn the_accuracy_check_compares_drawn_roots() {
    let selector = selector();
    let pack = drawing("choices-accuracy", CHOICES, CHOICES);
    let load = |pack: &Pack| -> Box<dyn Stages> { Box::new(selector.load(pack, EngineKind::Cpu).unwrap()) };
    let Probe {
        batches,
        mut reference,
    } = probe(&pack, load(&pack)).unwrap();
    let same = compare(&pack, &mut *reference, &mut *load(&pack), &batches).unwrap();
    assert_eq!((same.root_max_m, same.passes()), (0.0, true));
    // An engine that loses the noise equals the reference at temperature 0 only.
    let mut ignores_noise = IgnoresNoise(load(&pack));
    let accuracy = compare(&pack, &mut *reference, &mut ignores_noise, &batches).unwrap();
    assert!(
        !accuracy.passes() && accuracy.failures().contains("root_"),
        "{accuracy:?}"
    );
}

/// Stages that ignore the noise.
struct IgnoresNoise(Box<dyn Stages>);

impl Stages for IgnoresNoise {
    fn root(
        &mut self,
        rows: usize,
        input: &troupe_engine::RootInput,
        output: &mut troupe_engine::RootOutput,
    ) -> Result<(), EngineError> {
        let mut input = input.clone();
        (0..rows).for_each(|row| input.root_noise.fill_row(row, 0.0));
        self.0.root(rows, &input, output)
    }

    fn pose(
        &mut self,
        rows: usize,
        input: &troupe_engine::TokenInput,
        output: &mut troupe_engine::PoseOutput,
    ) -> Result<(), EngineError> {
        self.0.pose(rows, input, output)
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &troupe_engine::TokenInput,
        output: &mut troupe_engine::DecoderOutput,
    ) -> Result<(), EngineError> {
        self.0.decoder(rows, input, output)
    }
}

#[test]
fn the_graph_and_the_manifest_must_have_the_same_number_of_choices() {
    let selector = selector();
    for (name, choices, promised, says) in [
        (
            "choices-none",
            0,
            16,
            "root.onnx: the input root_noise is missing",
        ),
        ("choices-unsaid", 16, 0, "root.onnx: unknown input root_noise"),
        (
            "choices-fewer",
            8,
            16,
            "root.onnx: the input root_noise has the shape [-1, 8], expected [batch, 16]",
        ),
    ] {
        let pack = drawing(name, choices, promised);
        for engine in engines(&selector) {
            let refused: Result<OnnxStages, EngineError> = selector.load(&pack, engine);
            let error = refused.err().unwrap().to_string();
            assert!(error.starts_with(says), "{engine}: {error}");
        }
    }
}

#[test]
fn choices_are_read_from_the_files_of_a_pack() {
    let folder: PathBuf = drawing("choices-files", CHOICES, CHOICES).folder;
    let mut manifest = robot().manifest;
    manifest.root_choices = Some(CHOICES);
    let names = Stage::ALL.map(Stage::file_name);
    manifest.content_hash = troupe_engine::pack::content_hash(&folder, &names).unwrap();
    std::fs::write(folder.join("pack.toml"), toml::to_string(&manifest).unwrap()).unwrap();
    let pack = Pack::load(&folder).unwrap();
    assert_eq!(pack.rig.dims.root_choices, CHOICES);
    selector().load(&pack, EngineKind::Cpu).unwrap();
}

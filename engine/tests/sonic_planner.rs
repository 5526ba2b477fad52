//! Tests of NVIDIA's planner with ONNX Runtime and a small graph of the same inputs and outputs,
//! whose answer depends on each input. They need the library (`make runtime`).

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

use std::path::{Path, PathBuf};

use troupe_engine::accuracy::{Accuracy, Kind, compare_planners};
use troupe_engine::families::sonic_planner::{Inputs, Planner, SonicPlanner, probe_task};
use troupe_engine::gpu::GpuShare;
use troupe_engine::onnx::{Growth, OnnxPlanner, Runtime, SessionOptions};
use troupe_engine::pack::{MANIFEST_FILE, PLANNER_FILE, Pack, content_hash};
use troupe_engine::{EngineError, EngineKind};
use troupe_motion::model::{Motion, PathTask};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sonic_planner")
}

fn pack() -> Pack {
    Pack::load(&folder()).unwrap()
}

fn load(pack: &Pack) -> Result<OnnxPlanner, EngineError> {
    let options = SessionOptions {
        engine: EngineKind::Cpu,
        threads: 1,
        spin: false,
        fixed_shapes: false,
        growth: Growth::None,
        gpu: GpuShare::default(),
    };
    OnnxPlanner::load(&Runtime::new(None).unwrap(), pack, options)
}

fn generator(pack: &Pack) -> SonicPlanner {
    SonicPlanner::new(pack, Box::new(load(pack).unwrap()), 1).unwrap()
}

fn run(generator: &mut SonicPlanner, task: &PathTask) -> Motion {
    let mut motions = generator.run(std::slice::from_ref(task)).unwrap();
    motions.pop().unwrap()
}

/// Place and heading of the last frame: x, z, radians.
fn last(motion: &Motion) -> [f32; 3] {
    let root = motion.root.last_chunk::<5>().unwrap();
    [root[0], root[2], root[4].atan2(root[3])]
}

fn assert_near(found: [f32; 3], wanted: [f32; 3]) {
    let near = found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 2e-3);
    assert!(near, "{found:?} is not {wanted:?}");
}

/// A task that goes 1.2 m/s to the left, and faces there by and by. Its last frame is at 1.28 m.
fn aside(pack: &Pack, words: &[&str]) -> PathTask {
    let mut task = probe_task(pack, 1, 36).unwrap();
    for (frame, point) in task.path.iter_mut().enumerate() {
        let after = frame.saturating_sub(3) as f32;
        *point = [0.04 * after, 0.0, 0.05 * after];
    }
    for (word, weight) in pack.words.iter().zip(&mut task.style) {
        *weight = if words.contains(&word.as_str()) { 1.0 } else { 0.0 };
    }
    task
}

#[test]
fn each_part_of_a_task_reaches_the_graph() {
    let mut pack = pack();
    let mut generator = generator(&pack);
    let plain = aside(&pack, &["walk"]);
    let walked = run(&mut generator, &plain);
    assert_eq!(walked.frames(), 36);
    // 32 frames from the context on, and turned as the path's end.
    assert_near(last(&walked), [1.28, 0.0, 1.6]);
    let (context, root) = (plain.context[3].global_root.unwrap(), &walked.root[15..20]);
    assert!(
        context.iter().zip(root).all(|(a, b)| (a - b).abs() < 1e-4),
        "{context:?} {root:?}"
    );

    let bent = |task: &PathTask, generator: &mut SonicPlanner| -> f32 {
        let motion = run(generator, task);
        let apart = motion.rotations.iter().zip(&walked.rotations);
        apart.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(
        bent(&aside(&pack, &["zombie"]), &mut generator) > 0.01,
        "the mode"
    );
    let seeded = PathTask {
        seed: 77,
        ..plain.clone()
    };
    assert!(bent(&seeded, &mut generator) > 0.001, "the seed");
    assert_eq!(
        bent(&plain, &mut generator),
        0.0,
        "the same task has the same bits"
    );

    let mut slow = plain.clone();
    for point in &mut slow.path {
        point[0] = 0.0;
    }
    let stood = run(&mut generator, &slow);
    assert_near(last(&stood), [0.0, 0.0, 1.6]);
    let squats = PathTask {
        style: aside(&pack, &["squat"]).style,
        ..slow
    };
    assert!(
        run(&mut generator, &squats).rotations != stood.rotations,
        "only walks become idle"
    );

    // Then the graph aims at the path's end, wherever its direction leads.
    pack.manifest = with_targets(&pack);
    let mut path = plain.clone();
    for (frame, point) in path.path.iter_mut().enumerate().skip(32) {
        *point = [2.0, 1.0, 0.1 * frame as f32 - 3.0];
    }
    let mut aiming = SonicPlanner::new(&pack, Box::new(load(&pack).unwrap()), 1).unwrap();
    assert_near(last(&run(&mut aiming, &path)), [2.0, 1.0, 0.5]);
}

fn with_targets(pack: &Pack) -> troupe_engine::pack::Manifest {
    let text = std::fs::read_to_string(pack.folder.join(MANIFEST_FILE)).unwrap();
    let changed = text.replace("specific_target = false", "specific_target = true");
    assert_ne!(changed, text);
    troupe_engine::pack::Manifest::parse(&changed).unwrap()
}

#[test]
fn plans_have_as_many_frames_as_their_paths() {
    let pack = pack();
    let mut generator = generator(&pack);
    for frames in (24..=64).step_by(4) {
        let task = probe_task(&pack, frames, frames).unwrap();
        assert_eq!(run(&mut generator, &task).frames(), frames);
    }
}

/// Turns every frame's root by a bit, and moves it.
struct Off(OnnxPlanner);

impl Planner for Off {
    fn plan(&mut self, inputs: &Inputs, qpos: &mut Vec<f32>) -> Result<(), EngineError> {
        self.0.plan(inputs, qpos)?;
        for frame in qpos.chunks_exact_mut(36) {
            frame[0] += 0.05;
        }
        Ok(())
    }
}

#[test]
fn the_accuracy_check_compares_a_plan_of_each_mode() {
    let pack = pack();
    let load = || load(&pack).unwrap();
    let same = compare_planners(&pack, Box::new(load()), Box::new(load())).unwrap();
    let nothing = Accuracy {
        kind: Kind::Paths,
        characters: 27,
        ..Accuracy::default()
    };
    assert_eq!(same, nothing);
    let poor = compare_planners(&pack, Box::new(load()), Box::new(Off(load()))).unwrap();
    assert!(
        !poor.passes() && poor.failures().contains("root_mean_m"),
        "{}",
        poor.failures()
    );
}

#[test]
fn a_graph_with_other_tensors_is_refused_by_name() {
    let other = std::env::temp_dir().join(format!("troupe-planner-{}", std::process::id()));
    std::fs::create_dir_all(other.join("bodies")).unwrap();
    std::fs::copy(
        folder().join("../unimogen/denoiser.onnx"),
        other.join(PLANNER_FILE),
    )
    .unwrap();
    std::fs::copy(folder().join("bodies/g1.toml"), other.join("bodies/g1.toml")).unwrap();
    let text = std::fs::read_to_string(folder().join(MANIFEST_FILE)).unwrap();
    let own = content_hash(&folder(), &[PLANNER_FILE]).unwrap();
    let hash = content_hash(&other, &[PLANNER_FILE]).unwrap();
    std::fs::write(other.join(MANIFEST_FILE), text.replace(&own, &hash)).unwrap();
    let pack = Pack::load(&other).unwrap();
    let error = load(&pack).map(|_| ()).unwrap_err().to_string();
    std::fs::remove_dir_all(&other).unwrap();
    assert_eq!(error, "planner.onnx: the input context_mujoco_qpos is missing");
}

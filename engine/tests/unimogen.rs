//! Tests of UniMoGen with ONNX Runtime: the motion equals the reference's, and has the same bits
//! alone and in a batch. They need the library (`make runtime`).
//!
//! The test of 200 random mixes on each engine takes minutes. Its bodies are the trained pack's and
//! random ones with 19 to 100 joints:
//! `cargo test -p troupe-engine --test unimogen -- --ignored --nocapture`

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use troupe_engine::EngineKind;
use troupe_engine::families::unimogen::UniMoGen;
use troupe_engine::generator::{Generator, JobId, Progress};
use troupe_engine::gpu::GpuShare;
use troupe_engine::machine::Machine;
use troupe_engine::onnx::{Growth, OnnxDenoiser, Runtime, SessionOptions};
use troupe_engine::pack::{MANIFEST_FILE, Pack, content_hash};
use troupe_motion::features::{FEATURES_PER_JOINT, pose_features_from_world};
use troupe_motion::model::{Body, InlineJoint, InlineSkeleton, KeyTensors, Motion, Output, PathTask};
use troupe_motion::rotation::{angle_between, from_six_d, from_wxyz, yaw};
use troupe_motion::{Quat, Vec3};

#[derive(Deserialize)]
struct Reference {
    sampler_steps: u32,
    requests: Vec<Request>,
    answers: Vec<Answer>,
}

#[derive(Deserialize)]
struct Request {
    body: String,
    seed: u64,
    guidance: f32,
    style: Vec<f32>,
    path_m: Vec<[f32; 2]>,
    heading_rad: Vec<f32>,
    #[serde(default)]
    past_root_m: Vec<[f32; 3]>,
    #[serde(default)]
    past_rotations_wxyz: Vec<Vec<[f32; 4]>>,
}

#[derive(Deserialize)]
struct Answer {
    root_m: Vec<[f32; 3]>,
    rotations_wxyz: Vec<[f32; 4]>,
}

fn manifest_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn tiny() -> PathBuf {
    manifest_folder().join("tests/unimogen")
}

fn trained() -> PathBuf {
    manifest_folder().join("../models/unimogen")
}

fn options(engine: EngineKind) -> SessionOptions {
    SessionOptions {
        engine,
        threads: 1,
        spin: false,
        fixed_shapes: false,
        growth: Growth::None,
        gpu: GpuShare::default(),
    }
}

fn generator(pack: &Pack, engine: EngineKind) -> UniMoGen {
    let denoiser = OnnxDenoiser::load(&Runtime::new(None).unwrap(), pack, options(engine)).unwrap();
    UniMoGen::new(pack, Box::new(denoiser), 64).unwrap()
}

fn key(body: &Body, root: Vec3, rotations: &[Quat]) -> KeyTensors {
    let mut pose = vec![0.0; body.joints() * FEATURES_PER_JOINT];
    // Positions are not used.
    pose_features_from_world(root, &vec![root; body.joints()], rotations, &mut pose);
    KeyTensors {
        global_root: Some([root.x, root.y, root.z, 1.0, 0.0]),
        pose: Some(pose.into()),
        ..KeyTensors::default()
    }
}

/// The last step before which a job may join.
const LATEST: usize = 3;

/// Takes steps until all jobs are done. `between` may admit jobs before each step.
fn run(generator: &mut UniMoGen, mut between: impl FnMut(&mut UniMoGen, usize)) -> BTreeMap<u64, Motion> {
    let mut done = BTreeMap::new();
    for step in 0.. {
        between(generator, step);
        match generator.is_idle() {
            true if step >= LATEST => break,
            true => continue,
            false => {}
        }
        generator
            .step(&mut |id, progress| match progress {
                Progress::Done(Output::Motion(motion)) => {
                    done.insert(id.request, motion);
                }
                other => panic!("{other:?}"),
            })
            .unwrap();
    }
    done
}

fn id(request: usize) -> JobId {
    JobId {
        request: request as u64,
        character: 0,
    }
}

#[test]
fn the_tasks_of_the_reference_have_its_motion() {
    let pack = Pack::load(&tiny()).unwrap();
    let text = std::fs::read_to_string(tiny().join("reference.json")).unwrap();
    let reference: Reference = serde_json::from_str(&text).unwrap();
    let mut generator = generator(&pack, EngineKind::Cpu).with_call_rows(1000);
    let done = run(&mut generator, |generator, step| {
        for (index, request) in reference.requests.iter().enumerate().filter(|_| step == 0) {
            let body = pack.body(&request.body).unwrap();
            let past = request.past_root_m.iter().zip(&request.past_rotations_wxyz);
            let task = PathTask {
                context: past
                    .map(|(&root, world)| {
                        let world: Vec<Quat> = world.iter().map(|&q| from_wxyz(q)).collect();
                        key(body, root.into(), &world)
                    })
                    .collect(),
                targets: Vec::new(),
                sways: false,
                path: (request.path_m.iter().zip(&request.heading_rad))
                    .map(|(&[x, z], &heading)| [x, z, heading])
                    .collect(),
                style: request.style.clone(),
                steps: reference.sampler_steps,
                guidance: request.guidance,
                seed: request.seed,
                body: body.clone(),
            };
            generator.admit(id(index), task.into());
        }
    });
    for (index, answer) in reference.answers.iter().enumerate() {
        let motion = &done[&(index as u64)];
        assert_eq!(motion.frames(), answer.root_m.len());
        for (found, wanted) in motion.root.chunks_exact(5).zip(&answer.root_m) {
            for (a, b) in found.iter().zip(wanted) {
                assert!((a - b).abs() < 2e-4, "{found:?} is not {wanted:?}");
            }
        }
        let last = motion.rotations.len() - answer.rotations_wxyz.len() * 6;
        for (found, &wanted) in motion.rotations[last..]
            .as_chunks()
            .0
            .iter()
            .zip(&answer.rotations_wxyz)
        {
            let apart = angle_between(from_six_d(*found), from_wxyz(wanted));
            assert!(apart < 1e-3, "{apart} rad apart");
        }
    }
}

/// A random body of 19 to 100 joints that no pack has.
fn made_up_body(pack: &Pack, rng: &mut ChaCha8Rng) -> Body {
    let joints = (0..rng.random_range(19..=100_usize)).map(|joint| {
        let parent = (joint > 0).then(|| rng.random_range(joint.saturating_sub(4)..joint));
        let mut offset = || rng.random_range(0.01..0.2_f32);
        InlineJoint {
            name: format!("joint-{joint}"),
            parent: parent.map(|parent| format!("joint-{parent}")).unwrap_or_default(),
            offset_m: Vec3::new(offset() - 0.1, -offset(), offset() - 0.1),
        }
    });
    let skeleton = InlineSkeleton {
        joints: joints.collect(),
        ..InlineSkeleton::default()
    };
    skeleton
        .body("made-up", 30.0, &pack.rig.dims, &mut Vec::new())
        .unwrap()
}

/// A task for any body: a walk on a curve. Some have a context, some a target, some guidance.
fn any_task(pack: &Pack, frames: usize, seed: u64) -> PathTask {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let body = match rng.random_bool(0.5) {
        true => pack.bodies[rng.random_range(0..pack.bodies.len())].clone(),
        false => Arc::new(made_up_body(pack, &mut rng)),
    };
    let (speed, turn) = (rng.random_range(0.0..2.0_f32), rng.random_range(-1.0..1.0_f32));
    let path: Box<[[f32; 3]]> = (0..frames)
        .map(|frame| {
            let t = frame as f32 / 30.0;
            [0.3 * turn * t * t, speed * t, turn * t]
        })
        .collect();
    let at = |&[x, z, heading]: &[f32; 3]| {
        let world: Vec<Quat> = body
            .neutral
            .iter()
            .map(|&neutral| yaw(heading) * neutral)
            .collect();
        key(&body, Vec3::new(x, body.height_m, z), &world)
    };
    let past = if rng.random_bool(0.7) { 4 } else { 0 };
    let targets = if rng.random_bool(0.2) { 1 } else { 0 };
    PathTask {
        sways: false,
        context: path[..past].iter().map(at).collect(),
        targets: path[frames - targets..].iter().map(at).collect(),
        style: (pack.words.iter())
            .map(|_| {
                if rng.random_bool(0.1) {
                    rng.random_range(0.0..1.0)
                } else {
                    0.0
                }
            })
            .collect(),
        steps: rng.random_range(1..=4),
        guidance: if rng.random_bool(0.2) { 2.0 } else { 1.0 },
        seed,
        path,
        body,
    }
}

/// Compares mixes of tasks that join at random steps with the same tasks alone.
fn compare_mixes(pack: &Pack, engine: EngineKind, tasks: usize, mixes: usize) -> usize {
    let mut generator = generator(pack, engine).with_call_rows(1000);
    let lengths = [20, 36, 68];
    let tasks: Vec<PathTask> = (0..tasks)
        .map(|seed| any_task(pack, lengths[seed % lengths.len()], seed as u64))
        .collect();
    let alone: Vec<Motion> = (tasks.iter().enumerate())
        .map(|(index, task)| {
            let mut done = run(&mut generator, |generator, step| {
                if step == 0 {
                    generator.admit(id(index), task.clone().into());
                }
            });
            done.remove(&(index as u64)).unwrap()
        })
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut differ = 0;
    for mix in 0..mixes {
        // Distinct tasks, each with the step before which it joins.
        let mut joining = BTreeMap::new();
        for _ in 0..rng.random_range(2..=9) {
            joining.insert(rng.random_range(0..tasks.len()), rng.random_range(0..LATEST));
        }
        let done = run(&mut generator, |generator, step| {
            for (&task, _) in joining.iter().filter(|(_, joins)| **joins == step) {
                generator.admit(id(task), tasks[task].clone().into());
            }
        });
        assert_eq!(done.len(), joining.len());
        let different = done
            .iter()
            .filter(|(index, motion)| **motion != alone[**index as usize]);
        let different = different.count();
        if different > 0 {
            println!("mix {mix}: {different} of {} differ", done.len());
        }
        differ += different;
    }
    differ
}

/// f32, and bf16 if this machine has it.
fn engines() -> Vec<EngineKind> {
    let offered = Runtime::new(None).unwrap().offers(EngineKind::OpenvinoBf16);
    let mut engines = vec![EngineKind::Cpu];
    if offered && Machine::detect().has_bf16() {
        engines.push(EngineKind::OpenvinoBf16);
    }
    engines
}

#[test]
fn tasks_have_the_same_bits_alone_and_in_any_mixture() {
    let pack = Pack::load(&tiny()).unwrap();
    for engine in engines() {
        assert_eq!(compare_mixes(&pack, engine, 12, 12), 0, "{engine}");
    }
}

#[test]
fn a_body_moves_by_the_network_of_its_kind() {
    let pack = Pack::load(&trained()).unwrap();
    let own: Vec<&Arc<Body>> = pack.bodies.iter().filter(|body| body.network > 0).collect();
    assert!(!own.is_empty(), "the trained pack has no network of a kind");
    let mut generator = generator(&pack, EngineKind::Cpu);
    for body in own {
        let task = PathTask {
            body: body.clone(),
            context: Vec::new(),
            targets: Vec::new(),
            ..any_task(&pack, 20, 5)
        };
        let mut by_the_other = task.clone();
        Arc::make_mut(&mut by_the_other.body).network = 0;
        let motions = generator.run(&[task.clone(), by_the_other, task]).unwrap();
        assert_ne!(motions[0], motions[1], "{}", body.name);
        assert_eq!(motions[0], motions[2], "{}", body.name);
    }
}

/// How far the slowest of the contact joints moves over the ground, metres a frame.
fn standing_foot_m(body: &Body, motion: &Motion) -> f32 {
    let skeleton = &body.rig.skeleton;
    let joints = skeleton.joint_count();
    let mut places = Vec::new();
    for (root, pose) in motion
        .root
        .chunks_exact(5)
        .zip(motion.rotations.chunks_exact(joints * 6))
    {
        let first = places.len();
        for joint in &skeleton.joints {
            let place = match joint.parent {
                Some(parent) => {
                    let turn = from_six_d(pose.as_chunks().0[parent]);
                    places[first + parent] + turn * joint.offset_m
                }
                None => Vec3::from_slice(root),
            };
            places.push(place);
        }
    }
    let contacts = &skeleton.contacts.as_ref().unwrap().joints;
    let frames: Vec<&[Vec3]> = places.chunks_exact(joints).collect();
    let steps = frames.windows(2).map(|pair| {
        let step = |&joint: &usize| (pair[1][joint] - pair[0][joint]).with_y(0.0).length();
        contacts.iter().map(step).fold(f32::INFINITY, f32::min)
    });
    steps.sum::<f32>() / (frames.len() - 1) as f32
}

#[test]
fn on_a_drawn_line_feet_stand_because_the_root_sways() {
    let pack = Pack::load(&trained()).unwrap();
    let swaying = pack.bodies.iter().filter(|body| body.sway.is_some());
    let mut generator = generator(&pack, EngineKind::Cpu);
    let mut names = Vec::new();
    for body in swaying {
        let foot_m = |sways: bool, generator: &mut UniMoGen| {
            let task = |seed| PathTask {
                sways,
                body: body.clone(),
                context: Vec::new(),
                targets: Vec::new(),
                path: (0..68).map(|frame| [0.0, 0.04 * frame as f32, 0.0]).collect(),
                style: (pack.words.iter())
                    .map(|word| f32::from(u8::from(word == "walk")))
                    .collect(),
                steps: 4,
                guidance: 1.0,
                seed,
            };
            let motions = generator.run(&[1, 2, 3, 4].map(task)).unwrap();
            motions
                .iter()
                .map(|motion| standing_foot_m(body, motion))
                .sum::<f32>()
                / 4.0
        };
        let (with, without) = (foot_m(true, &mut generator), foot_m(false, &mut generator));
        println!(
            "{}: {:.1} mm, {:.1} without",
            body.name,
            1e3 * with,
            1e3 * without
        );
        assert!(
            with < 0.7 * without,
            "{}: {with} m, {without} m without",
            body.name
        );
        names.push(body.name.as_str());
    }
    names.sort_unstable();
    assert_eq!(names, ["g1", "h1", "h1_2", "human"]);
}

#[test]
fn a_network_of_a_kind_with_other_tensors_is_refused_by_name() {
    let folder = std::env::temp_dir().join(format!("troupe-kinds-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("bodies")).unwrap();
    for file in ["denoiser.onnx", "bodies/toy.toml", "bodies/turned.toml"] {
        std::fs::copy(tiny().join(file), folder.join(file)).unwrap();
    }
    // The trained network knows other words.
    std::fs::copy(
        trained().join("denoiser.onnx"),
        folder.join("denoiser-robots.onnx"),
    )
    .unwrap();
    let text = std::fs::read_to_string(tiny().join(MANIFEST_FILE)).unwrap();
    let own = content_hash(&tiny(), &["denoiser.onnx"]).unwrap();
    let hash = content_hash(&folder, &["denoiser.onnx", "denoiser-robots.onnx"]).unwrap();
    let text = text.replace(&own, &hash) + "\n[unimogen.kinds]\nrobots = [\"toy\"]\n";
    std::fs::write(folder.join(MANIFEST_FILE), text).unwrap();
    let pack = Pack::load(&folder).unwrap();
    let error = OnnxDenoiser::load(&Runtime::new(None).unwrap(), &pack, options(EngineKind::Cpu));
    std::fs::remove_dir_all(&folder).unwrap();
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(
        error.starts_with("denoiser-robots.onnx: the input style is "),
        "{error}"
    );
}

#[test]
#[ignore = "takes minutes"]
fn any_mixture_of_trained_bodies_gets_the_same_bits_alone_on_each_engine() {
    let pack = Pack::load(&trained()).unwrap();
    for engine in engines() {
        let differ = compare_mixes(&pack, engine, 40, 200);
        println!("{engine}: {differ} motions of 200 mixes differ from those alone");
        assert_eq!(differ, 0);
    }
}

use std::path::Path;
use std::sync::{Arc, Mutex};

use troupe_motion::model::{KeyTensors, Motion, Output, PathTask, PromptTask};
use troupe_motion::root::heading_of;
use troupe_motion::rotation::{angle_between, from_six_d, yaw};
use troupe_motion::{Quat, Vec3};

use super::translation::Translation;
use super::*;
use crate::EngineError;
use crate::generator::{Generator, JobId, Progress};
use crate::made_up::neutral_key;
use crate::pack::Pack;

fn pack() -> Pack {
    Pack::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sonic_planner")).unwrap()
}

fn translation(pack: &Pack) -> Translation {
    let table = pack.manifest.sonic_planner.as_ref().unwrap();
    Translation::new(table, pack.manifest.fps, pack.rig.dims)
}

/// A task with this path, which starts from the neutral pose, with these words.
fn task(pack: &Pack, path: Vec<[f32; 3]>, words: &[(&str, f32)]) -> PathTask {
    let body = pack.bodies[0].clone();
    let weight = |word: &String| {
        words
            .iter()
            .find(|(given, _)| given == word)
            .map_or(0.0, |(_, weight)| *weight)
    };
    PathTask {
        sways: false,
        context: path[..4].iter().map(|&point| neutral_key(&body, point)).collect(),
        targets: Vec::new(),
        style: pack.words.iter().map(weight).collect(),
        steps: 1,
        guidance: 1.0,
        seed: 12_345_678,
        path: path.into(),
        body,
    }
}

/// A straight path of `frames` frames, `step` metres each after the context, which goes ahead in
/// small steps.
fn straight(frames: usize, step: Vec3, heading: f32) -> Vec<[f32; 3]> {
    let mut place = Vec3::new(0.3, 0.0, -0.2);
    (0..frames)
        .map(|frame| {
            place += if frame < 4 {
                Vec3::new(0.0, 0.0, 0.001)
            } else {
                step
            };
            [place.x, place.z, heading]
        })
        .collect()
}

fn mode_of<'a>(pack: &'a Pack, inputs: &Inputs) -> &'a str {
    &pack.words[inputs.mode[0] as usize]
}

fn assert_near(found: &[f32], wanted: &[f32]) {
    assert_eq!(found.len(), wanted.len());
    let near = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4);
    assert!(near, "{found:?} is not {wanted:?}");
}

#[test]
fn the_context_becomes_qpos_in_mujocos_axes() {
    let pack = pack();
    let path = vec![[1.0, 2.0, 0.5]; 36];
    let inputs = translation(&pack).inputs(&task(&pack, path, &[])).unwrap();
    let body = &pack.bodies[0];
    let robot = body.rig.skeleton.robot.as_ref().unwrap();
    for frame in inputs.context_mujoco_qpos.chunks_exact(QPOS) {
        // X is ahead and Y to the left.
        assert_near(&frame[..3], &[2.0, 1.0, body.height_m]);
        assert_near(&frame[3..7], &[0.25_f32.cos(), 0.0, 0.0, 0.25_f32.sin()]);
        let (_, rotation, angles) = robot.read_qpos(frame);
        let mut local = vec![Quat::IDENTITY; body.joints()];
        robot.pose(rotation, angles, &mut local);
        let mut world: Vec<Quat> = Vec::new();
        for (joint, local) in body.rig.skeleton.joints.iter().zip(local) {
            world.push(joint.parent.map_or(local, |parent| world[parent] * local));
        }
        for (found, neutral) in world.iter().zip(&body.neutral) {
            let apart = angle_between(*found, yaw(0.5) * *neutral);
            assert!(apart < 2e-3, "{apart} rad from the neutral pose");
        }
    }
}

#[test]
fn the_heaviest_word_is_the_mode_and_the_path_says_where_and_how_fast() {
    let pack = pack();
    let words = [("walk", 0.3), ("zombie", 0.8), ("idle", 0.8)];
    let ahead = task(&pack, straight(36, Vec3::new(0.0, 0.0, 0.04), 0.5), &words);
    let inputs = translation(&pack).inputs(&ahead).unwrap();
    // Of two equal weights the first in the order of the modes counts.
    assert_eq!((inputs.mode, mode_of(&pack, &inputs)), ([0], "idle"));
    let inputs = translation(&pack)
        .inputs(&task(&pack, ahead.path.to_vec(), &words[..2]))
        .unwrap();
    assert_eq!((inputs.mode, mode_of(&pack, &inputs)), ([24], "zombie"));
    // The small steps before the last context frame do not count.
    assert_near(&inputs.target_vel, &[1.2]);
    assert_near(&inputs.movement_direction, &[1.0, 0.0, 0.0]);
    assert_near(&inputs.facing_direction, &[0.5_f32.cos(), 0.5_f32.sin(), 0.0]);

    let aside = task(&pack, straight(24, Vec3::new(0.03, 0.0, -0.04), 0.0), &words[..1]);
    let inputs = translation(&pack).inputs(&aside).unwrap();
    assert_near(&inputs.target_vel, &[1.5]);
    assert_near(&inputs.movement_direction, &[-0.8, 0.6, 0.0]);
    assert_near(&inputs.facing_direction, &[1.0, 0.0, 0.0]);
    assert_eq!(mode_of(&pack, &inputs), "walk");
}

#[test]
fn walks_become_idle_below_5_cm_a_second_and_other_modes_stay() {
    let pack = pack();
    let translation = translation(&pack);
    for (mode, stands) in [
        ("walk", "idle"),
        ("happy", "idle"),
        ("squat", "squat"),
        ("zombie", "zombie"),
    ] {
        let path = |mps: f32| straight(36, Vec3::new(0.0, 0.0, mps / 30.0), 1.0);
        let slow = translation
            .inputs(&task(&pack, path(0.049), &[(mode, 1.0)]))
            .unwrap();
        assert_eq!((mode_of(&pack, &slow), slow.target_vel), (stands, [-1.0]));
        assert_eq!(slow.movement_direction, [0.0; 3]);
        assert_near(&slow.facing_direction, &[1.0_f32.cos(), 1.0_f32.sin(), 0.0]);
        let moving = translation
            .inputs(&task(&pack, path(0.051), &[(mode, 1.0)]))
            .unwrap();
        assert_eq!(mode_of(&pack, &moving), mode);
        assert_near(&moving.target_vel, &[0.051]);
    }
    let plain = task(&pack, straight(36, Vec3::Z * 0.03, 0.0), &[]);
    assert_eq!(mode_of(&pack, &translation.inputs(&plain).unwrap()), "walk");
}

#[test]
fn the_count_of_tokens_has_as_many_frames_as_the_path() {
    let pack = pack();
    for (frames, index) in [(24, 0), (36, 3), (64, 10)] {
        let task = task(&pack, straight(frames, Vec3::Z, 0.0), &[]);
        let allowed = translation(&pack).inputs(&task).unwrap().allowed_pred_num_tokens;
        let mut wanted = [0; 11];
        wanted[index] = 1;
        assert_eq!(allowed, wanted);
    }
}

#[test]
fn targets_are_the_paths_end_and_count_if_the_pack_says_so() {
    let mut pack = pack();
    let mut path = straight(24, Vec3::Z * 0.03, 0.0);
    for (frame, point) in path.iter_mut().enumerate() {
        *point = [frame as f32, -2.0 * frame as f32, 0.1 * frame as f32];
    }
    let task = task(&pack, path, &[("run", 1.0)]);
    let inputs = translation(&pack).inputs(&task).unwrap();
    let height = pack.bodies[0].height_m;
    for (index, frame) in (20..24).enumerate() {
        let frame = frame as f32;
        assert_near(
            &inputs.specific_target_positions[index],
            &[-2.0 * frame, frame, height],
        );
        assert_near(&inputs.specific_target_headings[index..=index], &[0.1 * frame]);
    }
    assert_eq!((inputs.has_specific_target, inputs.height), ([0], [-1.0]));
    assert_eq!(inputs.random_seed, [5678]);
    pack.manifest.sonic_planner.as_mut().unwrap().specific_target = true;
    let aimed = translation(&pack).inputs(&task).unwrap();
    assert_eq!(aimed.has_specific_target, [1]);
    assert_eq!(
        Inputs {
            has_specific_target: [0],
            ..aimed
        },
        inputs
    );
}

#[test]
fn every_part_of_a_task_that_does_not_fit_is_named() {
    let pack = pack();
    let translation = translation(&pack);
    let refused = |change: &dyn Fn(&mut PathTask)| {
        let mut task = task(&pack, straight(36, Vec3::Z, 0.0), &[]);
        change(&mut task);
        translation.inputs(&task).unwrap_err().to_string()
    };
    let cut = |frames: usize| move |task: &mut PathTask| task.path = task.path[..frames].into();
    let path = "path is 20; allowed: 24 to 64 frames, a multiple of 4";
    assert!(refused(&cut(20)).contains(path));
    assert!(refused(&cut(34)).contains("path is 34"));
    assert!(refused(&|task| task.context.clear()).contains("context is 0; allowed: 4 frames"));
    assert!(refused(&|task| task.context[2].pose = None).contains("frame 2 without root or pose"));
    let targets = |task: &mut PathTask| task.targets = vec![KeyTensors::default()];
    assert!(refused(&targets).contains("targets is 1; allowed: none"));
    assert!(refused(&|task| task.style.truncate(3)).contains("style is 3; allowed: 27 weights"));
    assert!(refused(&|task| task.path[5][1] = f32::NAN).contains("is NaN; allowed: finite numbers"));
}

#[test]
fn frames_become_motion_and_the_motion_the_same_frames() {
    let pack = pack();
    let body = &pack.bodies[0];
    let robot = body.rig.skeleton.robot.as_ref().unwrap();
    let mut qpos = Vec::new();
    for frame in 0..4 {
        let turn = yaw(0.3 * frame as f32) * Quat::from_rotation_x(0.1);
        let angles: Vec<f32> = (robot.hinges().iter().enumerate())
            .map(|(index, hinge)| hinge.limited(0.1 + 0.01 * index as f32 + 0.05 * frame as f32))
            .collect();
        let mut numbers = [0.0; QPOS];
        robot.write_qpos(Vec3::new(0.1, 0.8, frame as f32), turn, &angles, &mut numbers);
        qpos.extend(numbers);
    }
    let motion = motion::motion(body, robot, &qpos, 30.0);
    assert_eq!(
        (motion.frames(), motion.contacts.len()),
        (4, 4 * body.rig.dims.contacts)
    );
    let joints = body.joints();
    let frames = motion
        .root
        .chunks_exact(5)
        .zip(motion.rotations.chunks_exact(6 * joints));
    let keys: Vec<KeyTensors> = frames
        .map(|(root, six_d)| {
            let rotations = six_d.as_chunks::<6>().0;
            let heading = heading_of(from_six_d(rotations[0]), body.rig.skeleton.left_axis);
            assert!((root[4].atan2(root[3]) - heading).abs() < 1e-5);
            let feature = rotations
                .iter()
                .flat_map(|six_d| [&[0.0; 3][..], &six_d[..]].concat());
            KeyTensors {
                global_root: root.try_into().ok(),
                pose: Some(feature.collect()),
                ..KeyTensors::default()
            }
        })
        .collect();
    let back = PathTask {
        context: keys,
        ..task(&pack, straight(24, Vec3::Z, 0.0), &[])
    };
    let back = translation(&pack).inputs(&back).unwrap().context_mujoco_qpos;
    let apart = back
        .iter()
        .zip(&qpos)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(apart < 2e-3, "{apart}");
}

/// Stays in the last frame of the context, for as many frames as are allowed and a few more.
struct Still {
    more: usize,
    change: fn(&mut [f32]),
    calls: Arc<Mutex<Vec<Inputs>>>,
}

impl Planner for Still {
    fn plan(&mut self, inputs: &Inputs, qpos: &mut Vec<f32>) -> Result<(), EngineError> {
        if self.more > 100 {
            return Err(EngineError::Stopped);
        }
        self.calls.lock().unwrap().push(inputs.clone());
        let tokens = 6 + inputs
            .allowed_pred_num_tokens
            .iter()
            .position(|&one| one == 1)
            .unwrap();
        let last = &inputs.context_mujoco_qpos[3 * QPOS..];
        *qpos = last.repeat(4 * tokens + self.more);
        (self.change)(qpos);
        Ok(())
    }
}

fn still(more: usize, change: fn(&mut [f32])) -> (SonicPlanner, Arc<Mutex<Vec<Inputs>>>) {
    let calls = Arc::default();
    let planner = Still {
        more,
        change,
        calls: Arc::clone(&calls),
    };
    (SonicPlanner::new(&pack(), Box::new(planner), 3).unwrap(), calls)
}

fn id(request: u64) -> JobId {
    JobId {
        request,
        character: 0,
    }
}

/// Takes one step: the requests that ended, each with its motion or the error's text.
fn step(generator: &mut SonicPlanner) -> Vec<(u64, Result<Motion, String>)> {
    let mut ended = Vec::new();
    let mut out = |id: JobId, progress| {
        let end = match progress {
            Progress::Done(Output::Motion(motion)) => Ok(motion),
            Progress::Failed(error) => Err(error.to_string()),
            other => panic!("{other:?}"),
        };
        ended.push((id.request, end));
    };
    generator.step(&mut out).unwrap();
    ended
}

#[test]
fn each_step_is_a_call_for_the_oldest_job() {
    let pack = pack();
    let (mut generator, calls) = still(0, |_| {});
    let plan = |frames| task(&pack, straight(frames, Vec3::Z * 0.04, 0.0), &[]);
    for (request, frames) in [(1, 24), (2, 36), (3, 64)] {
        generator.admit(id(request), plan(frames).into());
    }
    generator.admit(id(4), PromptTask::default().into());
    generator.admit(id(5), plan(20).into());
    assert_eq!(generator.free(), 0);
    generator.cancel(id(2));
    assert_eq!(generator.free(), 1);
    let ended = step(&mut generator);
    let texts: Vec<_> = ended
        .iter()
        .filter_map(|(id, end)| Some((*id, end.as_ref().err()?.as_str())))
        .collect();
    assert_eq!(texts[0], (4, "the pack has no networks for such a task"));
    assert!(
        texts[1].0 == 5 && texts[1].1.contains("the task's path is 20"),
        "{texts:?}"
    );
    let frames = |ended: &[(u64, Result<Motion, String>)]| -> Vec<(u64, usize)> {
        let done = ended
            .iter()
            .filter_map(|(id, end)| Some((*id, end.as_ref().ok()?.frames())));
        done.collect()
    };
    assert_eq!(frames(&ended), [(1, 24)]);
    assert_eq!(frames(&step(&mut generator)), [(3, 64)]);
    assert!(generator.is_idle() && step(&mut generator).is_empty());
    assert_eq!(calls.lock().unwrap().len(), 2);
}

#[test]
fn answers_that_are_no_motion_fail_alone() {
    let pack = pack();
    let plan = task(&pack, straight(24, Vec3::Z, 0.0), &[]);
    type Spoil = fn(&mut [f32]);
    let cases: [(usize, Spoil, &str); 3] = [
        (4, |_| {}, "it gave 28 frames, expected 24"),
        (0, |qpos| qpos[40] = f32::INFINITY, "values that are not finite"),
        (
            0,
            |qpos| qpos[QPOS + 3..QPOS + 7].fill(0.0),
            "frame 1 has a rotation of length 0",
        ),
    ];
    for (more, change, said) in cases {
        let (mut generator, _) = still(more, change);
        generator.admit(id(1), plan.clone().into());
        let ended = step(&mut generator);
        let text = ended[0].1.as_ref().unwrap_err();
        assert!(text.contains(said) && text.contains("planner.onnx"), "{text}");
        assert!(generator.is_idle());
    }
    let (mut generator, _) = still(101, |_| {});
    generator.admit(id(1), plan.into());
    assert!(generator.step(&mut |_, _| panic!("it has no result")).is_err());
    assert!(
        !generator.is_idle(),
        "the worker fails its jobs, and then clears it"
    );
    generator.clear();
    assert!(generator.is_idle());
}

#[test]
fn made_up_tasks_fit_the_pack_and_show_every_mode() {
    let pack = pack();
    let translation = translation(&pack);
    for index in 0..pack.words.len() {
        let task = probe_task(&pack, index, 37).unwrap();
        assert_eq!(task.path.len(), 40);
        assert_eq!(task.style.iter().position(|&weight| weight == 1.0), Some(index));
        translation.inputs(&task).unwrap();
    }
    let (mut generator, calls) = still(0, |_| {});
    generator.warm_up(&pack).unwrap();
    assert_eq!(
        (calls.lock().unwrap().len(), generator.trial().unwrap().work),
        (2, 64)
    );
}

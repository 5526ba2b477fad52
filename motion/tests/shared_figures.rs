//! Compares Rust's measures and pinning with Python's: a small motion whose figures both test
//! suites compute (`training/tests/evaluate/test_shared_figures.py` writes the file).

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;
use troupe_motion::feasibility::{Figure, Judge, Key, Limits, LimitsDoc};
use troupe_motion::metrics::{Task, evaluate};
use troupe_motion::model::{Dims, Rig};
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::root::heading_of;
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::{Clip, ContactParams, GlobalRoot, Joint, Quat, Skeleton, Vec3};

const FRAMES: usize = 20;
const JOINTS: usize = 8;
const PIN_REACH_FRAMES: usize = 8;
const TASK: Task = Task {
    context_frames: 4,
    gap_frames: 15,
    target_frames: 1,
};

fn skeleton() -> Arc<Skeleton> {
    let joint = |name: &str, parent, offset| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::from_array(offset),
    };
    let joints = vec![
        joint("Hips", None, [0.0, 0.0, 0.0]),
        joint("Spine", Some(0), [0.0, 0.4, 0.0]),
        joint("Leg_L", Some(0), [0.1, 0.0, 0.0]),
        joint("Foot_L", Some(2), [0.0, -0.9, 0.0]),
        joint("Toes_L", Some(3), [0.0, -0.05, 0.12]),
        joint("Leg_R", Some(0), [-0.1, 0.0, 0.0]),
        joint("Foot_R", Some(5), [0.0, -0.9, 0.0]),
        joint("Toes_R", Some(6), [0.0, -0.05, 0.12]),
    ];
    let contacts = ContactParams {
        joints: vec![3, 4, 6, 7],
        max_height_m: vec![0.12, 0.06, 0.12, 0.06],
        max_speed_mps: 0.4,
        clearance_m: vec![0.07, 0.02, 0.07, 0.02],
    };
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
}

fn shared() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shared_figures.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f32> {
    let array = value.as_array().unwrap();
    array.iter().map(|v| v.as_f64().unwrap() as f32).collect()
}

fn clip(data: &Value) -> Clip {
    let roots = numbers(&data["root_positions"]);
    let rotations = numbers(&data["rotations_wxyz"]);
    let roots = roots.chunks_exact(3).map(Vec3::from_slice).collect();
    let quat = |q: &[f32]| Quat::from_xyzw(q[1], q[2], q[3], q[0]).normalize();
    let rotations = rotations.chunks_exact(4).map(quat).collect();
    Clip::new(skeleton(), 30.0, roots, rotations).unwrap()
}

/// The figures that differ: name, Rust's and Python's value.
fn differences(motion: &Clip, truth: &Clip, wanted: &Value) -> Vec<String> {
    let figures = serde_json::to_value(evaluate(motion, truth, TASK).unwrap().figures).unwrap();
    let wanted = wanted.as_object().unwrap();
    let pairs = wanted.iter().map(|(name, value)| {
        // Rust's older name for it.
        let found = figures.get(name).or_else(|| figures.get("reaching_success"));
        (
            name,
            found.and_then(Value::as_f64).unwrap(),
            value.as_f64().unwrap(),
        )
    });
    pairs
        .filter(|(_, found, wanted)| found.is_nan() || (found - wanted).abs() > 2e-3 * wanted.abs() + 5e-5)
        .map(|(name, found, wanted)| format!("{name}: {found} here, {wanted} in Python"))
        .collect()
}

#[test]
fn figures_equal_those_of_python() {
    let data = shared();
    let (motion, truth) = (clip(&data["motion"]), clip(&data["truth"]));
    assert_eq!(differences(&motion, &truth, &data["figures"]), [""; 0]);
    let pinned = clip(&data["pinned"]);
    assert_eq!(differences(&pinned, &truth, &data["pinned_figures"]), [""; 0]);
}

/// Rust's counterparts of Python's figures: all but those of hinges, which no data limits.
const FEASIBILITY: [(&str, Figure); 12] = [
    ("root_speed_mps", Figure::RootSpeed),
    ("root_acceleration_mps2", Figure::RootAcceleration),
    ("turning_rad_per_s", Figure::Turning),
    ("joint_speed_mps", Figure::JointSpeed),
    ("joint_acceleration_mps2", Figure::JointAcceleration),
    ("below_ground_m", Figure::BelowGround),
    ("off_ground_m", Figure::OffGround),
    ("tilt_rad", Figure::Tilt),
    ("bend_rad", Figure::Bend),
    ("root_reach_m", Figure::RootReach),
    ("turn_reach_rad", Figure::TurnReach),
    ("pose_reach_m", Figure::PoseReach),
];

#[test]
fn feasibility_equals_that_of_python() {
    let data = shared();
    let motion = clip(&data["motion"]);
    let doc: LimitsDoc = serde_json::from_value(data["feasibility"]["limits"].clone()).unwrap();
    let dims = Dims {
        joints: JOINTS,
        contacts: 4,
        heads: 1,
        codes: 2,
        min_tokens: 3,
        max_tokens: 16,
        frames_per_token: 4,
        context_frames: 4,
        max_targets: 4,
        root_choices: 0,
    };
    let skeleton = skeleton();
    let rig = Rig {
        limits: Some(Arc::new(Limits::new(&doc, &skeleton).unwrap())),
        ..Rig::new("shared", 30.0, dims, (*skeleton).clone())
    };
    let mut judge = Judge::new(&rig).unwrap();
    let key = |frame: usize| Key {
        root: Some(motion.root_at(frame)),
        rotations: Some(motion.rotations_at(frame)),
        ..Key::default()
    };
    let given = judge.keys(&[0, 1, 2, 3].map(key), &[key(FRAMES - 1)], FRAMES);
    let found = judge
        .motion(&motion.root_positions, &motion.rotations)
        .worse_of(&given);
    for (name, figure) in FEASIBILITY {
        let wanted = data["feasibility"]["figures"][name].as_f64().unwrap() as f32;
        let value = found.get(figure).value;
        // A value on the right side of the ground is not exact.
        let near = (value - wanted).abs() <= 2e-3 * wanted.abs() + 2e-4;
        assert!(
            near || (wanted < 0.0 && value == 0.0),
            "{name}: {value} here, {wanted} in Python"
        );
    }
}

/// Pinned as the server pins its answers.
fn pinned(motion: &Clip, truth: &Clip) -> (Vec<GlobalRoot>, Vec<Quat>) {
    let mut roots = motion.roots();
    let mut rotations = motion.rotations.clone();
    for (root, pose) in roots.iter_mut().zip(rotations.chunks_exact(JOINTS)) {
        root.heading = heading_of(pose[0], Vec3::X);
    }
    let frames = [0, 1, 2, 3, FRAMES - 1];
    let root_pins = frames.map(|frame| RootPin {
        frame,
        root: truth.root_at(frame),
    });
    roots[0] = root_pins[0].root;
    pin_targets(&mut roots, &mut rotations, JOINTS, 0, &root_pins);
    let pose_pins = frames.map(|frame| PosePin {
        frame,
        rotations: truth.rotations_at(frame),
    });
    pin_poses(&mut rotations, JOINTS, &pose_pins, PIN_REACH_FRAMES);
    (roots, rotations)
}

#[test]
fn pinning_equals_that_of_python() {
    let data = shared();
    let (roots, rotations) = pinned(&clip(&data["motion"]), &clip(&data["truth"]));
    let wanted = clip(&data["pinned"]);
    for frame in 0..FRAMES {
        let (here, there) = (roots[frame].position, wanted.root_positions[frame]);
        assert!(
            here.distance(there) < 1e-4,
            "root of frame {frame}: {here} and {there}"
        );
        for joint in 0..JOINTS {
            let (here, there) = (
                rotations[frame * JOINTS + joint],
                wanted.rotations_at(frame)[joint],
            );
            assert!(
                here.dot(there).abs() > 1.0 - 1e-6,
                "joint {joint} of frame {frame}: {here} and {there}"
            );
        }
    }
}

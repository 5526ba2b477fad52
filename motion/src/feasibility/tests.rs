use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::clip::Clip;
use crate::model::{Dims, Rig};
use crate::robot::testing::tables;
use crate::root::{GlobalRoot, LocalRoot};
use crate::skeleton::Skeleton;
use crate::testing::{biped, stand, walk};

/// Limits that a walk stays within.
const LIMITS: &str = r#"
beyond = 0.001
windows = 100
root_speed_mps = 2.0
root_acceleration_mps2 = 10.0
turning_rad_per_s = 3.0
joint_speed_mps = 4.0
joint_acceleration_mps2 = 40.0
below_ground_m = 0.1
off_ground_m = 0.4
upright = [0.0, 1.0, 0.0]
tilt_rad = 0.5
bend_rad = 0.1
reach_frames = [1, 11, 31]
root_reach_m = [0.1, 0.5, 1.5]
turn_reach_rad = [0.1, 1.0, 2.0]
pose_reach_m = [0.1, 0.4, 0.6]

[[bends]]
joint = "Spine"
usual = [1.0, 0.0, 0.0, 0.0]
low = [-0.2, -0.1, -0.1]
high = [0.2, 0.1, 0.1]
"#;

fn doc() -> LimitsDoc {
    toml::from_str(LIMITS).unwrap()
}

fn rig() -> Rig {
    rig_of(&biped(), &doc())
}

fn rig_of(skeleton: &Skeleton, limits: &LimitsDoc) -> Rig {
    let dims = Dims {
        joints: skeleton.joint_count(),
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
    let limits = Limits::new(limits, skeleton).unwrap();
    Rig {
        limits: Some(Arc::new(limits)),
        ..Rig::new("biped", 30.0, dims, skeleton.clone())
    }
}

/// A G1 whose left knee has a limit of acceleration, rad/s². The figures of its data have limits
/// that nothing reaches.
fn robot_rig(knee: Option<f32>) -> (Rig, usize) {
    let mut tables = tables();
    let nth = tables
        .robot
        .hinges
        .iter()
        .position(|hinge| hinge.joint == "left_knee");
    let nth = nth.unwrap();
    tables.robot.hinges[nth].max_acceleration_rad_per_s2 = knee;
    let skeleton = tables.skeleton.with_robot(&tables.robot).unwrap();
    let mut wide = doc();
    wide.bends.clear();
    for limit in [
        &mut wide.joint_speed_mps,
        &mut wide.joint_acceleration_mps2,
        &mut wide.below_ground_m,
        &mut wide.off_ground_m,
    ] {
        *limit = 1e6;
    }
    wide.tilt_rad = 4.0;
    (rig_of(&skeleton, &wide), nth)
}

/// Judges frames of a G1 that stands still, but turns one hinge.
fn judged_hinge(rig: &Rig, hinge: usize, angles: &[f32]) -> Feasibility {
    let robot = rig.skeleton.robot.as_ref().unwrap();
    let mut rotations = Vec::new();
    for &angle in angles {
        let mut all = vec![0.0; robot.hinges().len()];
        all[hinge] = angle;
        let mut pose = vec![Quat::IDENTITY; rig.dims.joints];
        robot.pose(Quat::IDENTITY, &all, &mut pose);
        rotations.extend(pose);
    }
    let roots = vec![Vec3::new(0.0, 0.8, 0.0); angles.len()];
    Judge::new(rig).unwrap().motion(&roots, &rotations)
}

#[test]
fn a_hinge_that_is_too_fast_is_named_with_its_frame() {
    let (rig, knee) = robot_rig(None);
    let joint = rig.skeleton.joint_index("left_knee");
    let found = judged_hinge(&rig, knee, &[0.0, 0.1, 0.2, 1.2, 1.3]);
    let (figure, reading) = found.worst();
    assert_eq!(
        (figure, reading.frame, reading.joint, reading.limit),
        (Figure::HingeSpeed, 3, joint, 20.0)
    );
    // A radian in a frame.
    assert!((reading.value - 30.0).abs() < 1e-2, "{reading:?}");
    assert!(!found.is_feasible());
    let acceleration = found.get(Figure::HingeAcceleration);
    assert_eq!((acceleration.value, acceleration.limit), (0.0, f32::INFINITY));
}

#[test]
fn a_hinge_may_have_a_limit_of_acceleration() {
    let angles = [0.0, 0.1, 0.2, 0.5, 0.8];
    let (rig, knee) = robot_rig(Some(100.0));
    let found = judged_hinge(&rig, knee, &angles);
    assert!(found.get(Figure::HingeSpeed).ratio() < 1.0);
    let (figure, reading) = found.worst();
    assert_eq!((figure, reading.frame), (Figure::HingeAcceleration, 2));
    // From 3 to 9 rad/s in a frame.
    assert!((reading.value - 180.0).abs() < 0.1, "{reading:?}");
    let (rig, knee) = robot_rig(None);
    assert!(judged_hinge(&rig, knee, &angles).is_feasible());
}

#[test]
fn other_bodies_have_no_hinges_to_judge() {
    let found = judged(&walk(20));
    for figure in [Figure::HingeSpeed, Figure::HingeAcceleration] {
        let reading = found.get(figure);
        assert_eq!((reading.value, reading.ratio()), (0.0, 0.0));
        assert_eq!(reading.limit, f32::INFINITY);
    }
}

proptest! {
    #[test]
    fn motion_within_the_limits_of_hinges_is_not_reported(
        steps in proptest::collection::vec(-0.99_f32..0.99, 1..30),
    ) {
        let (rig, knee) = robot_rig(None);
        let hinge = rig.skeleton.robot.as_ref().unwrap().hinges()[knee];
        let mut angles = vec![1.0];
        for step in steps {
            let next = angles[angles.len() - 1] + step * hinge.max_speed_rad_per_s / 30.0;
            angles.push(hinge.limited(next));
        }
        let found = judged_hinge(&rig, knee, &angles);
        prop_assert!(found.is_feasible(), "{:?}", found.worst());
    }
}

fn judge() -> Judge {
    Judge::new(&rig()).unwrap()
}

fn judged(clip: &Clip) -> Feasibility {
    judge().motion(&clip.root_positions, &clip.rotations)
}

/// The keyframe of a frame of a clip.
fn key(clip: &Clip, frame: usize) -> Key<'_> {
    let (root, pose) = (clip.root_positions[frame], clip.rotations_at(frame));
    Key {
        root: Some(GlobalRoot::of_pose(root, pose[0], clip.skeleton.left_axis)),
        rotations: Some(pose),
        ..Key::default()
    }
}

fn keys_of(clip: &Clip, targets: &[Key<'_>], frames: usize) -> Feasibility {
    let context: Vec<Key<'_>> = (0..4).map(|frame| key(clip, frame)).collect();
    judge().keys(&context, targets, frames)
}

#[test]
fn a_walk_is_feasible_and_its_figures_are_those_of_its_frames() {
    let clip = walk(60);
    let found = judged(&clip);
    assert!(found.is_feasible(), "{:?}", found.worst());
    let step = |f: usize| clip.root_positions[f] - clip.root_positions[f - 1];
    let fastest = (1..60)
        .map(|f| step(f).with_y(0.0).length() * 30.0)
        .fold(0.0, f32::max);
    assert!((found.get(Figure::RootSpeed).value - fastest).abs() < 1e-4);
    // 0.8 rad/s about the vertical, whatever the lean.
    assert!((found.get(Figure::Turning).value - 0.8).abs() < 0.01);
    assert!((found.get(Figure::Tilt).value - 0.05).abs() < 1e-3);
    let accelerations = (1..59).map(|f| (step(f + 1) - step(f)).length() * 900.0);
    let (frame, most) = accelerations.enumerate().fold(
        (0, 0.0),
        |most, (f, a)| if a > most.1 { (f + 1, a) } else { most },
    );
    let reading = found.get(Figure::RootAcceleration);
    assert_eq!(reading.frame, frame);
    assert!((reading.value - most).abs() < 1e-2);
}

#[test]
fn a_jump_of_the_root_is_named_with_its_frame() {
    let mut clip = stand(20);
    clip.root_positions[12..]
        .iter_mut()
        .for_each(|root| root.x += 1.0);
    let found = judged(&clip);
    assert!(!found.is_feasible());
    let (figure, reading) = found.worst();
    assert_eq!((figure, reading.frame), (Figure::RootAcceleration, 11));
    assert!((reading.value - 900.0).abs() < 0.1, "{reading:?}");
    let speed = found.get(Figure::RootSpeed);
    assert_eq!(speed.frame, 12);
    assert!((speed.ratio() - 15.0).abs() < 1e-3);
}

#[test]
fn the_ground_counts_below_and_above() {
    let mut sunk = stand(12);
    sunk.root_positions.iter_mut().for_each(|root| root.y -= 0.3);
    // Toes stand 2 cm over the ground.
    let reading = judged(&sunk).get(Figure::BelowGround);
    assert!((reading.value - 0.28).abs() < 1e-4 && reading.ratio() > 1.0);
    let mut high = stand(12);
    high.root_positions.iter_mut().for_each(|root| root.y += 1.0);
    let (figure, reading) = judged(&high).worst();
    assert_eq!(figure, Figure::OffGround);
    assert!((reading.value - 1.02).abs() < 1e-4);
}

#[test]
fn a_headstand_and_a_broken_spine_are_reported() {
    let mut head = stand(12);
    for frame in 0..12 {
        head.rotations_at_mut(frame)[0] = Quat::from_rotation_z(std::f32::consts::PI);
    }
    let tilt = judged(&head).get(Figure::Tilt);
    assert!((tilt.value - std::f32::consts::PI).abs() < 1e-3 && tilt.ratio() > 6.0);

    for (angle, beyond) in [(0.3, 0.0), (-1.0, 1.0 - 2.0 * 0.2_f32.asin())] {
        let mut bent = stand(12);
        bent.rotations_at_mut(5)[1] = -Quat::from_rotation_x(angle);
        let bend = judged(&bent).get(Figure::Bend);
        assert!((bend.value - beyond).abs() < 1e-4, "{bend:?}");
        assert!(beyond == 0.0 || bend.joint == Some(1) && bend.frame == 5);
    }
}

#[test]
fn a_target_is_within_reach_by_its_frames() {
    let clip = stand(4);
    let at = |x: f32| Key {
        root: Some(GlobalRoot::new(Vec3::new(x, 0.97, 0.0), 0.0)),
        ..Key::default()
    };
    // 14 frames: 11 from the last context frame to the target, with a limit of 0.5 m. 24 frames:
    // 21, and 1 m.
    for (x, frames, feasible) in [
        (0.49, 15, true),
        (0.51, 15, false),
        (0.99, 25, true),
        (1.01, 25, false),
        (1.4, 60, true),
    ] {
        let found = keys_of(&clip, &[at(x)], frames);
        assert_eq!(found.is_feasible(), feasible, "{x} {frames}: {:?}", found.worst());
        assert_eq!(found.get(Figure::RootReach).frame, frames - 1);
    }
    // A moving character gets farther in its direction, and not back.
    let mut walks = stand(4);
    (0..4).for_each(|f| walks.root_positions[f].x = 0.05 * f as f32);
    assert!(keys_of(&walks, &[at(1.15)], 25).is_feasible());
    assert!(!keys_of(&walks, &[at(0.1)], 25).is_feasible());
}

#[test]
fn turns_and_poses_have_a_reach() {
    let clip = stand(4);
    let turned = |heading: f32| Key {
        root: Some(GlobalRoot::new(Vec3::new(0.0, 0.97, 0.0), heading)),
        ..Key::default()
    };
    assert!(keys_of(&clip, &[turned(0.9)], 15).is_feasible());
    assert_eq!(keys_of(&clip, &[turned(1.1)], 15).worst().0, Figure::TurnReach);
    let mut other = stand(1);
    for leg in [2, 5] {
        other.rotations_at_mut(0)[leg] = Quat::from_rotation_x(1.5);
    }
    let found = keys_of(&clip, &[key(&other, 0)], 15);
    // Feet move by 0.9 m · 2 sin 0.75, and four of eight joints are below the knee.
    let pose = found.get(Figure::PoseReach);
    assert!(
        pose.value > 0.55 && pose.value < 0.75 && pose.ratio() > 1.0,
        "{pose:?}"
    );
}

#[test]
fn contradictory_targets_are_reported() {
    let clip = stand(20);
    let key_at = |x: f32| {
        let mut key = key(&clip, 0);
        key.root = Some(GlobalRoot::new(Vec3::new(x, 0.97, 0.0), 0.0));
        key
    };
    assert!(keys_of(&clip, &[key_at(0.0), key_at(0.03)], 40).is_feasible());
    let (figure, reading) = keys_of(&clip, &[key_at(0.0), key_at(0.5)], 40).worst();
    assert_eq!((figure, reading.frame), (Figure::RootSpeed, 39));
    assert!((reading.value - 15.0).abs() < 1e-3);
    // A velocity that contradicts its own places: 3 m/s in a frame are 90 m/s².
    let mut moving = key_at(0.0);
    moving.velocity = Some(LocalRoot {
        vx: 3.0,
        ..LocalRoot::default()
    });
    let (figure, reading) = keys_of(&clip, &[key_at(0.0), moving], 40).worst();
    assert_eq!(figure, Figure::RootAcceleration);
    assert!((reading.value - 90.0).abs() < 1e-2);
    let arrivals = judge().arrivals(&[moving], &clip.root_positions);
    assert!((arrivals.get(Figure::RootAcceleration).value - 90.0).abs() < 1e-2);
}

#[test]
fn parts_follow_one_another_and_frames_behind_a_gap_do_not() {
    let mut clip = stand(20);
    clip.root_positions[10..]
        .iter_mut()
        .for_each(|root| root.x += 1.0);
    let mut judge = judge();
    let push = |judge: &mut Judge, frames: std::ops::Range<usize>| {
        for frame in frames {
            let root = clip.root_positions[frame];
            judge.push(frame, Some(root), Some((root.y, clip.rotations_at(frame))));
        }
    };
    push(&mut judge, 0..10);
    assert!(judge.part().is_feasible());
    push(&mut judge, 10..20);
    assert_eq!(judge.take().get(Figure::RootSpeed).frame, 10);
    push(&mut judge, 0..10);
    assert!(judge.take().is_feasible());
    push(&mut judge, 10..20);
    assert!(judge.take().is_feasible(), "nothing leads there");
}

#[test]
fn what_is_no_number_is_not_feasible() {
    let mut clip = stand(12);
    clip.root_positions[6].x = f32::NAN;
    let found = judged(&clip);
    assert!(!found.is_feasible());
    assert_eq!(found.worst().1.ratio(), f32::INFINITY);
}

/// A change that makes a table invalid.
type Change<'a> = &'a dyn Fn(&mut LimitsDoc);

#[test]
fn tables_that_are_wrong_name_the_field() {
    let skeleton = biped();
    let message = |change: Change<'_>| {
        let mut doc = doc();
        change(&mut doc);
        Limits::new(&doc, &skeleton).unwrap_err().to_string()
    };
    let all: [(Change<'_>, &str); 7] = [
        (
            &|doc| doc.root_speed_mps = 0.0,
            "limits.root_speed_mps is 0; allowed: above 0",
        ),
        (&|doc| doc.tilt_rad = f32::NAN, "limits.tilt_rad is NaN"),
        (&|doc| doc.upright = Vec3::ZERO, "limits.upright is 0 long"),
        (
            &|doc| doc.reach_frames = vec![1, 1, 2],
            "limits.reach_frames is [1, 1, 2]",
        ),
        (
            &|doc| doc.pose_reach_m = vec![1.0],
            "limits.pose_reach_m is 1 long; allowed: 3",
        ),
        (
            &|doc| doc.bends[0].joint = "Hips".to_owned(),
            "limits.bends[0].joint is \"Hips\"",
        ),
        (&|doc| doc.bends[0].low.x = 0.5, "limits.bends[0].low"),
    ];
    for (change, wanted) in all {
        let message = message(change);
        assert!(message.contains(wanted), "{message}");
    }
    let twice = message(&|doc| doc.bends.push(doc.bends[0].clone()));
    assert!(twice.contains("limits.bends[1].joint"), "{twice}");
}

use std::f32::consts::PI;

use troupe_motion::bones::nearest_points;

use super::*;
use crate::live::behaviour::testing::{doll_rig, doll_style};

const FRAMES: usize = 40;
/// The shoulders of the doll.
const RIGHT: usize = 4;
const LEFT: usize = 7;

/// Stands while the left arm turns inwards by up to `inward` radians and back.
fn folds(inward: f32) -> (Vec<Vec3>, Vec<Quat>) {
    let mut rotations = Vec::new();
    for frame in 0..FRAMES {
        let share = (PI * frame as f32 / (FRAMES - 1) as f32).sin();
        let mut pose = doll_style().idle().rotations.clone();
        pose[LEFT] = Quat::from_rotation_z(-inward * share) * pose[LEFT];
        rotations.extend(pose);
    }
    (vec![Vec3::Y * 0.9; FRAMES], rotations)
}

/// Least distance of the left forearm to the trunk, metres, and largest acceleration of the hand,
/// m/s².
fn measure(roots: &[Vec3], rotations: &[Quat]) -> (f32, f32) {
    let rig = doll_rig();
    let torso = rig.torso.as_deref().unwrap();
    let arm = torso.arms.iter().find(|arm| arm[0] == LEFT).unwrap();
    let poses = rotations.chunks_exact(rig.dims.joints);
    let placed: Vec<Placed> = (roots.iter().zip(poses))
        .map(|(&root, pose)| Placed::of(&rig.skeleton, torso, *arm, root, pose))
        .collect();
    let apart = placed.iter().map(|placed| {
        let [a, b] = nearest_points([placed.arm[1], placed.arm[2]], placed.trunk);
        a.distance(b)
    });
    let bends = placed
        .windows(3)
        .map(|w| (w[2].arm[2] - w[1].arm[2] * 2.0 + w[0].arm[2]).length() * 900.0);
    (apart.fold(f32::INFINITY, f32::min), bends.fold(0.0, f32::max))
}

#[test]
fn a_forearm_that_would_pass_through_the_trunk_stays_off_it() {
    let rig = doll_rig();
    for inward in [0.25, 0.3, 0.35] {
        let (roots, mut rotations) = folds(inward);
        let before = (rotations.clone(), measure(&roots, &rotations));
        clear_arms(&rig, &roots, &mut rotations);
        let (nearest, bend) = measure(&roots, &rotations);
        assert!(
            before.1.0 < 0.08 && nearest > 0.9 * ARMS_APART_M,
            "{inward}: {:?} {nearest}",
            before.1
        );
        assert!(bend < before.1.1 + 15.0, "{inward}: {bend} m/s²");
        let joints = rig.dims.joints;
        for (now, was) in rotations.chunks_exact(joints).zip(before.0.chunks_exact(joints)) {
            let changed: Vec<usize> = (0..joints).filter(|&joint| now[joint] != was[joint]).collect();
            assert!(changed.is_empty() || changed == [LEFT], "{changed:?}");
            assert_eq!(now[RIGHT], was[RIGHT]);
        }
    }
}

#[test]
fn arms_that_are_off_the_trunk_are_unchanged() {
    let rig = doll_rig();
    let (roots, mut rotations) = folds(0.0);
    let before = rotations.clone();
    clear_arms(&rig, &roots, &mut rotations);
    assert_eq!(rotations, before);
}

#[test]
fn an_arm_in_the_trunk_itself_comes_out_on_its_own_side() {
    let rig = doll_rig();
    let (roots, mut rotations) = folds(0.5);
    clear_arms(&rig, &roots, &mut rotations);
    assert!(rotations.iter().all(|rotation| rotation.is_finite()));
    let (still, last) = folds(0.5);
    assert!(measure(&roots, &rotations).0 > measure(&still, &last).0);
}

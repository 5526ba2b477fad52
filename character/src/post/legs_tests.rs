use std::f32::consts::PI;

use troupe_motion::bones::nearest_points;

use super::*;
use crate::live::behaviour::testing::{doll_rig, doll_style};
use crate::post::apart::LEAVE_FRAMES;

const FRAMES: usize = 40;
const LEFT: usize = 10;
const RIGHT: usize = 13;

/// Stands on the right leg while the left swings ahead, turned by `inward` radians towards the
/// other on the way.
fn swing(inward: f32) -> (Vec<Vec3>, Vec<Quat>) {
    let mut rotations = Vec::new();
    for frame in 0..FRAMES {
        let share = frame as f32 / (FRAMES - 1) as f32;
        let mut pose = doll_style().idle().rotations.clone();
        let ahead = Quat::from_rotation_x(0.5 - share);
        pose[LEFT] = Quat::from_rotation_z(-inward * (PI * share).sin()) * ahead * pose[LEFT];
        rotations.extend(pose);
    }
    (vec![Vec3::Y * 0.9; FRAMES], rotations)
}

fn legs_of(rig: &Rig, root: Vec3, pose: &[Quat]) -> [[Vec3; 4]; 2] {
    [0, 1].map(|leg| points(&rig.skeleton, &rig.legs[leg], root, pose))
}

/// Least distance of the shins, metres, and largest acceleration of the left ankle, m/s².
fn measure(roots: &[Vec3], rotations: &[Quat]) -> (f32, f32) {
    let rig = doll_rig();
    let poses = rotations.chunks_exact(rig.dims.joints);
    let legs: Vec<_> = (roots.iter().zip(poses))
        .map(|(&root, pose)| legs_of(&rig, root, pose))
        .collect();
    let nearest = legs[LEAVE_FRAMES..].iter().map(|[left, right]| {
        let [a, b] = nearest_points([left[1], left[2]], [right[1], right[2]]);
        a.distance(b)
    });
    let bends = legs
        .windows(3)
        .map(|w| (w[2][0][2] - w[1][0][2] * 2.0 + w[0][0][2]).length() * 900.0);
    (nearest.fold(f32::INFINITY, f32::min), bends.fold(0.0, f32::max))
}

#[test]
fn a_leg_that_would_pass_through_the_other_goes_around_it() {
    let rig = doll_rig();
    for inward in [0.2, 0.24, 0.28] {
        let (roots, mut rotations) = swing(inward);
        let before = (rotations.clone(), measure(&roots, &rotations));
        part_legs(&rig, &roots, &mut rotations);
        let (nearest, bend) = measure(&roots, &rotations);
        assert!(
            before.1.0 < 0.05 && nearest > 0.9 * SHINS_APART_M,
            "{inward}: {:?} {nearest}",
            before.1
        );
        assert!(bend < before.1.1 + 15.0, "{inward}: {bend} m/s²");
        let joints = rig.dims.joints;
        for (now, was) in rotations.chunks_exact(joints).zip(before.0.chunks_exact(joints)) {
            assert_eq!(now[RIGHT..], was[RIGHT..], "the standing leg");
        }
    }
}

#[test]
fn legs_that_are_apart_or_stand_are_unchanged() {
    let rig = doll_rig();
    let (roots, mut rotations) = swing(0.0);
    let before = rotations.clone();
    part_legs(&rig, &roots, &mut rotations);
    assert_eq!(rotations, before);
    // One leg in front of the other all the time.
    let (roots, rotations) = swing(0.25);
    let joints = rig.dims.joints;
    let crossed = rotations[FRAMES / 2 * joints..][..joints].repeat(FRAMES);
    let mut rotations = crossed.clone();
    part_legs(&rig, &roots, &mut rotations);
    assert_eq!(rotations, crossed);
}

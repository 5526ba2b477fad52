//! A person with knees and elbows, and motions of it.

use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use crate::fk::{joint_transform, world_transforms};
use crate::skeleton::{ContactParams, Joint, Skeleton};

pub(crate) const HAND_L: usize = 8;
pub(crate) const HAND_R: usize = 12;
pub(crate) const LEG_L: [usize; 3] = [13, 14, 15];
pub(crate) const ARM_R: [usize; 3] = [10, 11, 12];
pub(crate) const JOINTS: usize = 21;
/// Height of the root of [`standing`], metres.
pub(crate) const STAND_M: f32 = 0.9259;

/// A person with the size and joints of the default pack, but with bones along the world's axes
/// and, at rest, arms to the sides.
pub(crate) fn person() -> Arc<Skeleton> {
    let arm = |side: f32| {
        [
            [side * 0.05, 0.13, 0.0],
            [side * 0.053, 0.0, 0.0],
            [side * 0.243, 0.0, 0.0],
            [side * 0.223, 0.0, 0.0],
        ]
    };
    let leg = |side: f32| {
        [
            [side * 0.065, -0.022, 0.0],
            [0.0, -0.391, 0.0],
            [0.0, -0.41, 0.0],
            [0.0, -0.075, 0.09],
        ]
    };
    let mut joints = Vec::new();
    let mut chain = |name: &str, parent: Option<usize>, offsets: &[[f32; 3]]| {
        for (nth, &offset) in offsets.iter().enumerate() {
            let last = joints.len().checked_sub(1);
            joints.push(Joint {
                name: format!("{name}{nth}"),
                parent: if nth == 0 { parent } else { last },
                offset_m: Vec3::from(offset),
            });
        }
    };
    chain(
        "Trunk",
        None,
        &[
            [0.0; 3],
            [0.0, 0.157, 0.0],
            [0.0, 0.09, 0.0],
            [0.0, 0.164, 0.0],
            [0.0, 0.065, 0.0],
        ],
    );
    chain("Arm_L", Some(2), &arm(1.0));
    chain("Arm_R", Some(2), &arm(-1.0));
    chain("Leg_L", Some(0), &leg(1.0));
    chain("Leg_R", Some(0), &leg(-1.0));
    let contacts = ContactParams {
        joints: vec![15, 16, 19, 20],
        max_height_m: vec![0.1674, 0.0925, 0.1674, 0.0925],
        max_speed_mps: 0.4,
        clearance_m: vec![0.1174, 0.0425, 0.1174, 0.0425],
    };
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
}

/// The standing person: arms down, knees almost straight, feet level.
pub(crate) fn standing() -> Vec<Quat> {
    let mut pose = vec![Quat::IDENTITY; JOINTS];
    pose[6] = Quat::from_rotation_z(-1.45);
    pose[10] = Quat::from_rotation_z(1.45);
    pose[7] = Quat::from_rotation_y(-0.2);
    pose[11] = Quat::from_rotation_y(0.2);
    for leg in [13, 17] {
        pose[leg] = Quat::from_rotation_x(-0.13);
        pose[leg + 1] = Quat::from_rotation_x(0.25);
        pose[leg + 2] = Quat::from_rotation_x(-0.12);
    }
    pose
}

/// The person walking along +Z at about 1.2 m/s for `frames` frames at 30 Hz. Feet slide while they
/// are in contact. Returns roots, rotations and contacts.
pub(crate) fn walk(frames: usize) -> (Vec<Vec3>, Vec<Quat>, Vec<u8>) {
    let (mut roots, mut rotations, mut contacts) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..frames {
        let t = frame as f32 / 30.0;
        let phase = t * 6.0;
        let mut pose = standing();
        let mut bits = 0;
        for (leg, phase, shift) in [(13, phase, 0), (17, phase + std::f32::consts::PI, 2)] {
            let swing = phase.sin();
            let lift = (phase.cos()).max(0.0);
            pose[leg] = Quat::from_rotation_x(-0.13 - 0.38 * swing - 0.3 * lift);
            pose[leg + 1] = Quat::from_rotation_x(0.25 + 0.9 * lift);
            pose[leg + 2] = Quat::from_rotation_x(-0.12 + 0.38 * swing - 0.6 * lift);
            if phase.cos() < -0.1 {
                bits |= 0b11 << shift;
            } else if phase.cos() < 0.1 {
                bits |= if swing > 0.0 { 0b01 } else { 0b10 } << shift;
            }
        }
        pose[0] = Quat::from_rotation_y(0.1 * phase.sin());
        roots.push(Vec3::new(0.02 * phase.sin(), STAND_M - 0.03, 1.25 * t));
        rotations.extend(pose);
        contacts.push(bits);
    }
    (roots, rotations, contacts)
}

/// World positions of a joint, one a frame.
pub(crate) fn track(skeleton: &Skeleton, roots: &[Vec3], rotations: &[Quat], joint: usize) -> Vec<Vec3> {
    let poses = rotations.chunks_exact(skeleton.joint_count());
    let frames = roots.iter().zip(poses);
    frames
        .map(|(&root, pose)| joint_transform(skeleton, root, pose, joint).0)
        .collect()
}

/// World positions of a frame's joints.
pub(crate) fn positions(skeleton: &Skeleton, root: Vec3, pose: &[Quat]) -> Vec<Vec3> {
    let mut positions = vec![Vec3::ZERO; skeleton.joint_count()];
    let mut rotations = vec![Quat::IDENTITY; skeleton.joint_count()];
    world_transforms(skeleton, root, pose, &mut positions, &mut rotations);
    positions
}

/// Largest change of a bone's length in any frame, metres.
pub(crate) fn stretch(skeleton: &Skeleton, rotations: &[Quat]) -> f32 {
    let mut worst = 0.0_f32;
    for pose in rotations.chunks_exact(skeleton.joint_count()) {
        let positions = positions(skeleton, Vec3::ZERO, pose);
        for (joint, place) in skeleton.joints.iter().zip(&positions) {
            if let Some(parent) = joint.parent {
                let change = place.distance(positions[parent]) - joint.offset_m.length();
                worst = worst.max(change.abs());
            }
        }
    }
    worst
}

/// Fastest movement of any joint between two frames, metres a frame.
pub(crate) fn fastest(skeleton: &Skeleton, roots: &[Vec3], rotations: &[Quat]) -> f32 {
    let mut worst = 0.0_f32;
    for joint in 0..skeleton.joint_count() {
        let track = track(skeleton, roots, rotations, joint);
        worst = track
            .windows(2)
            .map(|w| w[0].distance(w[1]))
            .fold(worst, f32::max);
    }
    worst
}

/// Whether rotations are equal bit for bit, apart from their sign.
pub(crate) fn same(a: &[Quat], b: &[Quat]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(&a, &b)| a == b || a == -b)
}

/// A pose near standing: every joint turned by up to about `most` radians, knees only in their
/// direction.
pub(crate) fn near_standing(most: f32) -> impl Strategy<Value = Vec<Quat>> {
    proptest::collection::vec([-most..most, -most..most, -most..most], JOINTS).prop_map(|turns| {
        let turned = turns.into_iter().zip(standing()).enumerate();
        turned
            .map(|(joint, (turn, pose))| {
                let turn = match joint {
                    14 | 18 => Vec3::X * turn[0].abs(),
                    _ => Vec3::from(turn),
                };
                (pose * Quat::from_scaled_axis(turn)).normalize()
            })
            .collect()
    })
}

/// A point in a cube around the origin.
pub(crate) fn place(most: f32) -> impl Strategy<Value = Vec3> {
    [-most..most, -most..most, -most..most].prop_map(Vec3::from)
}

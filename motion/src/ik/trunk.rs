//! Bowing.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

use super::{arms, forward, limbs};

/// The share of a bow that the pelvis takes; the rest of the trunk shares what is left.
const PELVIS_SHARE: f32 = 0.55;

/// What bows, and what hangs from it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trunk {
    /// From the pelvis up to the joint that the arms hang from.
    spine: Vec<usize>,
    /// The upper joints of the arms.
    arms: Vec<usize>,
}

impl Trunk {
    pub(crate) fn of(skeleton: &Skeleton) -> Self {
        Self {
            spine: limbs::spine(skeleton),
            arms: arms(skeleton).iter().map(|arm| arm[0]).collect(),
        }
    }

    /// Bows a pose forward about the level axis through its left by `angle` (radians), shared by the joints of the spine.
    /// Arms go on hanging as they did; legs turn with the pelvis.
    pub(crate) fn bow(&self, skeleton: &Skeleton, rotations: &mut [Quat], angle: f32) {
        if angle == 0.0 {
            return;
        }
        let left = Vec3::Y.cross(forward(skeleton, rotations));
        let rest = (1.0 - PELVIS_SHARE) / (self.spine.len().max(2) - 1) as f32;
        for (nth, &joint) in self.spine.iter().enumerate() {
            let share = match (nth, self.spine.len()) {
                (0, 1) => 1.0,
                (0, _) => PELVIS_SHARE,
                _ => rest,
            };
            let above = above(skeleton, rotations, joint);
            let turn = Quat::from_axis_angle(above.conjugate() * left, angle * share);
            rotations[joint] = align_sign((turn * rotations[joint]).normalize(), rotations[joint]);
        }
        let back = Quat::from_axis_angle(left, -angle);
        for &arm in &self.arms {
            let turned = joint_transform(skeleton, Vec3::ZERO, rotations, arm).1;
            turn_in_world(skeleton, rotations, arm, back * turned);
        }
    }
}

/// Turns a joint so that its rotation in the world is `world`.
pub(crate) fn turn_in_world(skeleton: &Skeleton, pose: &mut [Quat], joint: usize, world: Quat) {
    let local = (above(skeleton, pose, joint).conjugate() * world).normalize();
    pose[joint] = align_sign(local, pose[joint]);
}

/// The rotation in the world of what a joint hangs from.
fn above(skeleton: &Skeleton, pose: &[Quat], joint: usize) -> Quat {
    match skeleton.joints[joint].parent {
        Some(parent) => joint_transform(skeleton, Vec3::ZERO, pose, parent).1,
        None => Quat::IDENTITY,
    }
}

//! Bowing of the trunk.

use glam::{Quat, Vec3};

use crate::anatomy::{Limb, Parts};
use crate::fk::joint_transform;
use crate::robot::Robot;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

use super::two_bone::{turn_hinges, turn_limb};
use super::{arms, forward, limbs};

/// Share of a bow that the pelvis takes; the rest of the trunk shares the remainder.
const PELVIS_SHARE: f32 = 0.55;

/// The joints that bow, and the limbs below them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Trunk {
    /// From the pelvis up to the parent of the arms.
    spine: Vec<usize>,
    arms: Vec<[usize; 3]>,
}

impl Trunk {
    pub(crate) fn of(skeleton: &Skeleton) -> Self {
        Self {
            spine: limbs::spine(skeleton),
            arms: arms(skeleton),
        }
    }

    /// The trunk of a body whose parts are known.
    pub(crate) fn of_parts(parts: &Parts) -> Self {
        Self {
            spine: parts.trunk.clone(),
            arms: parts.arms.iter().flatten().map(Limb::chain).collect(),
        }
    }

    /// Bows a pose forward by `angle` (radians) about the level axis through its left, shared by
    /// the joints of the spine. Arms keep hanging as before; legs turn with the pelvis. A robot's
    /// trunk bows as far as its hinges allow.
    pub(crate) fn bow(&self, skeleton: &Skeleton, rotations: &mut [Quat], angle: f32) {
        if angle == 0.0 {
            return;
        }
        let left = Vec3::Y.cross(forward(skeleton, rotations));
        match &skeleton.robot {
            Some(robot) => self.bow_hinges((skeleton, robot), rotations, (left, angle)),
            None => self.bow_spine(skeleton, rotations, (left, angle)),
        }
        let back = Quat::from_axis_angle(left, -angle);
        for &arm in &self.arms {
            turn_limb(skeleton, rotations, arm, back);
        }
    }

    fn bow_spine(&self, skeleton: &Skeleton, rotations: &mut [Quat], (left, angle): (Vec3, f32)) {
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
    }

    fn bow_hinges(
        &self,
        (skeleton, robot): (&Skeleton, &Robot),
        rotations: &mut [Quat],
        (left, angle): (Vec3, f32),
    ) {
        let chest = self.spine[self.spine.len() - 1];
        let bowed = joint_transform(skeleton, Vec3::ZERO, rotations, chest).1;
        let bowed = Quat::from_axis_angle(left, angle) * bowed;
        let share = if chest == 0 { 1.0 } else { PELVIS_SHARE };
        let turn = Quat::from_axis_angle(left, angle * share);
        rotations[0] = align_sign((turn * rotations[0]).normalize(), rotations[0]);
        if chest != 0 {
            turn_hinges((skeleton, robot), rotations, (self.spine[1], chest), bowed);
        }
    }
}

/// Turns a joint so that its rotation in the world becomes `world`.
pub(crate) fn turn_in_world(skeleton: &Skeleton, pose: &mut [Quat], joint: usize, world: Quat) {
    let local = (above(skeleton, pose, joint).conjugate() * world).normalize();
    pose[joint] = align_sign(local, pose[joint]);
}

/// World rotation of a joint's parent.
fn above(skeleton: &Skeleton, pose: &[Quat], joint: usize) -> Quat {
    match skeleton.joints[joint].parent {
        Some(parent) => joint_transform(skeleton, Vec3::ZERO, pose, parent).1,
        None => Quat::IDENTITY,
    }
}

//! Inverse kinematics on finished poses: limbs of two bones ([`two_bone`]), standing feet
//! ([`lock_feet`]), and poses from a few points ([`reach_pose`]).
//!
//! Nothing here knows joints by name. Legs are found by walking up from the skeleton's contact
//! joints ([`legs`]), arms ([`arms`]) by their shape. Limbs of robots bend by their hinges, within
//! the hinges' limits. Rotations are flat and frame-major, joint 0 in the world and the others
//! parent-relative. Contacts have one byte a frame, bit `i` for contact joint `i`. Bones never
//! stretch: a limb comes as near to a goal out of reach as it can, and the remaining distance is
//! returned. Goals, roots and points that are not finite change nothing, and their distance is
//! infinite. New rotations keep the hemisphere of those they replace.

mod hinges;
mod limbs;
mod lock;
mod plant;
mod reach;
mod smooth;
mod three;
mod trunk;
mod two_bone;

#[cfg(test)]
mod hinges_tests;
#[cfg(test)]
mod lock_tests;
#[cfg(test)]
mod reach_tests;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod two_bone_tests;

use glam::{Quat, Vec3};

use crate::interpolate::smoothstep;
use crate::root::GlobalRoot;
use crate::rotation::{align_sign, slerp};
use crate::skeleton::Skeleton;

pub use limbs::{Leg, MAX_LEGS, Torso, arm_of, arms, legs};
pub use lock::{FootLock, Locked, lock_feet};
pub use plant::{Carried, FootPlant, Planted, plant_feet};
pub use reach::{ReachOptions, Reached, pose_at, reach_pose};
pub use two_bone::{place_end, two_bone, two_bone_soft};

pub(crate) use limbs::{LegTrack, is_below};
pub(crate) use lock::excess_height;
pub(crate) use smooth::{cover, smooth, spans};
pub(crate) use trunk::Trunk;
pub(crate) use two_bone::{bend_by, side_of, turn_hinges, turn_limb};

/// One frame of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posed<'a> {
    /// World position of joint 0, metres.
    pub root: Vec3,
    /// One rotation a joint, joint 0 in the world and the others parent-relative.
    pub rotations: &'a [Quat],
}

impl Posed<'_> {
    /// Whether it has a rotation for every joint.
    pub(crate) fn fits(&self, skeleton: &Skeleton) -> bool {
        self.rotations.len() >= skeleton.joint_count()
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.root.is_finite() && self.rotations.iter().all(|q| q.is_finite())
    }

    /// Direction of the pelvis on the ground, unit length.
    pub(crate) fn forward(&self, skeleton: &Skeleton) -> Vec3 {
        forward(skeleton, self.rotations)
    }
}

/// Direction of a pose's pelvis on the ground, unit length.
pub(crate) fn forward(skeleton: &Skeleton, rotations: &[Quat]) -> Vec3 {
    GlobalRoot::of_pose(Vec3::ZERO, rotations[0], skeleton.left_axis).forward()
}

/// Frames that were constructed, without a generator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// World positions of joint 0, one a frame, metres.
    pub roots: Vec<Vec3>,
    /// `frames * joints` rotations, joint 0 in the world and the others parent-relative.
    pub rotations: Vec<Quat>,
    /// Contacts, one byte a frame: the standing feet.
    pub contacts: Vec<u8>,
    /// Farthest that a leg remained from where its foot is held, metres.
    pub short_m: f32,
}

impl Motion {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.roots.len()
    }

    /// An empty motion with memory for `frames` frames of `joints` joints.
    pub(crate) fn with_capacity(frames: usize, joints: usize) -> Self {
        Self {
            roots: Vec::with_capacity(frames),
            rotations: Vec::with_capacity(frames * joints),
            contacts: Vec::with_capacity(frames),
            short_m: 0.0,
        }
    }

    /// Appends a copy of `pose`. Each rotation takes the hemisphere of the last frame, or of
    /// `first` if there is none.
    pub(crate) fn push(&mut self, root: Vec3, pose: &[Quat], contacts: u8, first: &[Quat]) {
        let joints = pose.len();
        let before = self.rotations.len().checked_sub(joints);
        for (joint, &rotation) in pose.iter().enumerate() {
            let reference = before.map_or(first[joint], |at| self.rotations[at + joint]);
            self.rotations.push(align_sign(rotation, reference));
        }
        self.roots.push(root);
        self.contacts.push(contacts);
    }
}

/// Fades the last `frames` frames (at least one) of a motion into a still pose with a smoothstep,
/// roots and rotations. The last frame is exactly the pose, up to the signs of its quaternions,
/// which follow the frame before.
///
/// `rotations` has `joints` rotations for each of `roots`. A root or pose that is too short or not
/// finite changes nothing.
pub fn settle(
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    joints: usize,
    root: Vec3,
    pose: &[Quat],
    frames: usize,
) {
    let count = roots.len().min(rotations.len() / joints.max(1));
    let finite = root.is_finite() && pose.iter().all(|q| q.is_finite());
    if joints == 0 || count == 0 || pose.len() < joints || !finite {
        return;
    }
    let frames = frames.clamp(1, count);
    for step in 1..frames {
        let (frame, weight) = (count - 1 + step - frames, smoothstep(step as f32 / frames as f32));
        roots[frame] = roots[frame].lerp(root, weight);
        for (made, &given) in rotations[frame * joints..][..joints].iter_mut().zip(pose) {
            *made = slerp(*made, given, weight);
        }
    }
    let last = count - 1;
    roots[last] = root;
    for (joint, &given) in pose[..joints].iter().enumerate() {
        let at = last * joints + joint;
        let before = rotations[at.checked_sub(joints).unwrap_or(at)];
        rotations[at] = align_sign(given, before);
    }
}

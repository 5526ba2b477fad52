//! The neutral pose of a file's body, for models of many bodies: upright, heading along +Z, limbs
//! hanging down.

use glam::Quat;

use super::Understood;
use super::report::RestPose;
use crate::anatomy::{Biped, Tree, let_down, stand_up};
use crate::clip::Clip;
use crate::root::heading_of;
use crate::rotation::{align_sign, yaw};
use crate::skeleton::Skeleton;

impl Understood {
    /// World rotations of the neutral pose, one a joint.
    ///
    /// It is the rest pose if the body stands in it; the limbs of a T-pose or an A-pose are let
    /// down. A body on two legs whose rest pose is no stance has it by its average pose, with trunk
    /// and limbs straightened. Other bodies keep their rest pose. It is none for a clip on a given
    /// skeleton.
    pub fn neutral_pose(&self) -> Option<Vec<Quat>> {
        let skeleton = &*self.clip.skeleton;
        let rest = self.rest.as_ref()?;
        let ahead = |pose| ahead(skeleton, pose);
        Some(
            match (Biped::find(&Tree::of(skeleton)), self.report.rest_pose.value) {
                (Some(body), RestPose::None) => neutral_of_motion(&self.clip, &body),
                (Some(body), RestPose::T | RestPose::A) => {
                    let_down(skeleton, &body, &ahead(world_of(skeleton, rest)))
                }
                _ => ahead(world_of(skeleton, rest)),
            },
        )
    }
}

/// The average pose of a clip, with trunk and limbs straightened.
pub(super) fn neutral_of_motion(clip: &Clip, body: &Biped) -> Vec<Quat> {
    stand_up(&clip.skeleton, body, &ahead(&clip.skeleton, average_pose(clip)))
}

/// World rotations turned to head along +Z.
fn ahead(skeleton: &Skeleton, pose: Vec<Quat>) -> Vec<Quat> {
    let turn = yaw(-heading_of(pose[0], skeleton.left_axis));
    let turned = pose.into_iter().map(|rotation| (turn * rotation).normalize());
    turned.collect()
}

/// World rotations of a pose: joint 0 in the world, others relative to their parents.
fn world_of(skeleton: &Skeleton, local: &[Quat]) -> Vec<Quat> {
    let mut world: Vec<Quat> = Vec::with_capacity(local.len());
    for (joint, rotation) in skeleton.joints.iter().zip(local) {
        world.push(joint.parent.map_or(*rotation, |parent| world[parent] * *rotation));
    }
    world
}

/// The mean of the world rotations of all frames, each turned to the heading 0.
fn average_pose(clip: &Clip) -> Vec<Quat> {
    let mut sums = vec![Quat::from_xyzw(0.0, 0.0, 0.0, 0.0); clip.skeleton.joint_count()];
    for frame in 0..clip.frames() {
        let mut pose = clip.rotations_at(frame).to_vec();
        pose[0] = yaw(-clip.root_at(frame).heading) * pose[0];
        for (sum, rotation) in sums.iter_mut().zip(world_of(&clip.skeleton, &pose)) {
            *sum = *sum + align_sign(rotation, *sum);
        }
    }
    let unit = |sum: Quat| {
        if sum.length() > 1e-6 {
            sum.normalize()
        } else {
            Quat::IDENTITY
        }
    };
    sums.into_iter().map(unit).collect()
}

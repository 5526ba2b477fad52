//! The neutral pose of a file's body, for models of many bodies: upright, heading along +Z, limbs
//! hanging down.

use glam::Quat;

use super::Understood;
use super::report::RestPose;
use crate::anatomy::{Biped, Tree, ahead, let_down, neutral_of_motion, world_of};

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

//! The figure of a file's body, for retargeting.

use std::sync::Arc;

use glam::Quat;

use super::Understood;
use super::neutral::neutral_of_motion;
use super::report::RestPose;
use crate::anatomy::{Biped, PartsDoc, Tree};
use crate::retarget::{Figure, RetargetError};

impl Understood {
    /// The body as the retargeter sees it, by the rest pose, or by the motion if the rest pose is
    /// no stance. `doc` corrects the parts that are found.
    ///
    /// # Errors
    /// [`RetargetError`] if no body is found, or if it stands neither at rest nor in the motion.
    pub fn figure(&self, doc: &PartsDoc) -> Result<Figure, RetargetError> {
        let skeleton = &self.clip.skeleton;
        let joints = skeleton.joint_count();
        if skeleton.robot.is_some() {
            return Figure::of_robot(Arc::clone(skeleton), doc);
        }
        let stands = self.rest.is_some() && self.report.rest_pose.value != RestPose::None;
        match Biped::find(&Tree::of(skeleton)) {
            Some(body) if !stands && self.clip.frames() > 1 => {
                Figure::of_motion(&self.clip, neutral_of_motion(&self.clip, &body), doc)
            }
            _ => {
                let still = vec![Quat::IDENTITY; joints];
                let rest = self.rest.as_deref().unwrap_or(&still);
                // A character at rest stands on the ground of its file.
                let is_at_rest = self.clip.frames() == 1 && self.rest.is_some();
                let root_y_m = self.clip.root_positions[0].y - skeleton.ground_y_m;
                Figure::new(Arc::clone(skeleton), rest, is_at_rest.then_some(root_y_m), doc)
            }
        }
    }
}

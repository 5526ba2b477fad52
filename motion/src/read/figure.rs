//! The figure of a file's body, for retargeting.

use std::sync::Arc;

use glam::Quat;

use super::Understood;
use super::report::RestPose;
use crate::anatomy::PartsDoc;
use crate::retarget::{Figure, RetargetError};

/// Smaller angles between two rotations are none, radians.
const SAME_RAD: f32 = 1e-2;

impl Understood {
    /// The body as the retargeter sees it, by the rest pose, or by the motion if the rest pose is
    /// no stance. Parts are those that `doc` names, then those that the file itself names, then
    /// those that are found. The body stands on the ground of its file if its feet are near it.
    ///
    /// # Errors
    /// [`RetargetError`] if no body is found, or if it stands neither at rest nor in the motion.
    pub fn figure(&self, doc: &PartsDoc) -> Result<Figure, RetargetError> {
        let doc = &doc.clone().or(self.parts.clone());
        let stands = self.report.rest_pose.value != RestPose::None;
        match &self.rest {
            Some(rest) if stands || self.is_at_rest(rest) => {
                let skeleton = Arc::clone(&self.clip.skeleton);
                let ground_y_m = skeleton.ground_y_m;
                let root_y_m = self.rest_root_y_m.map(|root_y_m| root_y_m - ground_y_m);
                Figure::resting(skeleton, rest, root_y_m, doc)
            }
            rest => Figure::of_clip(&self.clip, rest.as_deref(), doc),
        }
    }

    /// Whether the clip is the rest pose, as that of a character's file is. A single frame may be
    /// any other pose.
    fn is_at_rest(&self, rest: &[Quat]) -> bool {
        let mut joints = self.clip.rotations_at(0).iter().zip(rest);
        self.clip.frames() == 1 && joints.all(|(turn, rest)| turn.angle_between(*rest) < SAME_RAD)
    }
}

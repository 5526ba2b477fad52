//! The figure of a file's body, for retargeting.

use std::sync::Arc;

use super::Understood;
use super::report::RestPose;
use crate::anatomy::PartsDoc;
use crate::retarget::{Figure, RetargetError};

impl Understood {
    /// The body as the retargeter sees it, by the rest pose, or by the motion if the rest pose is
    /// no stance. Parts are those that `doc` names, then those that the file itself names, then
    /// those that are found.
    ///
    /// # Errors
    /// [`RetargetError`] if no body is found, or if it stands neither at rest nor in the motion.
    pub fn figure(&self, doc: &PartsDoc) -> Result<Figure, RetargetError> {
        let doc = &doc.clone().or(self.parts.clone());
        let stands = self.report.rest_pose.value != RestPose::None;
        match &self.rest {
            Some(rest) if stands || self.clip.frames() == 1 => {
                let skeleton = Arc::clone(&self.clip.skeleton);
                // A character at rest stands on the ground of its file.
                let root_y_m = self.clip.root_positions[0].y - skeleton.ground_y_m;
                let is_at_rest = self.clip.frames() == 1;
                Figure::new(skeleton, rest, is_at_rest.then_some(root_y_m), doc)
            }
            rest => Figure::of_clip(&self.clip, rest.as_deref(), doc),
        }
    }
}

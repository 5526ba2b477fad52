//! Joints that follow hinges: they turn by a multiple of another joint's angle, and have no number
//! of their own in a `qpos`.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{Robot, RobotError};
use crate::rotation::{from_wxyz, to_wxyz};
use crate::skeleton::Skeleton;

/// A joint that follows a hinge, as written, with joints by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MimicDoc {
    /// Name of a joint of the skeleton, which has no hinge.
    pub joint: String,
    /// Name of the joint whose hinge it follows; it comes before.
    pub follows: String,
    /// Its angle is `multiplier * angle + offset_rad`.
    pub multiplier: f32,
    /// Its angle where that of the hinge is 0, radians.
    pub offset_rad: f32,
    /// The axis in the joint's own frame of reference, native axes, unit length.
    pub axis: Vec3,
    /// (w, x, y, z): the joint's rotation relative to its parent at angle 0, native axes.
    pub rest: [f32; 4],
}

/// A joint that follows a hinge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the joint in the skeleton.
    pub joint: usize,
    /// Index of the hinge.
    pub hinge: usize,
    /// Its angle is `multiplier * angle + offset_rad`.
    pub multiplier: f32,
    /// Its angle where that of the hinge is 0, radians.
    pub offset_rad: f32,
    /// The axis in the joint's own frame of reference, unit length.
    pub axis: Vec3,
    /// The joint's rotation relative to its parent at angle 0.
    pub rest: Quat,
}

impl Mimic {
    /// The joint's rotation relative to its parent at an angle of the hinge that it follows.
    #[inline]
    pub fn rotation(&self, angle: f32) -> Quat {
        let angle = self.multiplier * angle + self.offset_rad;
        self.rest * Quat::from_axis_angle(self.axis, angle)
    }

    pub(super) fn doc(&self, robot: &Robot, skeleton: &Skeleton) -> MimicDoc {
        MimicDoc {
            joint: skeleton.joints[self.joint].name.clone(),
            follows: skeleton.joints[robot.hinges[self.hinge].joint].name.clone(),
            multiplier: self.multiplier,
            offset_rad: self.offset_rad,
            axis: self.axis,
            rest: to_wxyz(self.rest),
        }
    }
}

impl Robot {
    /// The robot with joints that follow its hinges.
    ///
    /// # Errors
    /// [`RobotError::Mimic`] if a joint is not there or has a hinge, or follows one that comes
    /// after it.
    pub(super) fn with_mimics(
        mut self,
        mimics: &[MimicDoc],
        skeleton: &Skeleton,
    ) -> Result<Self, RobotError> {
        for doc in mimics {
            let wrong = |reason: &str| {
                Err(RobotError::Mimic {
                    joint: doc.joint.clone(),
                    reason: reason.to_owned(),
                })
            };
            let Some(joint) = skeleton.joint_index(&doc.joint).filter(|&joint| joint > 0) else {
                return wrong("it is no joint of the skeleton that has a parent");
            };
            if self.links[joint].hinge.is_some() || self.links[joint].mimic.is_some() {
                return wrong("it has a hinge, or follows another already");
            }
            let follows = skeleton.joint_index(&doc.follows);
            let hinge = follows.filter(|&of| of < joint).and_then(|of| self.hinge_of(of));
            let Some(hinge) = hinge else {
                return wrong(&format!(
                    "it follows {:?}, which is no hinge that comes before it",
                    doc.follows
                ));
            };
            let rest = from_wxyz(doc.rest);
            let is_unit = |length: f32| (length - 1.0).abs() <= 1e-3;
            let is_finite = doc.multiplier.is_finite() && doc.offset_rad.is_finite();
            if !(is_unit(doc.axis.length()) && is_unit(rest.length()) && is_finite) {
                return wrong("its axis or rest is not of unit length, or a number not finite");
            }
            self.links[joint].mimic = Some(self.mimics.len());
            self.mimics.push(Mimic {
                joint,
                hinge,
                multiplier: doc.multiplier,
                offset_rad: doc.offset_rad,
                axis: doc.axis.normalize(),
                rest: rest.normalize(),
            });
        }
        Ok(self)
    }
}

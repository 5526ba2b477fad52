//! Options that decide what a file leaves open.

use std::sync::Arc;

use super::agreement::Agreement;
use super::report::{RestPose, Up};
use crate::skeleton::Skeleton;

/// Order of a robot's quaternion in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuaternionOrder {
    /// x y z w: Unitree's CSV, ROS.
    Xyzw,
    /// w x y z: MuJoCo, Kimodo.
    Wxyz,
}

impl QuaternionOrder {
    /// The order that is written `xyzw` or `wxyz`.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "xyzw" => Some(Self::Xyzw),
            "wxyz" => Some(Self::Wxyz),
            _ => None,
        }
    }
}

/// Unit of a robot's angles in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum AngleUnit {
    Radians,
    Degrees,
}

/// Order of a robot's hinges in its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JointOrder {
    /// The pack's: MuJoCo's, limb by limb.
    Tree,
    /// Isaac Lab's: all hinges nearest to the root, then the next.
    BreadthFirst,
    /// The names of the hinges' joints, one a column.
    Named(Vec<String>),
}

impl JointOrder {
    /// The order that is written `tree`, `isaaclab`, or as the names of joints between commas.
    pub fn of_name(name: &str) -> Self {
        match name {
            "tree" => Self::Tree,
            "isaaclab" => Self::BreadthFirst,
            names => Self::Named(names.split(',').map(|name| name.trim().to_owned()).collect()),
        }
    }
}

/// Whether a pose before the motion is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LeadingPose {
    /// The first frame is left out if it is the rest pose and the second is far from it.
    #[default]
    Find,
    /// All frames are kept.
    Keep,
    /// The first frame is left out.
    Drop,
}

impl LeadingPose {
    /// What is written `find`, `keep` or `drop`.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "find" => Some(Self::Find),
            "keep" => Some(Self::Keep),
            "drop" => Some(Self::Drop),
            _ => None,
        }
    }
}

/// Options for reading. Each decides what a file may leave open; an error names the one that it
/// needs.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The axis that points up (`--up`).
    pub up: Option<Up>,
    /// Metres a unit of the file (`--unit`).
    pub unit_m: Option<f64>,
    /// Frames a second of the file (`--fps`); for glTF, the rate at which it is sampled.
    pub fps: Option<f32>,
    /// Rate to which the clip is brought, Hz: rotations by slerp, the root along straight lines.
    pub resample_fps: Option<f32>,
    /// Name of a glTF file's animation (`--animation`).
    pub animation: Option<String>,
    /// Reads the rest pose of a glTF file's skins as one frame, and no animation.
    pub at_rest: bool,
    /// Name of the joint that is the character's root (`--root`).
    pub root: Option<String>,
    /// The rest pose of the file's skeleton (`--rest-pose`).
    pub rest_pose: Option<RestPose>,
    /// Whether a pose before the motion is kept (`--leading-pose`).
    pub leading_pose: LeadingPose,
    /// Farthest that a joint may move in its parent and still be held there, metres
    /// (`--max-slide`). `None`: 20 % of the body's height. Joints that move more than 2 % are named
    /// in the report.
    pub max_slide_m: Option<f32>,
    /// Whether joints' names lose what stands before a `:` or `|`.
    pub strip_namespaces: bool,
    /// The skeleton to read onto, joints by name. `None`: the file's own. Robots' files need one.
    pub skeleton: Option<Arc<Skeleton>>,
    /// Whether the file's bones may differ from the skeleton's in length (`--other-bones`).
    pub other_bones: bool,
    /// Order of a robot's quaternion (`--quaternion`).
    pub quaternion: Option<QuaternionOrder>,
    /// Unit of a robot's angles (`--degrees`).
    pub angles: Option<AngleUnit>,
    /// Order of a robot's hinges (`--joint-order`).
    pub joint_order: Option<JointOrder>,
    /// What the other files of the folder show.
    pub agreement: Option<Agreement>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_have_the_names_of_a_command_line() {
        assert_eq!(QuaternionOrder::of_name("wxyz"), Some(QuaternionOrder::Wxyz));
        assert_eq!(QuaternionOrder::of_name("wzyx"), None);
        assert_eq!(JointOrder::of_name("isaaclab"), JointOrder::BreadthFirst);
        let named = JointOrder::of_name("left_hip, left_knee");
        assert_eq!(
            named,
            JointOrder::Named(vec!["left_hip".to_owned(), "left_knee".to_owned()])
        );
        assert_eq!(LeadingPose::of_name("drop"), Some(LeadingPose::Drop));
        for up in Up::ALL {
            assert_eq!(Up::of_name(up.name()), Some(up));
        }
        assert_eq!(RestPose::of_name("standing"), Some(RestPose::Standing));
        assert_eq!(RestPose::of_name("sitting"), None);
    }
}

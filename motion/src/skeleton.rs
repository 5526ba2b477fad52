//! The skeleton: joints with parents and offsets, the pelvis' left axis, the ground, and the
//! contact joints.

use std::collections::HashMap;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::robot::{Robot, RobotDoc, RobotError};

/// Most joints of a skeleton.
pub const MAX_JOINTS: usize = 512;
/// Most bytes of a joint's name in a file that is read.
pub const MAX_NAME_BYTES: usize = 256;

/// One joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique, not empty.
    pub name: String,
    /// Index of the parent, smaller than the joint's own; `None` for joint 0 only.
    pub parent: Option<usize>,
    /// Offset from the parent in the parent's frame of reference, metres. Ignored for joint 0,
    /// whose place is the root position.
    pub offset_m: Vec3,
}

/// The joints that touch the ground, and when they count as touching it. The lists have one entry
/// for each contact joint.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactParams {
    /// Indices of the contact joints.
    pub joints: Vec<usize>,
    /// A joint is in contact only below this height over the ground, metres.
    pub max_height_m: Vec<f32>,
    /// A joint is in contact only below this speed (in 3D), m/s.
    pub max_speed_mps: f32,
    /// Height of the joint over the ground when it rests there, metres.
    pub clearance_m: Vec<f32>,
}

/// A validated joint hierarchy. With serde it is the `[skeleton]` table of a pack's `pack.toml`,
/// with parents and contact joints by name. A robot's hinges have a separate table ([`RobotDoc`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SkeletonDoc", into = "SkeletonDoc")]
#[non_exhaustive]
pub struct Skeleton {
    /// Parents before children; joint 0 is the root (the pelvis).
    pub joints: Vec<Joint>,
    /// Direction of the character's left in the pelvis' own frame of reference, unit length.
    pub left_axis: Vec3,
    /// Height of the ground plane in the world, metres.
    pub ground_y_m: f32,
    /// The contact joints, if the skeleton has any.
    pub contacts: Option<ContactParams>,
    /// The hinges, if it is a robot.
    pub robot: Option<Robot>,
}

/// Why a skeleton was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// No joints.
    #[error("a skeleton needs at least one joint")]
    Empty,
    /// More than [`MAX_JOINTS`].
    #[error("{0} joints, but at most {MAX_JOINTS} are supported")]
    TooManyJoints(usize),
    /// A joint without a name.
    #[error("joint {0} has no name")]
    EmptyName(usize),
    /// Two joints have the same name.
    #[error("the name {0:?} is used by more than one joint")]
    DuplicateName(String),
    /// Joint 0 has a parent.
    #[error("the first joint {0:?} must be the root, but it has a parent")]
    RootHasParent(String),
    /// A joint other than joint 0 has no parent.
    #[error("joint {0:?} has no parent, but only the first joint may be a root")]
    SecondRoot(String),
    /// A parent that does not come before its child.
    #[error("the parent of joint {0:?} does not come before it")]
    ParentNotBefore(String),
    /// The skeleton has no joint of this name.
    #[error("{field} names {name:?}, which is no joint of the skeleton")]
    UnknownJoint {
        /// The field that has the name.
        field: &'static str,
        /// The unknown name.
        name: String,
    },
    /// An offset is NaN or infinite.
    #[error("the offset of joint {0:?} is not finite")]
    NonFiniteOffset(String),
    /// The left axis is not of unit length.
    #[error("left_axis must have unit length within 0.001, but its length is {0}")]
    LeftAxis(f32),
    /// The ground height is not finite.
    #[error("ground_y_m is not finite")]
    Ground,
    /// The contact lists have different lengths.
    #[error("contacts.{field} has {found} entries for {expected} contact joints")]
    ContactLength {
        /// Name of the list.
        field: &'static str,
        /// Number of its entries.
        found: usize,
        /// Number of contact joints.
        expected: usize,
    },
    /// A contact joint is out of range, or comes twice.
    #[error("contact joint {0} is out of range or given twice")]
    ContactJoint(usize),
    /// A contact threshold is not finite, or the speed not positive.
    #[error("contacts.{0} must be finite, and a speed positive")]
    ContactValue(&'static str),
}

impl Skeleton {
    /// Checks and builds a skeleton.
    ///
    /// # Errors
    /// Any [`SkeletonError`], with the joint or field.
    pub fn new(
        joints: Vec<Joint>,
        left_axis: Vec3,
        ground_y_m: f32,
        contacts: Option<ContactParams>,
    ) -> Result<Self, SkeletonError> {
        check_joints(&joints)?;
        let length = left_axis.length();
        if length.is_nan() || (length - 1.0).abs() > 1e-3 {
            return Err(SkeletonError::LeftAxis(length));
        }
        if !ground_y_m.is_finite() {
            return Err(SkeletonError::Ground);
        }
        if let Some(contacts) = &contacts {
            contacts.check(joints.len())?;
        }
        Ok(Self {
            joints,
            left_axis: left_axis / length,
            ground_y_m,
            contacts,
            robot: None,
        })
    }

    /// The skeleton of a robot with the hinges of `robot`.
    ///
    /// # Errors
    /// [`RobotError`], with field and range.
    pub fn with_robot(mut self, robot: &RobotDoc) -> Result<Self, RobotError> {
        self.robot = Some(robot.on(&self)?);
        Ok(self)
    }

    /// Number of joints.
    #[inline]
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Index of the joint named `name`.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name)
    }
}

impl ContactParams {
    /// Number of contact joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether there are no contact joints.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    fn check(&self, joint_count: usize) -> Result<(), SkeletonError> {
        let expected = self.joints.len();
        for (field, list) in [
            ("max_height_m", &self.max_height_m),
            ("clearance_m", &self.clearance_m),
        ] {
            if list.len() != expected {
                return Err(SkeletonError::ContactLength {
                    field,
                    found: list.len(),
                    expected,
                });
            }
            if list.iter().any(|v| !v.is_finite()) {
                return Err(SkeletonError::ContactValue(field));
            }
        }
        for (i, &joint) in self.joints.iter().enumerate() {
            if joint >= joint_count || self.joints[..i].contains(&joint) {
                return Err(SkeletonError::ContactJoint(joint));
            }
        }
        if !(self.max_speed_mps.is_finite() && self.max_speed_mps > 0.0) {
            return Err(SkeletonError::ContactValue("max_speed_mps"));
        }
        Ok(())
    }
}

fn check_joints(joints: &[Joint]) -> Result<(), SkeletonError> {
    if joints.is_empty() {
        return Err(SkeletonError::Empty);
    }
    if joints.len() > MAX_JOINTS {
        return Err(SkeletonError::TooManyJoints(joints.len()));
    }
    let mut seen = std::collections::HashSet::with_capacity(joints.len());
    for (index, joint) in joints.iter().enumerate() {
        let name = || joint.name.clone();
        if joint.name.is_empty() {
            return Err(SkeletonError::EmptyName(index));
        }
        if !seen.insert(joint.name.as_str()) {
            return Err(SkeletonError::DuplicateName(name()));
        }
        match (index, joint.parent) {
            (0, Some(_)) => return Err(SkeletonError::RootHasParent(name())),
            (1.., None) => return Err(SkeletonError::SecondRoot(name())),
            (_, Some(parent)) if parent >= index => return Err(SkeletonError::ParentNotBefore(name())),
            _ => {}
        }
        if !joint.offset_m.is_finite() {
            return Err(SkeletonError::NonFiniteOffset(name()));
        }
    }
    Ok(())
}

/// The written form: parents and contact joints by name.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SkeletonDoc {
    left_axis: Vec3,
    #[serde(default)]
    ground_y_m: f32,
    joints: Vec<JointDoc>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    contacts: Option<ContactsDoc>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointDoc {
    name: String,
    /// Name of the parent; empty for the root.
    #[serde(default)]
    parent: String,
    offset_m: Vec3,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ContactsDoc {
    joints: Vec<String>,
    max_height_m: Vec<f32>,
    max_speed_mps: f32,
    clearance_m: Vec<f32>,
}

impl TryFrom<SkeletonDoc> for Skeleton {
    type Error = SkeletonError;

    fn try_from(doc: SkeletonDoc) -> Result<Self, SkeletonError> {
        let index: HashMap<&str, usize> = doc
            .joints
            .iter()
            .enumerate()
            .rev()
            .map(|(i, j)| (j.name.as_str(), i))
            .collect();
        let find = |field, name: &str| {
            index
                .get(name)
                .copied()
                .ok_or_else(|| SkeletonError::UnknownJoint {
                    field,
                    name: name.to_owned(),
                })
        };
        let mut joints = Vec::with_capacity(doc.joints.len().min(MAX_JOINTS + 1));
        for joint in &doc.joints {
            let parent = match joint.parent.as_str() {
                "" => None,
                name => Some(find("parent", name)?),
            };
            joints.push(Joint {
                name: joint.name.clone(),
                parent,
                offset_m: joint.offset_m,
            });
        }
        let contacts = match &doc.contacts {
            None => None,
            Some(c) => Some(ContactParams {
                joints: c
                    .joints
                    .iter()
                    .map(|n| find("contacts.joints", n))
                    .collect::<Result<_, _>>()?,
                max_height_m: c.max_height_m.clone(),
                max_speed_mps: c.max_speed_mps,
                clearance_m: c.clearance_m.clone(),
            }),
        };
        Self::new(joints, doc.left_axis, doc.ground_y_m, contacts)
    }
}

impl From<Skeleton> for SkeletonDoc {
    fn from(s: Skeleton) -> Self {
        let name = |i: usize| s.joints.get(i).map(|j| j.name.clone()).unwrap_or_default();
        Self {
            left_axis: s.left_axis,
            ground_y_m: s.ground_y_m,
            joints: s
                .joints
                .iter()
                .map(|j| JointDoc {
                    name: j.name.clone(),
                    parent: j.parent.map(name).unwrap_or_default(),
                    offset_m: j.offset_m,
                })
                .collect(),
            contacts: s.contacts.as_ref().map(|c| ContactsDoc {
                joints: c.joints.iter().map(|&i| name(i)).collect(),
                max_height_m: c.max_height_m.clone(),
                max_speed_mps: c.max_speed_mps,
                clearance_m: c.clearance_m.clone(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::biped;

    const PACK: &str = r#"
        left_axis = [0, -1, 0]
        ground_y_m = 0.0
        joints = [
            { name = "Hips", parent = "", offset_m = [0, 0, 0] },
            { name = "Foot_L", parent = "Hips", offset_m = [0.1, -0.9, 0] },
            { name = "Foot_R", parent = "Hips", offset_m = [-0.1, -0.9, 0] },
        ]
        [contacts]
        joints = ["Foot_R", "Foot_L"]
        max_height_m = [0.1, 0.2]
        max_speed_mps = 0.5
        clearance_m = [0.05, 0.06]
    "#;

    #[test]
    fn reads_the_packs_table() {
        let skeleton: Skeleton = toml::from_str(PACK).unwrap();
        assert_eq!(skeleton.joints[2].parent, Some(0));
        assert_eq!(skeleton.left_axis, Vec3::NEG_Y);
        let contacts = skeleton.contacts.as_ref().unwrap();
        assert_eq!(contacts.joints, [2, 1], "in the order of the names");
        assert_eq!(
            (skeleton.joint_index("Foot_L"), skeleton.joint_index("Tail")),
            (Some(1), None)
        );
    }

    #[test]
    fn a_skeleton_is_unchanged_by_writing_and_reading() {
        let skeleton = (*biped()).clone();
        let text = toml::to_string(&skeleton).unwrap();
        assert_eq!(toml::from_str::<Skeleton>(&text).unwrap(), skeleton);
        let text = serde_json::to_string(&skeleton).unwrap();
        assert_eq!(serde_json::from_str::<Skeleton>(&text).unwrap(), skeleton);
    }

    #[test]
    fn bad_tables_name_what_is_wrong() {
        for (from, to, want) in [
            (
                "parent = \"Hips\"",
                "parent = \"Pelvis\"",
                "parent names \"Pelvis\"",
            ),
            (
                "\"Foot_R\", \"Foot_L\"]",
                "\"Foot_R\", \"Toe\"]",
                "contacts.joints names \"Toe\"",
            ),
            ("[0.1, 0.2]", "[0.1]", "contacts.max_height_m has 1 entries for 2"),
            ("= 0.5", "= 0.0", "contacts.max_speed_mps"),
            ("[0.05, 0.06]", "[0.05, nan]", "contacts.clearance_m"),
            ("[0, -1, 0]", "[0, -2, 0]", "left_axis must have unit length"),
            ("[0, -1, 0]", "[nan, 0, 0]", "left_axis must have unit length"),
            ("ground_y_m = 0.0", "ground_y_m = inf", "ground_y_m"),
            ("ground_y_m", "ground_m", "unknown field `ground_m`"),
        ] {
            let text = PACK.replacen(from, to, 1);
            assert_ne!(text, PACK, "{from}");
            let error = toml::from_str::<Skeleton>(&text).unwrap_err().to_string();
            assert!(error.contains(want), "{to}: {error}");
        }
    }

    #[test]
    fn bad_joints_are_refused() {
        let joint = |name: &str, parent| Joint {
            name: name.to_owned(),
            parent,
            offset_m: Vec3::ZERO,
        };
        let build = |joints| Skeleton::new(joints, Vec3::X, 0.0, None).map(|_| ());
        let name = || "b".to_owned();
        assert_eq!(build(vec![]), Err(SkeletonError::Empty));
        assert_eq!(
            build(vec![joint("b", Some(0))]),
            Err(SkeletonError::RootHasParent(name()))
        );
        assert_eq!(
            build(vec![joint("a", None), joint("b", None)]),
            Err(SkeletonError::SecondRoot(name()))
        );
        assert_eq!(
            build(vec![joint("a", None), joint("b", Some(1))]),
            Err(SkeletonError::ParentNotBefore(name()))
        );
        assert_eq!(
            build(vec![joint("b", None), joint("b", Some(0))]),
            Err(SkeletonError::DuplicateName(name()))
        );
        assert_eq!(build(vec![joint("", None)]), Err(SkeletonError::EmptyName(0)));
        let far = Joint {
            offset_m: Vec3::INFINITY,
            ..joint("b", None)
        };
        assert_eq!(build(vec![far]), Err(SkeletonError::NonFiniteOffset(name())));
        let many = (0..=MAX_JOINTS)
            .map(|i| joint(&format!("j{i}"), i.checked_sub(1)))
            .collect();
        assert_eq!(build(many), Err(SkeletonError::TooManyJoints(MAX_JOINTS + 1)));
    }

    #[test]
    fn contact_joints_must_exist_and_come_once() {
        let twice = ContactParams {
            joints: vec![3, 3],
            max_height_m: vec![0.1; 2],
            max_speed_mps: 1.0,
            clearance_m: vec![0.1; 2],
        };
        let build = |contacts| {
            let joints = biped().joints.clone();
            Skeleton::new(joints, Vec3::X, 0.0, Some(contacts))
        };
        assert_eq!(build(twice.clone()), Err(SkeletonError::ContactJoint(3)));
        let beyond = ContactParams {
            joints: vec![3, 8],
            ..twice
        };
        assert_eq!(build(beyond), Err(SkeletonError::ContactJoint(8)));
    }
}

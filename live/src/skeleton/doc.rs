//! A skeleton as the document that is kept: its joints in the neutral pose, and its parts.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_character::document::Document;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::Figure;
use troupe_motion::robot::description;
use troupe_motion::rotation::{from_wxyz, to_wxyz};
use troupe_motion::{Joint, Skeleton, Vec3};

/// Most joints of a skeleton.
pub(super) const MAX_JOINTS: usize = 256;

/// A skeleton of a user's own, as its file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkeletonDoc {
    /// The name that requests use.
    pub name: String,
    /// Whether it is worn although its certificate is below the bar.
    #[serde(default)]
    pub forced: bool,
    /// What the upload left open, and how it was understood.
    #[serde(default)]
    pub notes: Vec<String>,
    /// What it is.
    pub body: BodyDoc,
}

/// The body of a skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyDoc {
    /// Joints with free rotations.
    Joints(JointsDoc),
    /// A robot's description.
    Robot(RobotDoc),
}

/// A body of joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointsDoc {
    /// Parents before children.
    joints: Vec<JointDoc>,
    /// The body's left in the first joint's own frame.
    left_axis: [f32; 3],
    /// World rotations (w, x, y, z) of the neutral pose, one a joint.
    neutral: Vec<[f32; 4]>,
    /// Height of the first joint over the ground in the neutral pose, metres.
    root_y_m: f32,
    /// All parts of the body.
    parts: PartsDoc,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointDoc {
    name: String,
    parent: Option<usize>,
    offset_m: [f32; 3],
}

/// A robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDoc {
    /// The text of its URDF or MJCF.
    pub description: String,
    /// Corrections of its parts.
    #[serde(default)]
    pub parts: PartsDoc,
}

impl Document for SkeletonDoc {
    const WHAT: &'static str = "skeleton";
    const MAX_BYTES: usize = 4 << 20;
}

impl JointsDoc {
    /// The document of a figure.
    pub fn of(figure: &Figure) -> Self {
        let skeleton = figure.skeleton();
        let joint = |joint: &Joint| JointDoc {
            name: joint.name.clone(),
            parent: joint.parent,
            offset_m: joint.offset_m.to_array(),
        };
        Self {
            joints: skeleton.joints.iter().map(joint).collect(),
            // In the neutral pose it is +X.
            left_axis: (figure.neutral()[0].conjugate() * Vec3::X).to_array(),
            neutral: figure.neutral().iter().map(|&turn| to_wxyz(turn)).collect(),
            root_y_m: figure.root().y,
            parts: PartsDoc::of(figure.parts(), skeleton),
        }
    }
}

impl BodyDoc {
    /// The figure of the body.
    ///
    /// # Errors
    /// A sentence for what is no body.
    pub fn figure(&self) -> Result<Figure, String> {
        let text = |error: &dyn std::fmt::Display| error.to_string();
        match self {
            Self::Joints(doc) => {
                let joint = |joint: &JointDoc| Joint {
                    name: joint.name.clone(),
                    parent: joint.parent,
                    offset_m: Vec3::from_array(joint.offset_m),
                };
                let joints: Vec<Joint> = doc.joints.iter().map(joint).collect();
                if !(1..=MAX_JOINTS).contains(&joints.len()) {
                    return Err(format!(
                        "it has {} joints; allowed: 1 to {MAX_JOINTS}",
                        joints.len()
                    ));
                }
                let left = Vec3::from_array(doc.left_axis);
                let skeleton = Skeleton::new(joints, left, 0.0, None).map_err(|e| text(&e))?;
                if doc.neutral.len() != skeleton.joint_count() {
                    return Err(format!(
                        "neutral has {} rotations; allowed: one a joint",
                        doc.neutral.len()
                    ));
                }
                let neutral = doc
                    .neutral
                    .iter()
                    .map(|&turn| from_wxyz(turn).normalize())
                    .collect();
                Figure::standing(Arc::new(skeleton), neutral, doc.root_y_m, &doc.parts).map_err(|e| text(&e))
            }
            Self::Robot(doc) => {
                let read = description::read(&doc.description, &|_| None).map_err(|e| text(&e))?;
                let built =
                    description::build(&read, &description::BuildOptions::default()).map_err(|e| text(&e))?;
                let joints = built.skeleton.joint_count();
                if joints > MAX_JOINTS {
                    return Err(format!("it has {joints} joints; allowed: 1 to {MAX_JOINTS}"));
                }
                Figure::of_robot(Arc::new(built.skeleton), &doc.parts).map_err(|e| text(&e))
            }
        }
    }
}

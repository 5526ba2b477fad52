//! The bones of a character as joints of the server, and the server's frames as poses of bones.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use glam::{Affine3A, Mat3A, Quat, Vec3};
use thiserror::Error;
use troupe_proto::v1;

use crate::axes;

/// How much longer one axis of a bone may be than another, as a part of its length.
const UNEVEN: f32 = 0.01;

/// A bone of a Godot skeleton, in its rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Bone {
    /// Unique in the skeleton.
    pub name: String,
    /// Index of its parent. None: it has none.
    pub parent: Option<usize>,
    /// Its rest, relative to its parent.
    pub rest: Affine3A,
}

/// Where a character at rest looks, in the frame of its node.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Front {
    /// Along +Z, as imported models do.
    #[default]
    Model,
    /// Along -Z, as cameras do.
    Camera,
}

impl Front {
    /// Heading of the character if its node is not turned, radians.
    pub fn heading(self) -> f32 {
        match self {
            Self::Model => std::f32::consts::PI,
            Self::Camera => 0.0,
        }
    }
}

/// Why a skeleton cannot be moved.
#[derive(Debug, Error, PartialEq)]
pub enum RigError {
    /// No bone has the name.
    #[error("no bone is named `{root}`; root_bone may be one of {}", .bones.join(", "))]
    Root {
        /// The name.
        root: String,
        /// The names of all bones.
        bones: Vec<String>,
    },
    /// The axes of a bone differ in length, or are mirrored.
    #[error("the bone `{bone}` is stretched or mirrored at rest: its axes are {axes} long")]
    Scale {
        /// Name of the bone.
        bone: String,
        /// Lengths of its axes.
        axes: Vec3,
    },
    /// The parents of bones go round in a circle.
    #[error("the bone `{bone}` is its own ancestor")]
    Circle {
        /// Name of the bone.
        bone: String,
    },
}

/// A part of a skeleton that the server moves: a bone and all below it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Index of each joint's bone. Parents come before children.
    bones: Vec<usize>,
    joints: v1::BodySkeleton,
    name: String,
}

impl Rig {
    /// The bones from `root` on. `placed` is the transform of the skeleton in the frame of the
    /// character's node, in metres.
    ///
    /// # Errors
    /// See [`RigError`].
    pub fn new(bones: &[Bone], root: &str, placed: Affine3A, front: Front) -> Result<Self, RigError> {
        let Some(first) = bones.iter().position(|bone| bone.name == root) else {
            return Err(RigError::Root {
                root: root.to_owned(),
                bones: bones.iter().map(|bone| bone.name.clone()).collect(),
            });
        };
        // The server's characters look along Godot's -Z if their heading is zero.
        let ahead = Affine3A::from_rotation_y(-front.heading()) * placed;
        let order = below(bones, first);
        let mut rests = Vec::with_capacity(order.len());
        for &bone in &order {
            rests.push(Rest::of(bones, bone, ahead)?);
        }
        let joints = joints(bones, &order, &rests);
        let name = name(&joints);
        Ok(Self {
            bones: order,
            joints,
            name,
        })
    }

    /// Indices of the bones of all joints.
    pub fn bones(&self) -> &[usize] {
        &self.bones
    }

    /// The skeleton for the server.
    pub fn joints(&self) -> &v1::BodySkeleton {
        &self.joints
    }

    /// Name of the skeleton on the server: the same joints have the same name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// A bone and all bones below it, parents before children.
fn below(bones: &[Bone], first: usize) -> Vec<usize> {
    let mut order = vec![first];
    let mut next = 0;
    while let Some(&parent) = order.get(next) {
        let children = (0..bones.len()).filter(|&child| bones[child].parent == Some(parent));
        // The first bone may be its own ancestor.
        order.extend(children.filter(|&child| child != first));
        next += 1;
    }
    order
}

/// A bone at rest, in the frame of a character that looks along -Z.
struct Rest {
    position: Vec3,
    rotation: Quat,
}

impl Rest {
    fn of(bones: &[Bone], bone: usize, ahead: Affine3A) -> Result<Self, RigError> {
        let mut whole = bones[bone].rest;
        let (mut above, mut steps) = (bones[bone].parent, 0);
        while let Some(parent) = above {
            whole = bones[parent].rest * whole;
            above = bones[parent].parent;
            steps += 1;
            if steps > bones.len() {
                let bone = bones[bone].name.clone();
                return Err(RigError::Circle { bone });
            }
        }
        let whole = ahead * whole;
        let Mat3A {
            x_axis,
            y_axis,
            z_axis,
        } = whole.matrix3;
        let axes = Vec3::new(x_axis.length(), y_axis.length(), z_axis.length());
        let (least, most) = (axes.min_element(), axes.max_element());
        let is_even = least > 0.0 && most.is_finite() && most - least <= UNEVEN * most;
        if !is_even || whole.matrix3.determinant() <= 0.0 {
            let bone = bones[bone].name.clone();
            return Err(RigError::Scale { bone, axes });
        }
        let turned = Mat3A::from_cols(x_axis / axes.x, y_axis / axes.y, z_axis / axes.z);
        Ok(Self {
            position: whole.translation.into(),
            rotation: Quat::from_mat3a(&turned).normalize(),
        })
    }
}

fn joints(bones: &[Bone], order: &[usize], rests: &[Rest]) -> v1::BodySkeleton {
    let mut joints = Vec::with_capacity(order.len());
    for (&bone, rest) in order.iter().zip(rests) {
        // The first joint's parent is not in the order.
        let parent = bones[bone].parent;
        let above = parent.and_then(|parent| order.iter().position(|&other| other == parent));
        let offset = match above {
            Some(above) => {
                let from = &rests[above];
                from.rotation.inverse() * (rest.position - from.position)
            }
            None => Vec3::ZERO,
        };
        let Vec3 { x, y, z } = axes::position(offset);
        joints.push(v1::BodyJoint {
            name: bones[bone].name.clone(),
            parent: above.map_or_else(String::new, |above| bones[order[above]].name.clone()),
            offset: Some(v1::Vec3 { x, y, z }),
        });
    }
    let neutral = rests.iter().map(|rest| {
        let [x, y, z, w] = axes::rotation(rest.rotation).to_array();
        v1::Quat { w, x, y, z }
    });
    v1::BodySkeleton {
        joints,
        neutral: neutral.collect(),
        ..v1::BodySkeleton::default()
    }
}

fn name(skeleton: &v1::BodySkeleton) -> String {
    let mut hash = DefaultHasher::new();
    for joint in &skeleton.joints {
        (&joint.name, &joint.parent).hash(&mut hash);
        let offset = joint.offset.unwrap_or_default();
        [offset.x, offset.y, offset.z].map(f32::to_bits).hash(&mut hash);
    }
    for turned in &skeleton.neutral {
        [turned.w, turned.x, turned.y, turned.z]
            .map(f32::to_bits)
            .hash(&mut hash);
    }
    format!("godot-{:016x}", hash.finish())
}

/// The pose of the first joint's bone, relative to the bone above it. `above` is that bone's
/// transform in Godot's world, or the skeleton's. `position` and `rotation` are in Godot's world.
pub fn root_pose(above: Affine3A, position: Vec3, rotation: Quat) -> (Vec3, Quat) {
    let Mat3A {
        x_axis,
        y_axis,
        z_axis,
    } = above.matrix3;
    let turned = Mat3A::from_cols(x_axis.normalize(), y_axis.normalize(), z_axis.normalize());
    let turned = Quat::from_mat3a(&turned);
    (
        above.inverse().transform_point3(position),
        turned.inverse() * rotation,
    )
}

#[cfg(test)]
#[path = "rig_tests.rs"]
mod tests;

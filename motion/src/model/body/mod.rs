//! A body for a model of many bodies: a skeleton with a neutral pose, described joint by joint.
//!
//! In the neutral pose the body stands upright, heads along +Z, and its limbs hang down. With
//! `N[j]` the world rotation of a joint in that pose, `R[j] N[j]ᵀ` is its turn in a frame, in world
//! axes: the same bend on every body. The reference is `training/troupe_training/data/bodies.py`.

mod at_rest;
mod description;
mod error;
mod inline;
mod sway;

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{ByPath, Dims, Rig};
use crate::fk::local_from_world_rotations;
use crate::ik::is_below;
use crate::skeleton::Skeleton;

pub use description::{DESCRIPTION, SLOTS};
pub use error::BodyError;
pub use inline::{InlineJoint, InlineSkeleton};
pub use sway::{Sway, SwayDoc};

/// Most joints of a body.
pub const MAX_BODY_JOINTS: usize = 256;
/// Smallest and largest size of a body, metres.
const SIZES_M: [f32; 2] = [0.01, 100.0];
/// Longest bone, metres.
const MAX_BONE_M: f32 = 100.0;
/// Shorter bones count as none, metres.
const MIN_BONE_M: f32 = 1e-4;
/// Largest difference of a rotation from unit length.
const UNIT_TOLERANCE: f32 = 1e-3;
/// Cosine of the angle by which a skeleton's left may differ from that of its neutral pose.
const LEFT_COSINE: f32 = 0.7;
/// Speed of a walk, body sizes a second. People walk at 1.2 m/s with hips at 0.9 m.
const USUAL_SPEED_PER_S: f32 = 1.3;
/// Highest speed of a live character's path, body sizes a second: that of a run.
const MAX_SPEED_PER_S: f32 = 4.0;
/// A body whose root is lower than this share of its extent does not stand on legs.
const LEGS_SHARE: f32 = 0.15;

/// The parts that a body is made of. Lists have an entry for each joint.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyParts {
    /// Name of the body in requests.
    pub name: String,
    /// The skeleton, with a robot's hinges and the contact joints.
    pub skeleton: Skeleton,
    /// World rotations of the neutral pose.
    pub neutral: Vec<Quat>,
    /// 1 left, -1 right, 0 middle.
    pub sides: Vec<i8>,
    /// Height of the root in the neutral pose above the ground, metres. `None`: with the lowest
    /// foot on the ground.
    pub height_m: Option<f32>,
    /// The unit of lengths for the networks, metres. `None`: the root's height, or half the extent
    /// of a body that does not stand on legs.
    pub size_m: Option<f32>,
    /// The words that its clips show.
    pub words: Vec<String>,
}

/// A checked body, with everything that networks read of it. It has J joints and J + 1 rows: one
/// for the place of its root, then one for each joint.
#[derive(Debug, Clone)]
pub struct Body {
    /// Name of the body in requests.
    pub name: String,
    /// The skeleton with a robot's hinges, and the sizes of windows. Its name is the body's.
    pub rig: Arc<Rig>,
    /// World rotations of the neutral pose, `[J]`.
    pub neutral: Box<[Quat]>,
    /// 1 left, -1 right, 0 middle, `[J]`.
    pub sides: Box<[i8]>,
    /// Height of the root in the neutral pose above the ground, metres.
    pub height_m: f32,
    /// The unit of lengths for the networks, metres.
    pub size_m: f32,
    /// The words that its clips show. Empty without clips.
    pub words: Vec<String>,
    /// The network of a pack that moves it: 0 is the one for all bodies.
    pub network: usize,
    /// How its root moves about a drawn path, if its clips show that.
    pub sway: Option<Arc<Sway>>,
    /// Bones in the neutral pose, world axes, `[J]`, metres: `N[parent] offset[j]`, zero for the
    /// root.
    pub bones_m: Box<[Vec3]>,
    /// What networks read of each row, `[J + 1]`. Lengths are shares of the size.
    pub description: Box<[[f32; DESCRIPTION]]>,
    /// Rows that each row's attention reads, as indices from the body's first row, `[J + 1]`.
    pub rows: Box<[[i64; SLOTS]]>,
    /// 1 if a slot of `rows` is used, otherwise 0, `[J + 1]`.
    pub reads: Box<[[f32; SLOTS]]>,
}

impl Body {
    /// Checks the parts, and computes what networks need. `dims` has the sizes of windows; joints
    /// and contacts are the body's own.
    ///
    /// # Errors
    /// [`BodyError`] with the field and its range.
    pub fn new(parts: BodyParts, fps: f32, dims: &Dims) -> Result<Self, BodyError> {
        let BodyParts {
            name,
            skeleton,
            neutral,
            sides,
            words,
            ..
        } = parts;
        check_lists(&skeleton, &neutral, &sides)?;
        check_bones(&skeleton)?;
        let neutral: Box<[Quat]> = neutral.iter().map(|q| q.normalize()).collect();
        check_left(&skeleton, &neutral)?;
        let bones_m = bones(&skeleton, &neutral);
        let places = places(&skeleton, &bones_m);
        let (own_height_m, own_size_m) = scale(&skeleton, &places);
        let (height_m, size_m) = (
            parts.height_m.unwrap_or(own_height_m),
            parts.size_m.unwrap_or(own_size_m),
        );
        let [least, most] = SIZES_M;
        if !(least..=most).contains(&size_m) {
            return Err(BodyError::field("size_m", size_m, format!("{least} to {most}")));
        }
        if !(0.0..=most).contains(&height_m) {
            return Err(BodyError::field("height_m", height_m, format!("0 to {most}")));
        }
        let (rows, reads) = description::slots(&skeleton);
        let dims = Dims {
            joints: skeleton.joint_count(),
            contacts: skeleton.contacts.as_ref().map_or(0, |contacts| contacts.len()),
            ..*dims
        };
        let mut rig = Rig::new(&name, fps, dims, skeleton);
        rig.by_path = Some(by_path(&rig.skeleton, &neutral, &words, (height_m, size_m)));
        let skeleton = &rig.skeleton;
        Ok(Self {
            description: description::describe(skeleton, &neutral, &bones_m, &places, &sides, size_m),
            rig: Arc::new(rig),
            name,
            neutral,
            sides: sides.into(),
            height_m,
            size_m,
            words,
            network: 0,
            sway: None,
            bones_m,
            rows,
            reads,
        })
    }

    /// Has a body without clips sway like another one, by their sizes, if it has one foot on each
    /// side.
    pub fn sway_like(&mut self, other: &Self) {
        if let ([left], [right], Some(sway)) = (&*self.ends(1), &*self.ends(-1), &other.sway) {
            let size = self.size_m / other.size_m;
            self.sway = Some(Arc::new(sway.scaled([*left, *right], size)));
        }
    }

    /// The contact joints of a side that have none below them.
    fn ends(&self, side: i8) -> Vec<usize> {
        let skeleton = &self.rig.skeleton;
        let Some(contacts) = &skeleton.contacts else {
            return Vec::new();
        };
        let is_end = |joint: &usize| {
            let mut others = contacts.joints.iter();
            !others.any(|&other| is_below(skeleton, other, *joint))
        };
        let ends = contacts.joints.iter().copied();
        ends.filter(|joint| self.sides[*joint] == side && is_end(joint))
            .collect()
    }

    /// Number of joints J.
    pub fn joints(&self) -> usize {
        self.neutral.len()
    }

    /// Number of rows, J + 1.
    pub fn row_count(&self) -> usize {
        self.neutral.len() + 1
    }
}

/// Compares the parts.
impl PartialEq for Body {
    fn eq(&self, other: &Self) -> bool {
        let parts = |body: &Self| (body.height_m, body.size_m, body.rig.dims, body.rig.fps);
        self.name == other.name
            && parts(self) == parts(other)
            && self.rig.skeleton == other.rig.skeleton
            && self.neutral == other.neutral
            && self.sides == other.sides
            && self.words == other.words
    }
}

fn check_lists(skeleton: &Skeleton, neutral: &[Quat], sides: &[i8]) -> Result<(), BodyError> {
    let joints = skeleton.joint_count();
    if !(1..=MAX_BODY_JOINTS).contains(&joints) {
        let allowed = format!("1 to {MAX_BODY_JOINTS} joints");
        return Err(BodyError::field("skeleton.joints", joints, allowed));
    }
    for (field, found) in [
        ("neutral.rotations", neutral.len()),
        ("neutral.sides", sides.len()),
    ] {
        if found != joints {
            let allowed = format!("{joints}, one a joint");
            return Err(BodyError::field(field, format!("{found} long"), allowed));
        }
    }
    for (joint, rotation) in neutral.iter().enumerate() {
        let length = rotation.length();
        if length.is_nan() || (length - 1.0).abs() > UNIT_TOLERANCE {
            let field = format!("neutral.rotations[{joint}]");
            let found = format!("{length} long");
            return Err(BodyError::field(field, found, "unit length within 0.001"));
        }
    }
    match sides.iter().position(|side| !(-1..=1).contains(side)) {
        Some(joint) => {
            let field = format!("neutral.sides[{joint}]");
            let allowed = "1 for left, -1 for right, 0 for the middle";
            Err(BodyError::field(field, sides[joint], allowed))
        }
        None => Ok(()),
    }
}

/// The neutral pose faces +Z, so its left is +X. A skeleton whose left is elsewhere would walk
/// with a wrong heading.
fn check_left(skeleton: &Skeleton, neutral: &[Quat]) -> Result<(), BodyError> {
    let Some(root) = neutral.first() else {
        return Ok(());
    };
    if (*root * skeleton.left_axis).x > LEFT_COSINE {
        return Ok(());
    }
    let left = root.conjugate() * Vec3::X;
    let allowed = format!("near {left:.2}, which is +X in the neutral pose");
    Err(BodyError::field(
        "skeleton.left_axis",
        format!("{:.2}", skeleton.left_axis),
        allowed,
    ))
}

/// A robot has joints of several axes at one place; otherwise every joint has a bone.
fn check_bones(skeleton: &Skeleton) -> Result<(), BodyError> {
    for (index, joint) in skeleton.joints.iter().enumerate().skip(1) {
        let length = joint.offset_m.length();
        let hinged = |robot: &crate::Robot| robot.axis_of(index).is_some();
        let least = match skeleton.robot.as_ref().is_some_and(hinged) {
            true => 0.0,
            false => MIN_BONE_M,
        };
        if !(least..=MAX_BONE_M).contains(&length) {
            let field = format!("skeleton.joints[{index}].offset_m");
            let allowed = format!("{least} to {MAX_BONE_M} m (0 for hinges of a robot alone)");
            return Err(BodyError::field(field, format!("{length} m long"), allowed));
        }
    }
    Ok(())
}

fn bones(skeleton: &Skeleton, neutral: &[Quat]) -> Box<[Vec3]> {
    let bone = |joint: &crate::Joint| {
        joint
            .parent
            .map_or(Vec3::ZERO, |parent| neutral[parent] * joint.offset_m)
    };
    skeleton.joints.iter().map(bone).collect()
}

/// How live characters with this body are planned for.
fn by_path(
    skeleton: &Skeleton,
    neutral: &[Quat],
    words: &[String],
    (height_m, size_m): (f32, f32),
) -> ByPath {
    let mut local = vec![Quat::IDENTITY; neutral.len()];
    local_from_world_rotations(skeleton, neutral, &mut local);
    ByPath {
        usual_speed_mps: USUAL_SPEED_PER_S * size_m,
        max_speed_mps: MAX_SPEED_PER_S * size_m,
        words: words.to_vec(),
        neutral: local.into(),
        height_m,
    }
}

/// Joint positions of the neutral pose relative to the root, metres.
fn places(skeleton: &Skeleton, bones_m: &[Vec3]) -> Vec<Vec3> {
    let mut places: Vec<Vec3> = Vec::with_capacity(bones_m.len());
    for (joint, bone) in skeleton.joints.iter().zip(bones_m) {
        places.push(joint.parent.map_or(Vec3::ZERO, |parent| places[parent] + *bone));
    }
    places
}

/// Defaults of height and size, metres: see [`BodyParts`].
fn scale(skeleton: &Skeleton, places: &[Vec3]) -> (f32, f32) {
    let contacts = skeleton.contacts.iter();
    let stands = contacts.flat_map(|contacts| contacts.joints.iter().zip(&contacts.clearance_m));
    let height = stands.map(|(&joint, clearance)| clearance - places[joint].y);
    let height = height.max_by(f32::total_cmp).unwrap_or(0.0).max(0.0);
    let extent = extent(places);
    match height > LEGS_SHARE * extent {
        true => (height, height),
        false => (height, extent / 2.0),
    }
}

/// Diagonal of the box around all joints in the neutral pose, metres.
fn extent(places: &[Vec3]) -> f32 {
    let low = places.iter().fold(Vec3::ZERO, |low, place| low.min(*place));
    let high = places.iter().fold(Vec3::ZERO, |high, place| high.max(*place));
    (high - low).length()
}

#[cfg(test)]
mod tests;

//! Bodies of users: a skeleton from which everything that is left out is derived.

use glam::{Quat, Vec3};

use super::at_rest::AtRest;
use super::description::is_leaf;
use super::{Body, BodyError, BodyParts, MAX_BODY_JOINTS, bones, extent, places};
use crate::model::Dims;
use crate::robot::RobotDoc;
use crate::skeleton::{ContactParams, Joint, Skeleton};

/// Joints farther from the middle than this share of the body's extent have a side.
const SIDE_SHARE: f32 = 0.02;
/// Ends higher above the lowest one than this share of the body's extent do not touch the ground.
const GROUND_SHARE: f32 = 0.05;
/// A contact joint counts as touching the ground up to this height above its standing height,
/// metres.
const CONTACT_ROOM_M: f32 = 0.05;
/// Faster feet do not stand, m/s.
const CONTACT_SPEED_MPS: f32 = 0.4;

/// One joint of a user's skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct InlineJoint {
    /// Unique, not empty.
    pub name: String,
    /// Name of the parent; empty for the root, which comes first.
    pub parent: String,
    /// Offset from the parent in the parent's frame of reference, metres. Ignored for the root.
    pub offset_m: Vec3,
}

/// A user's skeleton.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InlineSkeleton {
    /// Parents before their children. The answer has the same order.
    pub joints: Vec<InlineJoint>,
    /// The body's left in the root's frame of reference, unit length. `None`: +X in the neutral
    /// pose.
    pub left_axis: Option<Vec3>,
    /// Names of the joints that touch the ground. `None`: the lowest ends.
    pub contacts: Option<Vec<String>>,
    /// World rotations of the neutral pose, one a joint. `None`: the rest pose, turned to head
    /// along +Z. The limbs of a person in a T-pose or an A-pose are let down.
    pub neutral: Option<Vec<Quat>>,
    /// 1 left, -1 right, 0 middle, one a joint. `None`: by the places of the neutral pose.
    pub sides: Option<Vec<i8>>,
    /// The hinges, for a robot.
    pub robot: Option<RobotDoc>,
}

impl InlineSkeleton {
    /// The body of the skeleton. `dims` has the sizes of the pack's windows. `notes` gets a line
    /// for what was derived and may be meant otherwise.
    ///
    /// # Errors
    /// [`BodyError`] with the field and its range.
    pub fn body(
        &self,
        name: &str,
        fps: f32,
        dims: &Dims,
        notes: &mut Vec<String>,
    ) -> Result<Body, BodyError> {
        let mut skeleton = Skeleton::new(self.linked()?, self.left_axis(), 0.0, None)?;
        let joints = skeleton.joint_count();
        let neutral = match &self.neutral {
            Some(given) if given.len() != joints => {
                let found = format!("{} long", given.len());
                let allowed = format!("{joints}, one a joint");
                return Err(BodyError::field("neutral.rotations", found, allowed));
            }
            Some(given) => given.clone(),
            None => {
                let at_rest = AtRest::of(&skeleton);
                if self.left_axis.is_none() {
                    skeleton.left_axis = at_rest.left_axis(notes);
                }
                at_rest.neutral(&skeleton, notes)?
            }
        };
        let places = places(&skeleton, &bones(&skeleton, &neutral));
        skeleton.contacts = Some(self.contact_params(&skeleton, &places)?);
        if let Some(robot) = &self.robot {
            skeleton = skeleton.with_robot(robot)?;
        }
        let sides = (self.sides.clone()).unwrap_or_else(|| sides(&places));
        let parts = BodyParts {
            name: name.to_owned(),
            skeleton,
            neutral,
            sides,
            height_m: None,
            size_m: None,
            words: Vec::new(),
        };
        Body::new(parts, fps, dims)
    }

    fn left_axis(&self) -> Vec3 {
        let neutral = self.neutral.as_deref().and_then(<[Quat]>::first);
        let left = || neutral.map_or(Vec3::X, |root| (root.conjugate() * Vec3::X).normalize());
        self.left_axis.unwrap_or_else(left)
    }

    /// The joints with the indices of their parents.
    fn linked(&self) -> Result<Vec<Joint>, BodyError> {
        let count = self.joints.len();
        if !(1..=MAX_BODY_JOINTS).contains(&count) {
            let allowed = format!("1 to {MAX_BODY_JOINTS} joints");
            return Err(BodyError::field("skeleton.joints", count, allowed));
        }
        let linked = self.joints.iter().enumerate().map(|(index, joint)| {
            let parent = self.parent_of(index)?;
            Ok(Joint {
                name: joint.name.clone(),
                parent,
                offset_m: joint.offset_m,
            })
        });
        linked.collect()
    }

    fn parent_of(&self, index: usize) -> Result<Option<usize>, BodyError> {
        let name = &self.joints[index].parent;
        let wrong = |found: String, allowed: &str| {
            Err(BodyError::field(
                format!("skeleton.joints[{index}].parent"),
                found,
                allowed,
            ))
        };
        if name.is_empty() {
            return match index {
                0 => Ok(None),
                _ => wrong(
                    "empty, which makes it a second root".to_owned(),
                    "the name of a joint before it",
                ),
            };
        }
        match self.place_of(name) {
            None => wrong(format!("{name:?}"), "the name of a joint"),
            Some(_) if self.is_in_cycle(index) => {
                wrong(format!("{name:?}, which closes a cycle"), "no cycles")
            }
            Some(_) if index == 0 => wrong(format!("{name:?}"), "empty: the root comes first"),
            Some(parent) if parent > index => {
                wrong(format!("{name:?}, which comes later"), "parents before children")
            }
            parent => Ok(parent),
        }
    }

    fn place_of(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Whether a joint is its own ancestor.
    fn is_in_cycle(&self, start: usize) -> bool {
        let up = |joint: &usize| self.place_of(&self.joints[*joint].parent);
        let way = std::iter::successors(up(&start), up);
        way.take(self.joints.len()).any(|joint| joint == start)
    }

    /// The joints that touch the ground. In the neutral pose the lowest of them is on the ground.
    fn contact_params(&self, skeleton: &Skeleton, places: &[Vec3]) -> Result<ContactParams, BodyError> {
        let joints = match &self.contacts {
            Some(names) => {
                let found = names.iter().enumerate().map(|(index, name)| {
                    let field = || format!("skeleton.contacts[{index}]");
                    let missing = || BodyError::field(field(), format!("{name:?}"), "the name of a joint");
                    let joint = skeleton.joint_index(name).ok_or_else(missing)?;
                    match names[..index].contains(name) {
                        true => Err(BodyError::field(field(), format!("{name:?}"), "each joint once")),
                        false => Ok(joint),
                    }
                });
                found.collect::<Result<Vec<_>, _>>()?
            }
            None => lowest_ends(skeleton, places),
        };
        let height = |&joint: &usize| places[joint].y;
        let ground = joints.iter().map(height).min_by(f32::total_cmp).unwrap_or(0.0);
        let clearance_m: Vec<f32> = joints.iter().map(|joint| height(joint) - ground).collect();
        Ok(ContactParams {
            max_height_m: clearance_m
                .iter()
                .map(|clearance| clearance + CONTACT_ROOM_M)
                .collect(),
            max_speed_mps: CONTACT_SPEED_MPS,
            clearance_m,
            joints,
        })
    }
}

fn lowest_ends(skeleton: &Skeleton, places: &[Vec3]) -> Vec<usize> {
    let ends = || (1..places.len()).filter(|&joint| is_leaf(skeleton, joint));
    let lowest = ends().map(|joint| places[joint].y).min_by(f32::total_cmp);
    let most = lowest.unwrap_or(0.0) + GROUND_SHARE * extent(places);
    ends().filter(|&joint| places[joint].y <= most).collect()
}

/// Sides by the places of the neutral pose: +X is left.
fn sides(places: &[Vec3]) -> Vec<i8> {
    let most = SIDE_SHARE * extent(places);
    let side = |place: &Vec3| i8::from(place.x > most) - i8::from(place.x < -most);
    places.iter().map(side).collect()
}

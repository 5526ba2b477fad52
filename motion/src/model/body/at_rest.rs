//! The neutral pose of a user's skeleton that comes without one.

use glam::{DVec3, Quat, Vec3};

use super::{BodyError, bones, places};
use crate::anatomy::{Biped, RestPose, Tree, let_down};
use crate::root::heading_of;
use crate::rotation::yaw;
use crate::skeleton::Skeleton;

/// Least cosine between up and the direction from the feet to the head.
const UPRIGHT: f64 = 0.9;
/// Least cosine between +X and the direction from the right hip to the left one, if left is +X.
const LEFT: f32 = 0.85;
/// Width of a body by its height from which it may stand in a T-pose.
const WIDE: f32 = 0.7;
/// Heights of a person that are believed, from ankle to head, metres.
const PERSON_M: std::ops::RangeInclusive<f64> = 0.25..=4.0;

/// A skeleton at rest: all rotations are zero.
pub(super) struct AtRest {
    places: Vec<Vec3>,
    /// The joints of a person, if they are found by name.
    person: Option<Biped>,
}

impl AtRest {
    pub(super) fn of(skeleton: &Skeleton) -> Self {
        let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
        Self {
            places: places(skeleton, &bones(skeleton, &rest)),
            person: Biped::find(&Tree::of(skeleton)),
        }
    }

    /// The body's left: +X, unless the hips of a person show another.
    pub(super) fn left_axis(&self, notes: &mut Vec<String>) -> Vec3 {
        let hips = self.person.as_ref().map(|person| person.hips);
        let left = hips.and_then(|[left, right]| {
            let across = self.places[left] - self.places[right];
            across.with_y(0.0).try_normalize()
        });
        match left.filter(|left| left.x < LEFT) {
            None => Vec3::X,
            Some(left) => {
                let Vec3 { x, z, .. } = left;
                notes.push(format!(
                    "the skeleton's left is ({x:.2}, 0, {z:.2}), as its hips stand at rest; left_axis says otherwise"
                ));
                left
            }
        }
    }

    /// World rotations of the neutral pose: the rest pose turned to head along +Z. A person's limbs
    /// are let down from a T-pose or an A-pose.
    ///
    /// # Errors
    /// [`BodyError`] if a person stands in no known pose.
    pub(super) fn neutral(
        &self,
        skeleton: &Skeleton,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Quat>, BodyError> {
        let turn = yaw(-heading_of(Quat::IDENTITY, skeleton.left_axis));
        let rest = vec![turn; skeleton.joint_count()];
        let Some(person) = &self.person else {
            self.note_width(skeleton.left_axis, notes);
            return Ok(rest);
        };
        let places: Vec<DVec3> = self.places.iter().map(|place| place.as_dvec3()).collect();
        let standing = places[person.head] - 0.5 * (places[person.feet[0]] + places[person.feet[1]]);
        if standing.normalize_or_zero().y < UPRIGHT {
            let found = format!(
                "left out, and at rest the skeleton is not upright: from its feet to its head is \
                 ({:.2}, {:.2}, {:.2}) m",
                standing.x, standing.y, standing.z
            );
            return Err(asked_for(found));
        }
        if !PERSON_M.contains(&standing.length()) {
            notes.push(format!(
                "the skeleton is {:.2} m tall from its feet to its head; offsets are in metres",
                standing.length()
            ));
        }
        match RestPose::of(person, &places, DVec3::Y) {
            (RestPose::None, evidence) => Err(asked_for(format!("left out, and {evidence}"))),
            (RestPose::T | RestPose::A, evidence) => {
                notes.push(format!(
                    "the skeleton's limbs are let down for its neutral pose: {evidence}; neutral says otherwise"
                ));
                Ok(let_down(skeleton, person, &rest))
            }
            (RestPose::Standing, _) => {
                if person.arms.is_none() {
                    self.note_width(skeleton.left_axis, notes);
                }
                Ok(rest)
            }
        }
    }

    /// Notes a body that is as wide as if it stood in a T-pose.
    fn note_width(&self, left: Vec3, notes: &mut Vec<String>) {
        let range = |along: Vec3| {
            let values = || self.places.iter().map(|place| place.dot(along));
            values().fold(f32::NEG_INFINITY, f32::max) - values().fold(f32::INFINITY, f32::min)
        };
        let (wide, tall) = (range(left), range(Vec3::Y));
        if wide > WIDE * tall && tall > 0.0 {
            notes.push(format!(
                "the rest pose is taken as the neutral pose: {wide:.2} m wide and {tall:.2} m tall, without arms that \
                 are found by name; neutral says otherwise"
            ));
        }
    }
}

fn asked_for(found: String) -> BodyError {
    let allowed =
        "the world rotations of a pose that is upright, heads along +Z and lets its limbs hang down";
    BodyError::field("neutral.rotations", found, allowed)
}

//! Robots: joints that are hinges with limits, and MuJoCo's `qpos`.
//!
//! A robot is a [`Skeleton`] whose joints turn about one axis each, or not at all. The rotation of
//! a hinge joint relative to its parent is `rest * R(axis, angle)`. A joint without a hinge turns
//! with its parent. The root joint floats freely. Axes and rests are in native axes; angles are in
//! radians, positive about the axis as in the robot's URDF.
//!
//! [`Robot::fit`] brings any pose onto the hinges and into their limits, and reports the error.
//! `qpos` is MuJoCo's: the root's position (x, y, z in ROS axes, metres), its rotation (w, x, y,
//! z), then the hinges' angles in their order.

mod csv;
#[cfg(feature = "files")]
pub mod description;
mod doc;
mod mimic;
mod order;
mod rates;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
mod tracker;

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use crate::conventions::Convention;
use crate::root::wrap_angle;
use crate::rotation::{from_wxyz, to_wxyz};

pub use csv::{CsvError, write_csv};
pub use doc::{HingeDoc, RobotDoc, RobotError};
pub use mimic::{Mimic, MimicDoc};
pub use rates::{HingeRate, HingeRates};
pub use tracker::{Reference, TRACKER_FPS, reference, sonic_files};

/// Numbers of a `qpos` before the angles: the root's position and rotation.
pub const ROOT_QPOS: usize = 7;
/// Angles up to this far outside of their limits count as within them, radians: rounding.
pub const LIMIT_TOLERANCE_RAD: f32 = 1e-4;

/// A joint that turns about one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge {
    /// Index of the joint in the skeleton.
    pub joint: usize,
    /// The axis in the joint's own frame of reference, unit length.
    pub axis: Vec3,
    /// The joint's rotation relative to its parent at angle 0.
    pub rest: Quat,
    /// Smallest angle, radians.
    pub lower_rad: f32,
    /// Largest angle, radians.
    pub upper_rad: f32,
    /// Highest turning rate, rad/s.
    pub max_speed_rad_per_s: f32,
    /// Largest change of the turning rate, rad/s². None: no limit is known.
    pub max_acceleration_rad_per_s2: Option<f32>,
}

impl Hinge {
    /// The joint's rotation relative to its parent at an angle.
    #[inline]
    pub fn rotation(&self, angle: f32) -> Quat {
        self.rest * Quat::from_axis_angle(self.axis, angle)
    }

    /// The angle at which the hinge comes nearest to a rotation relative to the joint's parent. It
    /// is within half a turn of the middle of the limits.
    #[inline]
    pub fn angle_of(&self, local: Quat) -> f32 {
        let turn = self.rest.conjugate() * local;
        let angle = 2.0 * turn.xyz().dot(self.axis).atan2(turn.w);
        let middle = 0.5 * (self.lower_rad + self.upper_rad);
        middle + wrap_angle(angle - middle)
    }

    /// The angle within the limits.
    #[inline]
    pub fn limited(&self, angle: f32) -> f32 {
        angle.clamp(self.lower_rad, self.upper_rad)
    }

    /// Whether the hinge can turn all the way round.
    pub fn is_endless(&self) -> bool {
        self.upper_rad - self.lower_rad >= TAU
    }
}

/// A joint's parent and hinge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Link {
    parent: Option<usize>,
    hinge: Option<usize>,
    /// Index of what it follows, if it has no hinge.
    mimic: Option<usize>,
}

/// The hinges of a skeleton. It belongs to the skeleton that it was made for
/// ([`Skeleton::with_robot`]).
///
/// [`Skeleton`]: crate::Skeleton
/// [`Skeleton::with_robot`]: crate::Skeleton::with_robot
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    name: String,
    hinges: Vec<Hinge>,
    /// One for each joint.
    links: Vec<Link>,
    mimics: Vec<Mimic>,
}

/// Result of bringing a pose onto the hinges. Reuse it: a second pose allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fitted {
    /// Angles of the hinges, radians, each within its limits.
    pub angles: Vec<f32>,
    /// Largest turn of any joint in the world between the pose before and after, radians.
    pub residual_rad: f32,
    /// Number of hinges that were asked for more than their limits by more than
    /// [`LIMIT_TOLERANCE_RAD`].
    pub clamped: usize,
    /// Error of each joint's rotation in the world, in the joint's own frame of reference.
    lacking: Vec<Quat>,
}

impl Fitted {
    /// Clears the result, but keeps its memory.
    pub fn clear(&mut self) {
        self.angles.clear();
        self.lacking.clear();
        (self.residual_rad, self.clamped) = (0.0, 0);
    }
}

impl Robot {
    /// Name of the robot, as in its URDF.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The hinges, in the order of `qpos`. Those nearer to the root come first.
    pub fn hinges(&self) -> &[Hinge] {
        &self.hinges
    }

    /// Index of a joint's hinge; none for the root and for fixed joints.
    pub fn hinge_of(&self, joint: usize) -> Option<usize> {
        self.links.get(joint)?.hinge
    }

    /// Joints that follow hinges.
    pub fn mimics(&self) -> &[Mimic] {
        &self.mimics
    }

    /// What a joint without a hinge follows; none for the root and for fixed joints.
    pub fn mimic_of(&self, joint: usize) -> Option<&Mimic> {
        self.mimics.get(self.links.get(joint)?.mimic?)
    }

    /// The axis about which a joint turns, in its own frame of reference; none for the root and for
    /// fixed joints.
    pub fn axis_of(&self, joint: usize) -> Option<Vec3> {
        let hinge = self.hinge_of(joint).map(|hinge| self.hinges[hinge].axis);
        hinge.or_else(|| self.mimic_of(joint).map(|mimic| mimic.axis))
    }

    /// Length of a `qpos`.
    pub fn qpos_len(&self) -> usize {
        ROOT_QPOS + self.hinges.len()
    }

    /// Brings a pose (joint 0 in the world, others parent-relative) onto the hinges and into their
    /// limits.
    ///
    /// From the root outwards, each hinge turns as near as it can to its joint's rotation in the
    /// world. So a hinge corrects the errors of those above it. A pose that is already on the
    /// hinges is unchanged, up to rounding.
    ///
    /// # Panics
    /// If the pose has fewer rotations than the skeleton has joints.
    pub fn fit(&self, rotations: &mut [Quat], fitted: &mut Fitted) {
        fitted.angles.resize(self.hinges.len(), 0.0);
        fitted.lacking.resize(self.links.len(), Quat::IDENTITY);
        fitted.clamped = 0;
        let mut most_sin_half = 0.0_f32;
        for (joint, link) in self.links.iter().enumerate() {
            let Some(parent) = link.parent else {
                fitted.lacking[joint] = Quat::IDENTITY;
                continue;
            };
            let wanted = (fitted.lacking[parent] * rotations[joint]).normalize();
            let made = match link.hinge {
                Some(hinge) => {
                    let of = &self.hinges[hinge];
                    let angle = of.angle_of(wanted);
                    let limited = of.limited(angle);
                    if (limited - angle).abs() > LIMIT_TOLERANCE_RAD {
                        fitted.clamped += 1;
                    }
                    fitted.angles[hinge] = limited;
                    of.rotation(limited)
                }
                None => self.carried(link, &fitted.angles),
            };
            let lacking = made.conjugate() * wanted;
            most_sin_half = most_sin_half.max(lacking.xyz().length());
            fitted.lacking[joint] = lacking;
            rotations[joint] = made;
        }
        fitted.residual_rad = 2.0 * most_sin_half.min(1.0).asin();
    }

    /// The pose for angles, one a hinge, and a rotation of the root: joint 0 in the world, others
    /// parent-relative.
    ///
    /// # Panics
    /// If there are fewer angles than hinges, or `out` is shorter than the skeleton.
    pub fn pose(&self, root: Quat, angles: &[f32], out: &mut [Quat]) {
        for (joint, link) in self.links.iter().enumerate() {
            out[joint] = match (link.parent, link.hinge) {
                (None, _) => root,
                (_, Some(hinge)) => self.hinges[hinge].rotation(angles[hinge]),
                (_, None) => self.carried(link, angles),
            };
        }
    }

    /// The rotation of a joint without a hinge: it turns with its parent, or follows a hinge.
    fn carried(&self, link: &Link, angles: &[f32]) -> Quat {
        match link.mimic {
            None => Quat::IDENTITY,
            Some(mimic) => {
                let mimic = &self.mimics[mimic];
                mimic.rotation(angles[mimic.hinge])
            }
        }
    }

    /// Writes a `qpos`: the root's position (native axes, metres) and rotation, and the angles.
    ///
    /// # Panics
    /// If `out` does not have [`Robot::qpos_len`] numbers, or the number of angles differs from
    /// that of hinges.
    pub fn write_qpos(&self, root: Vec3, rotation: Quat, angles: &[f32], qpos: &mut [f32]) {
        qpos[..3].copy_from_slice(&Convention::Ros.position_from_native(root).to_array());
        let rotation = Convention::Ros.rotation_from_native(rotation);
        qpos[3..ROOT_QPOS].copy_from_slice(&to_wxyz(rotation));
        qpos[ROOT_QPOS..].copy_from_slice(angles);
    }

    /// Reads a `qpos`: the root's position (native axes, metres), its rotation without normalising
    /// it, and the angles. Values are not checked.
    ///
    /// # Panics
    /// If there are fewer than [`Robot::qpos_len`] numbers.
    pub fn read_qpos<'a>(&self, qpos: &'a [f32]) -> (Vec3, Quat, &'a [f32]) {
        let root = Convention::Ros.position_to_native(Vec3::new(qpos[0], qpos[1], qpos[2]));
        let rotation = from_wxyz([qpos[3], qpos[4], qpos[5], qpos[6]]);
        let rotation = Convention::Ros.rotation_to_native(rotation);
        (root, rotation, &qpos[ROOT_QPOS..self.qpos_len()])
    }
}

//! The written form of a robot, as the table `[robot]` of a `pack.toml`, and its checks.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::{Hinge, Link, MimicDoc, Robot};
use crate::rotation::from_wxyz;
use crate::skeleton::Skeleton;

/// Largest difference of an axis or a rotation from unit length.
const UNIT_TOLERANCE: f32 = 1e-3;
/// Largest value of a limit, radians either way.
const MAX_LIMIT_RAD: f32 = 100.0;

/// A robot as written, with joints by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDoc {
    /// Name of the robot, as in its URDF.
    pub name: String,
    /// The hinges, in the order of MuJoCo's `qpos`.
    pub hinges: Vec<HingeDoc>,
    /// Joints that follow hinges. Most robots have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mimics: Vec<MimicDoc>,
}

/// A hinge as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HingeDoc {
    /// Name of a joint of the skeleton.
    pub joint: String,
    /// The axis in the joint's own frame of reference, native axes, unit length.
    pub axis: Vec3,
    /// (w, x, y, z): the joint's rotation relative to its parent at angle 0, native axes.
    pub rest: [f32; 4],
    /// Smallest angle, radians.
    pub lower_rad: f32,
    /// Largest angle, radians.
    pub upper_rad: f32,
    /// Highest turning rate, rad/s.
    pub max_speed_rad_per_s: f32,
    /// Largest change of the turning rate, rad/s². Left out: no limit is known. URDF and MJCF have
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_acceleration_rad_per_s2: Option<f32>,
}

/// Why a robot was refused. `hinge` is the index of the hinge at fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// No name.
    #[error("robot.name is empty; allowed: the name of the robot")]
    Name,
    /// No hinges.
    #[error("robot.hinges is empty; allowed: at least one hinge")]
    Empty,
    /// The skeleton has no joint of this name.
    #[error("robot.hinges[{hinge}].joint is {joint:?}; allowed: a joint of the skeleton")]
    UnknownJoint {
        #[allow(missing_docs)]
        hinge: usize,
        /// The unknown name.
        joint: String,
    },
    /// The joint is the root, which floats freely.
    #[error(
        "robot.hinges[{hinge}].joint is {joint:?}, the root, which floats; allowed: a joint that has a parent"
    )]
    Root {
        #[allow(missing_docs)]
        hinge: usize,
        /// Name of the root.
        joint: String,
    },
    /// The joint has two hinges.
    #[error(
        "robot.hinges[{hinge}].joint is {joint:?}, as that of a hinge before it; allowed: each joint once"
    )]
    Twice {
        #[allow(missing_docs)]
        hinge: usize,
        /// Name of the joint.
        joint: String,
    },
    /// A hinge comes before one above it.
    #[error(
        "robot.hinges[{hinge}].joint is {joint:?}, which comes before {above:?} that it hangs from; allowed: parents first"
    )]
    Order {
        #[allow(missing_docs)]
        hinge: usize,
        /// Name of the joint.
        joint: String,
        /// Name of the joint above it.
        above: String,
    },
    /// A vector or quaternion that is not of unit length.
    #[error("robot.hinges[{hinge}].{field} has length {length}; allowed: 0.999 to 1.001")]
    Length {
        #[allow(missing_docs)]
        hinge: usize,
        /// `axis` or `rest`.
        field: &'static str,
        /// Length of the vector or quaternion.
        length: f32,
    },
    /// A joint that follows a hinge cannot.
    #[error("joint {joint:?} cannot follow a hinge: {reason}")]
    Mimic {
        /// Name of the joint.
        joint: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A limit out of range.
    #[error("robot.hinges[{hinge}].{field} is {found}; allowed: {allowed}")]
    Limit {
        #[allow(missing_docs)]
        hinge: usize,
        /// `lower_rad`, `upper_rad`, `max_speed_rad_per_s` or `max_acceleration_rad_per_s2`.
        field: &'static str,
        /// The value that it has.
        found: f32,
        /// The values that are allowed.
        allowed: String,
    },
}

impl RobotDoc {
    /// Checks the robot, and finds its joints in `skeleton`.
    ///
    /// # Errors
    /// [`RobotError`] for the first value that is not accepted, with field and range.
    pub fn on(&self, skeleton: &Skeleton) -> Result<Robot, RobotError> {
        if self.name.is_empty() {
            return Err(RobotError::Name);
        }
        if self.hinges.is_empty() {
            return Err(RobotError::Empty);
        }
        let mut links: Vec<Link> = (skeleton.joints.iter())
            .map(|joint| Link {
                parent: joint.parent,
                hinge: None,
                mimic: None,
            })
            .collect();
        let mut hinges = Vec::with_capacity(self.hinges.len());
        for (nth, doc) in self.hinges.iter().enumerate() {
            let joint = joint_of(nth, &doc.joint, skeleton)?;
            if links[joint].hinge.is_some() {
                return Err(RobotError::Twice {
                    hinge: nth,
                    joint: doc.joint.clone(),
                });
            }
            links[joint].hinge = Some(nth);
            hinges.push(doc.check(nth, joint)?);
        }
        check_order(&hinges, &links, skeleton)?;
        let robot = Robot {
            name: self.name.clone(),
            hinges,
            links,
            mimics: Vec::new(),
        };
        robot.with_mimics(&self.mimics, skeleton)
    }
}

impl From<(&Robot, &Skeleton)> for RobotDoc {
    fn from((robot, skeleton): (&Robot, &Skeleton)) -> Self {
        let hinge = |of: &Hinge| HingeDoc {
            joint: skeleton.joints[of.joint].name.clone(),
            axis: of.axis,
            rest: crate::rotation::to_wxyz(of.rest),
            lower_rad: of.lower_rad,
            upper_rad: of.upper_rad,
            max_speed_rad_per_s: of.max_speed_rad_per_s,
            max_acceleration_rad_per_s2: of.max_acceleration_rad_per_s2,
        };
        Self {
            name: robot.name.clone(),
            hinges: robot.hinges.iter().map(hinge).collect(),
            mimics: (robot.mimics.iter()).map(|of| of.doc(robot, skeleton)).collect(),
        }
    }
}

fn joint_of(hinge: usize, name: &str, skeleton: &Skeleton) -> Result<usize, RobotError> {
    let joint = || name.to_owned();
    match skeleton.joint_index(name) {
        None => Err(RobotError::UnknownJoint {
            hinge,
            joint: joint(),
        }),
        Some(index) if skeleton.joints[index].parent.is_none() => Err(RobotError::Root {
            hinge,
            joint: joint(),
        }),
        Some(index) => Ok(index),
    }
}

/// Checks that every hinge comes after those above it.
fn check_order(hinges: &[Hinge], links: &[Link], skeleton: &Skeleton) -> Result<(), RobotError> {
    for (nth, hinge) in hinges.iter().enumerate() {
        let mut above = links[hinge.joint].parent;
        while let Some(joint) = above {
            if links[joint].hinge.is_some_and(|of| of > nth) {
                let name = |joint: usize| skeleton.joints[joint].name.clone();
                return Err(RobotError::Order {
                    hinge: nth,
                    joint: name(hinge.joint),
                    above: name(joint),
                });
            }
            above = links[joint].parent;
        }
    }
    Ok(())
}

impl HingeDoc {
    fn check(&self, hinge: usize, joint: usize) -> Result<Hinge, RobotError> {
        let unit = |field, length: f32| match (length - 1.0).abs() <= UNIT_TOLERANCE {
            true => Ok(()),
            // NaN too.
            false => Err(RobotError::Length { hinge, field, length }),
        };
        unit("axis", self.axis.length())?;
        let rest: Quat = from_wxyz(self.rest);
        unit("rest", rest.length())?;
        let limit = |field, found: f32, fits: bool, allowed: String| match fits {
            true => Ok(()),
            false => Err(RobotError::Limit {
                hinge,
                field,
                found,
                allowed,
            }),
        };
        let (lower, upper, speed) = (self.lower_rad, self.upper_rad, self.max_speed_rad_per_s);
        let low = (-MAX_LIMIT_RAD..=MAX_LIMIT_RAD).contains(&lower);
        limit(
            "lower_rad",
            lower,
            low,
            format!("-{MAX_LIMIT_RAD} to {MAX_LIMIT_RAD}"),
        )?;
        let high = lower < upper && upper <= MAX_LIMIT_RAD;
        limit(
            "upper_rad",
            upper,
            high,
            format!("above {lower}, to {MAX_LIMIT_RAD}"),
        )?;
        let (fast, above) = (speed > 0.0 && speed.is_finite(), || "above 0".to_owned());
        limit("max_speed_rad_per_s", speed, fast, above())?;
        if let Some(most) = self.max_acceleration_rad_per_s2 {
            let is_limit = most > 0.0 && most.is_finite();
            limit("max_acceleration_rad_per_s2", most, is_limit, above())?;
        }
        Ok(Hinge {
            joint,
            axis: self.axis.normalize(),
            rest: rest.normalize(),
            lower_rad: lower,
            upper_rad: upper,
            max_speed_rad_per_s: speed,
            max_acceleration_rad_per_s2: self.max_acceleration_rad_per_s2,
        })
    }
}

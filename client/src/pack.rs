//! A model pack as the server describes it.

use std::ops::RangeInclusive;
use std::sync::Arc;

use glam::Vec3;
use troupe_motion::robot::{HingeDoc, MimicDoc, Robot, RobotDoc};
use troupe_motion::skeleton::{ContactParams, Joint, Skeleton};
use troupe_proto::v1;

use crate::error::{AnswerError, RequestError};

/// A pack that a server has loaded, with its skeleton ready for motion maths. Clones are cheap.
#[derive(Debug, Clone)]
pub struct Pack {
    message: Arc<v1::Pack>,
    skeleton: Arc<Skeleton>,
    /// The body of the skeleton, in a pack of many bodies.
    body: Arc<str>,
    /// The skeleton of the user's own that its characters wear. Empty: none.
    worn: Arc<str>,
}

impl Pack {
    /// A pack with a known skeleton. That of the message is ignored.
    pub fn with_skeleton(message: v1::Pack, skeleton: Skeleton) -> Self {
        Self {
            message: Arc::new(message),
            skeleton: Arc::new(skeleton),
            body: "".into(),
            worn: "".into(),
        }
    }

    /// Name of the pack on the server.
    pub fn name(&self) -> &str {
        &self.message.name
    }

    /// Name of the body whose skeleton it has; empty for the pack's own.
    pub fn body(&self) -> &str {
        &self.body
    }

    /// Name of the skeleton of the user's own that its characters wear; empty for none.
    pub fn worn(&self) -> &str {
        &self.worn
    }

    /// The same pack, whose characters wear a skeleton of the user's own
    /// ([`Client::put_skeleton`](crate::Client::put_skeleton)). Sessions, in-betweens and motions
    /// of the result are on that skeleton, in its size. Contacts stay those of the pack.
    ///
    /// # Errors
    /// [`AnswerError`] if the server's answer is no skeleton.
    pub fn wearing(&self, own: &v1::OwnSkeleton) -> Result<Self, AnswerError> {
        let as_pack = v1::Pack {
            name: own.name.clone(),
            joints: own.joints.clone(),
            left_axis: own.left_axis,
            robot: own.robot.clone(),
            ..v1::Pack::default()
        };
        Ok(Self {
            message: self.message.clone(),
            skeleton: Arc::new(skeleton(&as_pack)?),
            body: self.body.clone(),
            worn: own.name.as_str().into(),
        })
    }

    /// The same pack with the skeleton of one of its bodies.
    pub(crate) fn with_body(&self, body: &v1::PackBody) -> Result<Self, AnswerError> {
        let as_pack = v1::Pack {
            name: self.message.name.clone(),
            joints: body.joints.clone(),
            left_axis: body.left_axis,
            ground_y: self.message.ground_y,
            robot: body.robot.clone(),
            ..v1::Pack::default()
        };
        Ok(Self {
            message: self.message.clone(),
            skeleton: Arc::new(skeleton(&as_pack)?),
            body: body.name.as_str().into(),
            worn: "".into(),
        })
    }

    /// The pack's skeleton, shared by every clip that comes back.
    pub fn skeleton(&self) -> &Arc<Skeleton> {
        &self.skeleton
    }

    /// The robot that the pack animates, if any.
    pub fn robot(&self) -> Option<&Robot> {
        self.skeleton.robot.as_ref()
    }

    /// Frames per second.
    pub fn fps(&self) -> f32 {
        self.message.fps
    }

    /// Context frames before every gap.
    pub fn context_frames(&self) -> usize {
        self.message.context_frames as usize
    }

    /// Frames that a segment may have, from the first context frame to the last target keyframe.
    pub fn segment_frames(&self) -> RangeInclusive<usize> {
        self.message.min_frames as usize..=self.message.max_frames as usize
    }

    /// All that the server says about the pack.
    pub fn description(&self) -> &v1::Pack {
        &self.message
    }

    /// Checks that the pack can fill the gap between two frames of a clip: `from`, the last context
    /// frame, and `to`, the target keyframe.
    ///
    /// # Errors
    /// [`RequestError::ContextCut`] and [`RequestError::Span`], which name the allowed frames.
    pub fn check_span(&self, from: usize, to: usize) -> Result<(), RequestError> {
        let least = self.context_frames().saturating_sub(1);
        if from < least {
            return Err(RequestError::ContextCut { from, least });
        }
        let start = from - least;
        let (min, max) = self.segment_frames().into_inner();
        let frames = (to + 1).saturating_sub(start);
        if !(min..=max).contains(&frames) {
            return Err(RequestError::Span {
                from,
                to,
                frames,
                pack: self.name().to_owned(),
                min,
                max,
                least_to: start + min - 1,
                most_to: start + max - 1,
            });
        }
        Ok(())
    }

    /// Checks that a clip with this rate and number of joints fits the pack.
    pub(crate) fn check_clip(&self, fps: f32, joints: usize) -> Result<(), RequestError> {
        if (fps - self.fps()).abs() > 1e-2 {
            return Err(RequestError::FrameRate {
                clip: fps,
                pack: self.fps(),
            });
        }
        let expected = self.skeleton().joint_count();
        match joints == expected {
            true => Ok(()),
            false => Err(RequestError::Joints {
                clip: joints,
                pack: expected,
            }),
        }
    }
}

impl TryFrom<v1::Pack> for Pack {
    type Error = AnswerError;

    fn try_from(message: v1::Pack) -> Result<Self, AnswerError> {
        let skeleton = Arc::new(skeleton(&message)?);
        Ok(Self {
            message: Arc::new(message),
            skeleton,
            body: "".into(),
            worn: "".into(),
        })
    }
}

/// Builds the skeleton from the pack's joints and contact rules.
fn skeleton(pack: &v1::Pack) -> Result<Skeleton, AnswerError> {
    let fault = |reason: String| AnswerError::Skeleton {
        pack: pack.name.clone(),
        reason,
    };
    let vector = |v: Option<v1::Vec3>| v.map(|v| Vec3::new(v.x, v.y, v.z));
    let joints = pack
        .joints
        .iter()
        .map(|joint| Joint {
            name: joint.name.clone(),
            parent: usize::try_from(joint.parent).ok(),
            offset_m: vector(joint.offset).unwrap_or_default(),
        })
        .collect::<Vec<_>>();
    let contacts = pack
        .contact_rules
        .as_ref()
        .map(|rules| {
            let joint = |name: &String| {
                let index = joints.iter().position(|j| j.name == *name);
                index.ok_or_else(|| fault(format!("no joint is named `{name}`, but it is a contact joint")))
            };
            let joints = pack.contact_joints.iter().map(joint).collect::<Result<_, _>>()?;
            Ok::<_, AnswerError>(ContactParams {
                joints,
                max_height_m: rules.max_height.clone(),
                max_speed_mps: rules.max_speed,
                clearance_m: rules.clearance.clone(),
            })
        })
        .transpose()?;
    let left_axis = vector(pack.left_axis).ok_or(AnswerError::Missing("left_axis"))?;
    let skeleton =
        Skeleton::new(joints, left_axis, pack.ground_y, contacts).map_err(|e| fault(e.to_string()))?;
    match &pack.robot {
        Some(of) => skeleton.with_robot(&robot(of)).map_err(|e| fault(e.to_string())),
        None => Ok(skeleton),
    }
}

/// The robot of the message. Missing fields are refused like invalid ones.
fn robot(robot: &v1::Robot) -> RobotDoc {
    let hinge = |hinge: &v1::Hinge| {
        let (axis, rest) = turning(hinge.axis, hinge.rest);
        HingeDoc {
            joint: hinge.joint.clone(),
            axis,
            rest,
            lower_rad: hinge.lower,
            upper_rad: hinge.upper,
            max_speed_rad_per_s: hinge.max_speed,
            max_acceleration_rad_per_s2: hinge.max_acceleration,
        }
    };
    let mimic = |mimic: &v1::Mimic| {
        let (axis, rest) = turning(mimic.axis, mimic.rest);
        MimicDoc {
            joint: mimic.joint.clone(),
            follows: mimic.follows.clone(),
            multiplier: mimic.multiplier,
            offset_rad: mimic.offset,
            axis,
            rest,
        }
    };
    RobotDoc {
        name: robot.name.clone(),
        hinges: robot.hinges.iter().map(hinge).collect(),
        mimics: robot.mimics.iter().map(mimic).collect(),
    }
}

/// An axis, and a rotation (w, x, y, z). Missing ones have no length, which is refused later.
fn turning(axis: Option<v1::Vec3>, rest: Option<v1::Quat>) -> (Vec3, [f32; 4]) {
    let (axis, rest) = (axis.unwrap_or_default(), rest.unwrap_or_default());
    (
        Vec3::new(axis.x, axis.y, axis.z),
        [rest.w, rest.x, rest.y, rest.z],
    )
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A pack of two joints, one of which is a contact joint.
    pub(crate) fn message() -> v1::Pack {
        let joint = |name: &str, parent, y| v1::Joint {
            name: name.to_owned(),
            parent,
            offset: Some(v1::Vec3 { x: 0.0, y, z: 0.0 }),
        };
        v1::Pack {
            name: "pair".to_owned(),
            fps: 30.0,
            joints: vec![joint("Hips", -1, 0.0), joint("Foot", 0, -0.9)],
            contact_joints: vec!["Foot".to_owned()],
            context_frames: 4,
            min_frames: 12,
            max_frames: 64,
            left_axis: Some(v1::Vec3 {
                x: 1.0,
                y: 0.0,
                z: 0.0,
            }),
            contact_rules: Some(v1::ContactRules {
                max_height: vec![0.15],
                max_speed: 0.4,
                clearance: vec![0.1],
            }),
            ..v1::Pack::default()
        }
    }

    /// The same pair as a robot: the foot turns about its left axis.
    pub(crate) fn robot_message() -> v1::Pack {
        let hinge = v1::Hinge {
            joint: "Foot".to_owned(),
            axis: Some(v1::Vec3 {
                x: 1.0,
                y: 0.0,
                z: 0.0,
            }),
            rest: Some(v1::Quat {
                w: 1.0,
                x: 0.0,
                y: 0.0,
                z: 0.0,
            }),
            lower: -0.5,
            upper: 1.5,
            max_speed: 10.0,
            max_acceleration: None,
        };
        v1::Pack {
            robot: Some(v1::Robot {
                name: "hopper".to_owned(),
                hinges: vec![hinge],
                qpos_size: 8,
                mimics: Vec::new(),
            }),
            ..message()
        }
    }

    #[test]
    fn a_robot_comes_with_its_hinges() {
        let pack = Pack::try_from(robot_message()).unwrap();
        let robot = pack.robot().unwrap();
        assert_eq!(
            (robot.name(), robot.qpos_len(), robot.hinges()[0].joint),
            ("hopper", 8, 1)
        );
        assert!(Pack::try_from(message()).unwrap().robot().is_none());
        let mut followed = robot_message();
        followed.joints.push(v1::Joint {
            name: "Toe".to_owned(),
            parent: 1,
            offset: Some(v1::Vec3::default()),
        });
        let robot = followed.robot.as_mut().unwrap();
        robot.mimics.push(v1::Mimic {
            joint: "Toe".to_owned(),
            follows: "Foot".to_owned(),
            multiplier: -0.5,
            offset: 0.1,
            axis: robot.hinges[0].axis,
            rest: robot.hinges[0].rest,
        });
        let pack = Pack::try_from(followed).unwrap();
        let toe = pack.robot().unwrap().mimics()[0];
        assert_eq!(
            (toe.joint, toe.hinge, toe.multiplier, toe.offset_rad),
            (2, 0, -0.5, 0.1)
        );
        let mut broken = robot_message();
        broken.robot.as_mut().unwrap().hinges[0].rest = None;
        let error = Pack::try_from(broken).unwrap_err().to_string();
        assert!(error.contains("robot.hinges[0].rest has length 0"), "{error}");
    }

    #[test]
    fn the_skeleton_comes_with_its_contacts() {
        let pack = Pack::try_from(message()).unwrap();
        let skeleton = pack.skeleton();
        assert_eq!(skeleton.joints[1].parent, Some(0));
        assert_eq!(skeleton.joints[1].offset_m, Vec3::Y * -0.9);
        assert_eq!(skeleton.left_axis, Vec3::X);
        let contacts = skeleton.contacts.as_ref().unwrap();
        assert_eq!((&contacts.joints[..], contacts.max_speed_mps), (&[1][..], 0.4));
    }

    #[test]
    fn a_broken_skeleton_is_an_error() {
        let broken: [fn(&mut v1::Pack); 4] = [
            |pack| pack.joints.clear(),
            |pack| pack.left_axis = None,
            |pack| pack.contact_joints = vec!["Hand".to_owned()],
            |pack| pack.joints[1].parent = 7,
        ];
        for (nth, break_it) in broken.iter().enumerate() {
            let mut message = message();
            break_it(&mut message);
            assert!(Pack::try_from(message).is_err(), "{nth}");
        }
    }

    #[test]
    fn a_span_outside_the_limits_says_which_would_do() {
        let pack = Pack::try_from(message()).unwrap();
        // Context 7..=10; a segment of 12 frames ends at 18, one of 64 at 70.
        assert_eq!(pack.check_span(10, 18), Ok(()));
        assert_eq!(pack.check_span(10, 70), Ok(()));
        for to in [0, 17, 71] {
            let error = pack.check_span(10, to).unwrap_err();
            assert!(
                matches!(
                    error,
                    RequestError::Span {
                        least_to: 18,
                        most_to: 70,
                        ..
                    }
                ),
                "{error}"
            );
            assert!(error.to_string().contains("12 to 64"), "{error}");
        }
        assert_eq!(
            pack.check_span(2, 20),
            Err(RequestError::ContextCut { from: 2, least: 3 })
        );
    }
}

//! What a robot's frames are in ROS: joint states, and the place of its root link.
//!
//! A session's `qpos` has MuJoCo's axes, which are those of REP 103: X forward, Y left, Z up,
//! metres. Its quaternions are w x y z, those of ROS are x y z w.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use ros2_client::builtin_interfaces::Time;
use troupe_client::Pack;
use troupe_motion::robot::ROOT_QPOS;

use crate::messages::{Header, JointState, TfMessage, Transform, TransformStamped};

/// The frame in which robots move.
pub(crate) const ODOM: &str = "odom";

/// Names of a robot in ROS.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Body {
    /// Names of the joints in the URDF, in the order of `qpos`.
    joints: Vec<String>,
    /// Whether a joint turns without end.
    endless: Vec<bool>,
    /// Frame of the root link, such as `g1/pelvis`.
    root: String,
}

/// Place and heading on the ground, metres and radians.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Place {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) heading: f32,
}

/// A robot's newest pose.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shown {
    /// Number of the stream's tick. None before the first of a stream.
    tick: Option<u64>,
    translation: DVec3,
    rotation: DQuat,
    angles: Vec<f64>,
    /// Radians per second, from the frame before.
    speeds: Vec<f64>,
}

impl Body {
    /// The names of a pack's robot. `suffix` is what names of joints end with in the URDF, because
    /// packs leave it out. None if the pack has no robot.
    pub(crate) fn of(pack: &Pack, robot: &str, suffix: &str) -> Option<Self> {
        let skeleton = pack.skeleton();
        let hinges = pack.robot()?.hinges();
        let name = |joint: usize| format!("{}{suffix}", skeleton.joints[joint].name);
        Some(Self {
            joints: hinges.iter().map(|hinge| name(hinge.joint)).collect(),
            endless: hinges.iter().map(|hinge| hinge.is_endless()).collect(),
            root: format!("{robot}/{}", skeleton.joints.first()?.name),
        })
    }

    /// The pose of a frame. None if the frame has another number of joints.
    pub(crate) fn shown(
        &self,
        tick: u64,
        rate_hz: f64,
        qpos: &[f32],
        before: Option<&Shown>,
    ) -> Option<Shown> {
        let (root, angles) = qpos.split_at_checked(ROOT_QPOS)?;
        let &[x, y, z, qw, qx, qy, qz] = root else {
            return None;
        };
        if angles.len() != self.joints.len() {
            return None;
        }
        let angles: Vec<f64> = angles.iter().map(|&angle| f64::from(angle)).collect();
        let since = |before: &Shown| tick.checked_sub(before.tick?).filter(|&ticks| ticks > 0);
        let speeds = match before.and_then(|before| Some((before, since(before)?))) {
            Some((before, ticks)) => self.speeds(before, &angles, ticks as f64 / rate_hz),
            None => vec![0.0; angles.len()],
        };
        Some(Shown {
            tick: Some(tick),
            translation: DVec3::new(x.into(), y.into(), z.into()),
            rotation: DQuat::from_xyzw(qx.into(), qy.into(), qz.into(), qw.into()),
            angles,
            speeds,
        })
    }

    fn speeds(&self, before: &Shown, angles: &[f64], seconds: f64) -> Vec<f64> {
        let pairs = angles.iter().zip(&before.angles).zip(&self.endless);
        let speed = |((now, before), endless): ((&f64, &f64), &bool)| {
            let turned = match endless {
                true => (now - before + PI).rem_euclid(TAU) - PI,
                false => now - before,
            };
            turned / seconds
        };
        pairs.map(speed).collect()
    }

    /// The joints of a pose.
    pub(crate) fn joint_state(&self, shown: &Shown, stamp: Time) -> JointState {
        JointState {
            header: Header {
                stamp,
                frame_id: String::new(),
            },
            name: self.joints.clone(),
            position: shown.angles.clone(),
            velocity: shown.speeds.clone(),
            effort: Vec::new(),
        }
    }

    /// The place of the root link of a pose.
    pub(crate) fn transform(&self, shown: &Shown, stamp: Time) -> TfMessage {
        let transform = TransformStamped {
            header: Header {
                stamp,
                frame_id: ODOM.to_owned(),
            },
            child_frame_id: self.root.clone(),
            transform: Transform {
                translation: shown.translation.into(),
                rotation: shown.rotation.into(),
            },
        };
        TfMessage {
            transforms: vec![transform],
        }
    }

    /// Frame of the root link.
    pub(crate) fn root(&self) -> &str {
        &self.root
    }
}

impl Shown {
    /// Place and heading: the direction of the root link's X axis over the ground.
    pub(crate) fn place(&self) -> Place {
        let ahead = self.rotation * DVec3::X;
        Place {
            x: self.translation.x as f32,
            y: self.translation.y as f32,
            heading: ahead.y.atan2(ahead.x) as f32,
        }
    }

    /// The stream begins again: the next tick says nothing of speeds.
    pub(crate) fn begin(&mut self) {
        self.tick = None;
    }

    /// Holds the pose: nothing turns any more.
    pub(crate) fn stop(&mut self) {
        self.speeds.fill(0.0);
    }
}

#[cfg(test)]
#[path = "body_tests.rs"]
mod tests;

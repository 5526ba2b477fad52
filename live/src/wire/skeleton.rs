//! Skeletons and robots as messages.

use troupe_motion::robot::{Hinge, Mimic};
use troupe_motion::{Joint, Quat, Robot, Skeleton, Vec3};
use troupe_proto::v1;

/// A joint as a message.
pub fn joint_message(joint: &Joint) -> v1::Joint {
    v1::Joint {
        name: joint.name.clone(),
        parent: joint.parent.map_or(-1, |index| index as i32),
        offset: Some(vector_message(joint.offset_m)),
    }
}

/// A robot on its skeleton as a message.
pub fn robot_message(robot: &Robot, skeleton: &Skeleton) -> v1::Robot {
    let hinge = |hinge: &Hinge| v1::Hinge {
        joint: skeleton.joints[hinge.joint].name.clone(),
        axis: Some(vector_message(hinge.axis)),
        rest: Some(rotation_message(hinge.rest)),
        lower: hinge.lower_rad,
        upper: hinge.upper_rad,
        max_speed: hinge.max_speed_rad_per_s,
        max_acceleration: hinge.max_acceleration_rad_per_s2,
    };
    let mimic = |mimic: &Mimic| v1::Mimic {
        joint: skeleton.joints[mimic.joint].name.clone(),
        follows: skeleton.joints[robot.hinges()[mimic.hinge].joint].name.clone(),
        multiplier: mimic.multiplier,
        offset: mimic.offset_rad,
        axis: Some(vector_message(mimic.axis)),
        rest: Some(rotation_message(mimic.rest)),
    };
    v1::Robot {
        name: robot.name().to_owned(),
        hinges: robot.hinges().iter().map(hinge).collect(),
        qpos_size: robot.qpos_len() as u32,
        mimics: robot.mimics().iter().map(mimic).collect(),
    }
}

fn rotation_message(q: Quat) -> v1::Quat {
    v1::Quat {
        w: q.w,
        x: q.x,
        y: q.y,
        z: q.z,
    }
}

/// A native vector as a message.
pub fn vector_message(v: Vec3) -> v1::Vec3 {
    v1::Vec3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

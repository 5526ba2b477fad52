//! What the tests of the commands share.

use std::sync::Arc;

use glam::Vec3;
use troupe_motion::skeleton::{Joint, Skeleton};
use troupe_proto::v1;

/// A skeleton of one joint.
pub(crate) fn lone_hips() -> Arc<Skeleton> {
    let joint = Joint {
        name: "Hips".to_owned(),
        parent: None,
        offset_m: Vec3::ZERO,
    };
    Arc::new(Skeleton::new(vec![joint], Vec3::X, 0.0, None).unwrap())
}

/// A skeleton of hips, spine, head and two feet.
pub(crate) fn doll() -> Arc<Skeleton> {
    let joint = |name: &str, parent, offset_m| Joint {
        name: name.to_owned(),
        parent,
        offset_m,
    };
    let joints = vec![
        joint("Hips", None, Vec3::ZERO),
        joint("Spine", Some(0), Vec3::Y * 0.5),
        joint("Head", Some(1), Vec3::Y * 0.3),
        joint("Foot_L", Some(0), Vec3::new(0.1, -0.9, 0.0)),
        joint("Foot_R", Some(0), Vec3::new(-0.1, -0.9, 0.0)),
    ];
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap())
}

/// A pack of two joints, hips and a foot, as a server describes it.
pub(crate) fn pair() -> v1::Pack {
    let joint = |name: &str, parent, y| v1::Joint {
        name: name.to_owned(),
        parent,
        offset: Some(v1::Vec3 { x: 0.0, y, z: 0.0 }),
    };
    v1::Pack {
        name: "pair".to_owned(),
        fps: 30.0,
        joints: vec![joint("Hips", -1, 0.0), joint("Foot", 0, -0.9)],
        left_axis: Some(LEFT),
        ..v1::Pack::default()
    }
}

/// The same pair as a robot: the foot turns about its left axis.
pub(crate) fn hopper() -> v1::Pack {
    let hinge = v1::Hinge {
        joint: "Foot".to_owned(),
        axis: Some(LEFT),
        rest: Some(v1::Quat {
            w: 1.0,
            ..v1::Quat::default()
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
        ..pair()
    }
}

const LEFT: v1::Vec3 = v1::Vec3 {
    x: 1.0,
    y: 0.0,
    z: 0.0,
};

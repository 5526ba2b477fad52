//! The G1 robot, for tests.

use std::sync::Arc;

use glam::{Quat, Vec3};
use serde::Deserialize;

use super::RobotDoc;
use crate::clip::Clip;
use crate::conventions::Convention;
use crate::skeleton::Skeleton;

/// The two tables of a `pack.toml` that it needs.
#[derive(Deserialize)]
pub(crate) struct Tables {
    pub(crate) skeleton: Skeleton,
    pub(crate) robot: RobotDoc,
}

pub(crate) fn tables() -> Tables {
    toml::from_str(include_str!("g1.toml")).unwrap()
}

/// The Unitree G1 with 29 hinges and 34 joints.
pub(crate) fn g1() -> Arc<Skeleton> {
    let Tables { skeleton, robot } = tables();
    Arc::new(skeleton.with_robot(&robot).unwrap())
}

/// The clip of rows as Unitree publishes them, at 30 frames a second, without the reader's checks.
pub(crate) fn clip_of_rows(text: &str, skeleton: &Arc<Skeleton>) -> Clip {
    let robot = skeleton.robot.as_ref().unwrap();
    let (mut roots, mut rotations) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let row: Vec<f32> = line.split(',').map(|number| number.parse().unwrap()).collect();
        roots.push(Convention::Ros.position_to_native(Vec3::from_slice(&row)));
        let turn = Quat::from_slice(&row[3..]).normalize();
        let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
        robot.pose(Convention::Ros.rotation_to_native(turn), &row[7..], &mut pose);
        rotations.extend(pose);
    }
    Clip::new(Arc::clone(skeleton), 30.0, roots, rotations).unwrap()
}

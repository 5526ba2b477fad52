//! The G1 robot, for tests.

use std::sync::Arc;

use serde::Deserialize;

use super::RobotDoc;
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

//! Options of the reader as JSON.

use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::Skeleton;
use troupe_motion::read::units::{metres_of, names as unit_names};
use troupe_motion::read::{Options, QuaternionOrder, RestPose, Up};
use troupe_motion::robot::RobotDoc;

/// What the viewer gives. Names are those of the command line's options.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Given {
    up: Option<String>,
    unit: Option<String>,
    fps: Option<f32>,
    resample_fps: Option<f32>,
    animation: Option<String>,
    root: Option<String>,
    rest_pose: Option<String>,
    quaternion: Option<String>,
    other_bones: bool,
    /// The tables of a pack's `pack.toml`.
    skeleton: Option<Skeleton>,
    robot: Option<RobotDoc>,
}

pub(crate) fn parse(text: &str) -> Result<Options, String> {
    let given: Given = serde_json::from_str(text).map_err(|error| format!("options: {error}"))?;
    let skeleton = match (given.skeleton, given.robot) {
        (Some(skeleton), Some(robot)) => {
            Some(skeleton.with_robot(&robot).map_err(|error| error.to_string())?)
        }
        (skeleton, _) => skeleton,
    };
    Ok(Options {
        up: named("up", given.up, Up::of_name, "x, y, z, -x, -y, -z")?,
        unit_m: named("unit", given.unit, metres_of, &unit_names())?,
        fps: given.fps,
        resample_fps: given.resample_fps,
        animation: given.animation,
        root: given.root,
        rest_pose: named(
            "rest_pose",
            given.rest_pose,
            RestPose::of_name,
            "t, a, standing, none",
        )?,
        quaternion: named(
            "quaternion",
            given.quaternion,
            QuaternionOrder::of_name,
            "xyzw, wxyz",
        )?,
        other_bones: given.other_bones,
        skeleton: skeleton.map(Arc::new),
        ..Options::default()
    })
}

fn named<T>(
    field: &str,
    name: Option<String>,
    of_name: fn(&str) -> Option<T>,
    allowed: &str,
) -> Result<Option<T>, String> {
    let Some(name) = name else {
        return Ok(None);
    };
    match of_name(&name) {
        Some(value) => Ok(Some(value)),
        None => Err(format!("{field} is {name:?}; allowed: {allowed}")),
    }
}

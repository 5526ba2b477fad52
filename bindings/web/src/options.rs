//! Options of the reader as JSON.

use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::Skeleton;
use troupe_motion::read::units::metres_of;
use troupe_motion::read::{
    AngleUnit, JointOrder, LeadingPose, OptionName, Options, QuaternionOrder, RestPose, Up,
};
use troupe_motion::robot::RobotDoc;

/// What the viewer gives. Names are those of [`OptionName`].
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
    leading_pose: Option<String>,
    max_slide_m: Option<f32>,
    other_bones: bool,
    quaternion: Option<String>,
    degrees: Option<bool>,
    /// `tree`, `isaaclab`, or the names of the hinges' joints between commas.
    joint_order: Option<String>,
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
        up: named(OptionName::Up, given.up, Up::of_name)?,
        unit_m: named(OptionName::Unit, given.unit, metres_of)?,
        fps: given.fps,
        resample_fps: given.resample_fps,
        animation: given.animation,
        root: given.root,
        rest_pose: named(OptionName::RestPose, given.rest_pose, RestPose::of_name)?,
        leading_pose: named(OptionName::LeadingPose, given.leading_pose, LeadingPose::of_name)?
            .unwrap_or_default(),
        max_slide_m: given.max_slide_m,
        other_bones: given.other_bones,
        quaternion: named(OptionName::Quaternion, given.quaternion, QuaternionOrder::of_name)?,
        angles: given.degrees.map(|are_degrees| match are_degrees {
            true => AngleUnit::Degrees,
            false => AngleUnit::Radians,
        }),
        joint_order: given.joint_order.as_deref().map(JointOrder::of_name),
        skeleton: skeleton.map(Arc::new),
        ..Options::default()
    })
}

fn named<T>(
    option: OptionName,
    name: Option<String>,
    of_name: fn(&str) -> Option<T>,
) -> Result<Option<T>, String> {
    let Some(name) = name else {
        return Ok(None);
    };
    match of_name(&name) {
        Some(value) => Ok(Some(value)),
        None => {
            let allowed = option.values().join(", ");
            Err(format!("{} is {name:?}; allowed: {allowed}", option.name()))
        }
    }
}

//! Keyframes of robots, given as MuJoCo's `qpos`.

use troupe_character::limits::UNIT_TOLERANCE;
use troupe_character::{FieldError, Path};
use troupe_motion::robot::ROOT_QPOS;
use troupe_motion::root::heading_of;
use troupe_motion::{GlobalRoot, Quat, Skeleton};
use troupe_proto::v1;

use super::ANGLE_TOLERANCE_RAD;

/// Checks the `qpos` of a keyframe, and returns root and pose. In the pose, joint 0 is in the world
/// and others are relative to their parents.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(super) fn check_qpos(
    path: &Path<'_>,
    key: &v1::Keyframe,
    skeleton: &Skeleton,
) -> Result<(GlobalRoot, Vec<Quat>), FieldError> {
    let whole = path.field("qpos");
    let Some(robot) = &skeleton.robot else {
        return Err(whole.error(
            "is given, but the pack has no robot",
            "root and pose; qpos for packs with a robot",
        ));
    };
    if key.root.is_some() || key.pose.is_some() {
        return Err(whole.error("cannot be combined with root or pose", "qpos, or root and pose"));
    }
    let size = robot.qpos_len();
    if key.qpos.len() != size {
        return Err(whole.error(
            format!("has {} numbers", key.qpos.len()),
            format!(
                "exactly {size}: x, y, z, the root's rotation (w, x, y, z) and {} angles",
                size - ROOT_QPOS
            ),
        ));
    }
    for (index, value) in key.qpos.iter().enumerate() {
        if !value.is_finite() {
            let path = path.element("qpos", index);
            return Err(path.error(format!("is {value}"), "a finite number"));
        }
    }
    let (root, rotation, angles) = robot.read_qpos(&key.qpos);
    let length = rotation.length();
    let unit = 1.0 - UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE;
    if !unit.contains(&length) {
        return Err(path.element("qpos", 3).error(
            format!("the root's rotation has length {length}"),
            format!("unit length, {} to {}", unit.start(), unit.end()),
        ));
    }
    let mut within = Vec::with_capacity(angles.len());
    for (index, (hinge, &angle)) in robot.hinges().iter().zip(angles).enumerate() {
        let limited = hinge.limited(angle);
        if (limited - angle).abs() > ANGLE_TOLERANCE_RAD {
            let name = &skeleton.joints[hinge.joint].name;
            return Err(path.element("qpos", ROOT_QPOS + index).error(
                format!("the angle of {name} is {angle}"),
                format!("{} to {}", hinge.lower_rad, hinge.upper_rad),
            ));
        }
        within.push(limited);
    }
    let mut rotations = vec![Quat::IDENTITY; skeleton.joint_count()];
    robot.pose(rotation / length, &within, &mut rotations);
    let heading = heading_of(rotations[0], skeleton.left_axis);
    Ok((GlobalRoot::new(root, heading), rotations))
}

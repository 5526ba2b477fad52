//! Robots: frames on their hinges, and keyframes as MuJoCo's `qpos`.

use troupe_motion::robot::{Fitted, ROOT_QPOS};
use troupe_motion::root::heading_of;
use troupe_motion::{GlobalRoot, Quat, Robot, Skeleton, Vec3};
use troupe_proto::v1;

use super::{ANGLE_TOLERANCE_RAD, FieldError, Path, UNIT_TOLERANCE};

/// What is told of a robot's frames.
#[derive(Debug, Default)]
pub(super) struct HingeColumns {
    /// `frames * qpos_len`, where asked for.
    pub(super) qpos: Vec<f32>,
    /// [`Fitted::residual_rad`] of each frame.
    pub(super) residuals: Vec<f32>,
    /// [`Fitted::clamped`] of each frame.
    pub(super) clamped: Vec<u32>,
}

/// Brings frames onto the robot's hinges and into their limits.
pub(super) fn onto_hinges(
    robot: &Robot,
    roots: &[Vec3],
    rotations: &mut [Quat],
    wants_qpos: bool,
) -> HingeColumns {
    let (frames, size) = (roots.len(), robot.qpos_len());
    let joints = rotations.len() / frames.max(1);
    let mut columns = HingeColumns {
        qpos: vec![0.0; if wants_qpos { frames * size } else { 0 }],
        residuals: Vec::with_capacity(frames),
        clamped: Vec::with_capacity(frames),
    };
    let mut fitted = Fitted::default();
    for (frame, (&root, pose)) in roots.iter().zip(rotations.chunks_exact_mut(joints)).enumerate() {
        robot.fit(pose, &mut fitted);
        columns.residuals.push(fitted.residual_rad);
        columns.clamped.push(fitted.clamped as u32);
        if wants_qpos {
            let row = &mut columns.qpos[frame * size..(frame + 1) * size];
            robot.write_qpos(root, pose[0], &fitted.angles, row);
        }
    }
    columns
}

/// The root and the pose (joint 0 in the world, others parent-relative) that the `qpos` of a keyframe says.
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
        return Err(whole.error("is given together with root or pose", "qpos, or root and pose"));
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

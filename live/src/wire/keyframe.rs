//! The checks of one keyframe.

use troupe_character::keyframe::{Checked, CheckedPose};
use troupe_character::limits::{HEADING_TOLERANCE, MAX_HEIGHT_M, UNIT_TOLERANCE};
use troupe_character::{FieldError, Path};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::from_wxyz;
use troupe_motion::{GlobalRoot, LocalRoot, Quat, Skeleton, Vec3};
use troupe_proto::v1;

use super::hinges::check_qpos;
use super::{HEIGHT_TOLERANCE_M, MAX_DISTANCE_M, MAX_VELOCITY};

/// A pose has a usable heading if the horizontal part of the character's left axis, a unit vector,
/// is longer than this. Below it, the axis is within six degrees of the vertical.
const MIN_GROUND_LEFT: f32 = 0.1;

/// The use of a keyframe, which decides the fields that it must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Root position and pose are required.
    Context,
    /// At least one of root, velocity and pose is required.
    Target,
}

/// Checks the values of one keyframe, except for its distance from the context, for which there is
/// [`check_reach`].
pub fn check(
    path: &Path<'_>,
    key: &v1::Keyframe,
    role: Role,
    skeleton: &Skeleton,
) -> Result<Checked, FieldError> {
    if !key.qpos.is_empty() {
        return check_robot(path, key, skeleton);
    }
    match role {
        Role::Context if key.root.is_none() => {
            return Err(path
                .field("root")
                .error("is missing", "root and pose in every context keyframe"));
        }
        Role::Context if key.pose.is_none() => {
            return Err(path
                .field("pose")
                .error("is missing", "root and pose in every context keyframe"));
        }
        _ if key.root.is_none() && key.velocity.is_none() && key.pose.is_none() => {
            return Err(path.error("is empty", "at least one of root, velocity and pose"));
        }
        _ => {}
    }
    let position = key
        .root
        .as_ref()
        .map(|root| check_position(path, root))
        .transpose()?;
    let height = check_heights(path, key, skeleton.ground_y_m)?;
    let pose_height = key
        .pose
        .as_ref()
        .map(|pose| check_pose_height(path, pose, position))
        .transpose()?;
    let rotations = key
        .pose
        .as_ref()
        .map(|pose| check_rotations(path, pose, skeleton))
        .transpose()?;
    let root = match (&key.root, position) {
        (Some(root), Some(position)) => {
            let heading = check_heading(path, root, rotations.as_deref(), skeleton)?;
            Some(GlobalRoot::new(position, heading))
        }
        _ => None,
    };
    let velocity = key
        .velocity
        .as_ref()
        .map(|velocity| check_velocity(path, velocity, height))
        .transpose()?;
    let pose = rotations
        .zip(pose_height)
        .map(|(rotations, height)| CheckedPose { rotations, height });
    Ok(Checked {
        root,
        height,
        velocity,
        pose,
    })
}

/// Checks a keyframe that gives root and pose as a robot's `qpos`.
fn check_robot(path: &Path<'_>, key: &v1::Keyframe, skeleton: &Skeleton) -> Result<Checked, FieldError> {
    let (root, rotations) = check_qpos(path, key, skeleton)?;
    let height = root.position.y;
    check_height(&path.element("qpos", 2), height, skeleton.ground_y_m)?;
    let velocity = path.field("velocity");
    let given = key.velocity.and_then(|velocity| velocity.height);
    if let Some(given) = given {
        check_same_height(&velocity.field("height"), given, height)?;
    }
    let velocity = (key.velocity.as_ref())
        .map(|velocity| check_velocity(path, velocity, Some(height)))
        .transpose()?;
    Ok(Checked {
        root: Some(root),
        height: Some(height),
        velocity,
        pose: Some(CheckedPose { rotations, height }),
    })
}

fn check_position(path: &Path<'_>, root: &v1::Root) -> Result<Vec3, FieldError> {
    let path = path.field("root");
    let path = path.field("position");
    let Some(v1::Vec3 { x, y, z }) = root.position else {
        return Err(path.error("is missing", "x, y and z in metres"));
    };
    for (name, value) in [("x", x), ("z", z)] {
        finite(&path.field(name), value)?;
    }
    Ok(Vec3::new(x, y, z))
}

/// The root joint's height from the first field that has it. Other fields must have the same.
fn check_heights(path: &Path<'_>, key: &v1::Keyframe, ground_y_m: f32) -> Result<Option<f32>, FieldError> {
    let (root, pose, velocity) = (path.field("root"), path.field("pose"), path.field("velocity"));
    let position = root.field("position");
    let fields = [
        (
            position.field("y"),
            key.root.and_then(|root| root.position).map(|position| position.y),
        ),
        (
            pose.field("root_height"),
            key.pose.as_ref().and_then(|pose| pose.root_height),
        ),
        (
            velocity.field("height"),
            key.velocity.and_then(|velocity| velocity.height),
        ),
    ];
    let mut height = None;
    for (path, value) in fields {
        let Some(value) = value else { continue };
        check_height(&path, value, ground_y_m)?;
        check_same_height(&path, value, *height.get_or_insert(value))?;
    }
    Ok(height)
}

/// Checks that a height of the root joint, metres, is near that of the ground.
pub fn check_height(path: &Path<'_>, value: f32, ground_y_m: f32) -> Result<(), FieldError> {
    if (finite(path, value)? - ground_y_m).abs() > MAX_HEIGHT_M {
        let [low, high] = [-MAX_HEIGHT_M, MAX_HEIGHT_M].map(|most| path.height(ground_y_m + most));
        return Err(path.error(
            format!("is {:?} m", path.height(value)),
            format!("{low} to {high}"),
        ));
    }
    Ok(())
}

/// Checks a second field with the root's height against the first.
fn check_same_height(path: &Path<'_>, value: f32, height: f32) -> Result<(), FieldError> {
    // NaN fails this comparison and is refused.
    if (value - height).abs() <= HEIGHT_TOLERANCE_M {
        return Ok(());
    }
    let (value, height) = (path.height(value), path.height(height));
    Err(path.error(
        format!("is {value} m, but the keyframe's root is at {height} m"),
        format!(
            "within {} m of {height}, or left out",
            path.metres(HEIGHT_TOLERANCE_M)
        ),
    ))
}

/// The heading of a pelvis. `None` if it lies on its side.
pub fn facing(pelvis: Quat, skeleton: &Skeleton) -> Option<f32> {
    let left = pelvis * skeleton.left_axis;
    (left.x.hypot(left.z) > MIN_GROUND_LEFT).then(|| heading_of(pelvis, skeleton.left_axis))
}

fn check_heading(
    path: &Path<'_>,
    root: &v1::Root,
    rotations: Option<&[Quat]>,
    skeleton: &Skeleton,
) -> Result<f32, FieldError> {
    let path = path.field("root");
    let path = path.field("heading");
    let pelvis = rotations.and_then(|rotations| rotations.first()).copied();
    let given = root.heading.map(|heading| finite(&path, heading)).transpose()?;
    match (given, pelvis) {
        (Some(heading), Some(pelvis)) => {
            let faces = facing(pelvis, skeleton);
            if let Some(faces) = faces
                && wrap_angle(heading - faces).abs() > HEADING_TOLERANCE
            {
                return Err(path.error(
                    format!("is {heading}, but the pose faces {faces}"),
                    format!("within {HEADING_TOLERANCE} rad of {faces}, or left out"),
                ));
            }
            Ok(heading)
        }
        (Some(heading), None) => Ok(heading),
        (None, Some(pelvis)) => Ok(heading_of(pelvis, skeleton.left_axis)),
        (None, None) => Err(path.error(
            "is missing, and there is no pose to take it from",
            "a heading in radians, or a pose in the same keyframe",
        )),
    }
}

fn check_pose_height(path: &Path<'_>, pose: &v1::Pose, position: Option<Vec3>) -> Result<f32, FieldError> {
    let path = path.field("pose");
    let path = path.field("root_height");
    let height = position.map(|position| position.y).or(pose.root_height);
    height.ok_or_else(|| {
        path.error(
            "is missing, and the keyframe has no root",
            "the root joint's height in metres, or a root",
        )
    })
}

fn check_rotations(path: &Path<'_>, pose: &v1::Pose, skeleton: &Skeleton) -> Result<Vec<Quat>, FieldError> {
    let path = path.field("pose");
    let joints = skeleton.joint_count();
    if pose.rotations.len() != joints * 4 {
        return Err(path.field("rotations").error(
            format!("has {} numbers", pose.rotations.len()),
            format!(
                "exactly {}: 4 (w, x, y, z) for each of the pack's {joints} joints",
                joints * 4
            ),
        ));
    }
    let mut rotations = Vec::with_capacity(joints);
    for (joint, wxyz) in pose.rotations.as_chunks::<4>().0.iter().enumerate() {
        for (axis, &value) in wxyz.iter().enumerate() {
            finite(&path.element("rotations", joint * 4 + axis), value)?;
        }
        let rotation = from_wxyz(*wxyz);
        let length = rotation.length();
        // This also refuses NaN and an overflow to infinity.
        if !(1.0 - UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE).contains(&length) {
            return Err(path.element("rotations", joint * 4).error(
                format!(
                    "the rotation of joint {} has length {length}",
                    skeleton.joints[joint].name
                ),
                format!(
                    "unit length, {} to {}",
                    1.0 - UNIT_TOLERANCE,
                    1.0 + UNIT_TOLERANCE
                ),
            ));
        }
        rotations.push(rotation / length);
    }
    Ok(rotations)
}

fn check_velocity(
    path: &Path<'_>,
    velocity: &v1::RootVelocity,
    height: Option<f32>,
) -> Result<LocalRoot, FieldError> {
    let path = path.field("velocity");
    for (name, value) in [
        ("x", velocity.x),
        ("z", velocity.z),
        ("angular", velocity.angular),
    ] {
        let path = path.field(name);
        if finite(&path, value)?.abs() > MAX_VELOCITY {
            let said = |value: f32| match name {
                "angular" => value,
                _ => path.metres(value),
            };
            let most = said(MAX_VELOCITY);
            return Err(path.error(format!("is {}", said(value)), format!("-{most} to {most}")));
        }
    }
    let height = height.ok_or_else(|| {
        path.field("height").error(
            "is missing, and the keyframe has neither a root nor a pose with root_height",
            "the root joint's height in metres, or a root",
        )
    })?;
    Ok(LocalRoot {
        vx: velocity.x,
        vz: velocity.z,
        omega: velocity.angular,
        height,
    })
}

/// Checks that a number is finite.
pub fn finite(path: &Path<'_>, value: f32) -> Result<f32, FieldError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(path.error(format!("is {value}"), "a finite number"))
    }
}

/// Checks the distance of a keyframe's root from `anchor`, the last context frame's root position.
pub fn check_reach(path: &Path<'_>, key: &Checked, anchor: Vec3) -> Result<(), FieldError> {
    if let Some(root) = key.root {
        let distance = root.position.distance(anchor);
        // This also refuses NaN and an overflow to infinity.
        if !(0.0..=MAX_DISTANCE_M).contains(&distance) {
            let path = path.field("root");
            return Err(path.field("position").error(
                format!("is {} m from the last context frame", path.metres(distance)),
                format!(
                    "at most {} m from the last context frame",
                    path.metres(MAX_DISTANCE_M)
                ),
            ));
        }
    }
    Ok(())
}

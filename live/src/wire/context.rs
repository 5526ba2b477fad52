//! Context keyframes: the past frames from which a live character starts.

use troupe_character::{FieldError, Path};
use troupe_motion::conventions::Convention;
use troupe_motion::rotation::{from_wxyz, to_wxyz};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Skeleton, Vec3};
use troupe_proto::v1;

use super::keyframe::{self, Role};

/// A frame in world coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct ContextFrame {
    /// Position of the root joint, metres.
    pub root: Vec3,
    /// One unit quaternion per joint: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
}

/// Checks the `wanted` keyframes in the field `name` of `path`, and returns their frames.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn check_context(
    path: &Path<'_>,
    name: &'static str,
    keys: &[v1::Keyframe],
    wanted: usize,
    skeleton: &Skeleton,
) -> Result<Vec<ContextFrame>, FieldError> {
    if keys.len() != wanted {
        let message = format!("has {} keyframes", keys.len());
        return Err(path
            .field(name)
            .error(message, format!("exactly {wanted}, or none")));
    }
    let each = keys.iter().enumerate();
    each.map(|(index, key)| check_frame(&path.element(name, index), key, skeleton))
        .collect()
}

/// Checks a keyframe with root and pose, and returns its frame.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn check_frame(
    path: &Path<'_>,
    key: &v1::Keyframe,
    skeleton: &Skeleton,
) -> Result<ContextFrame, FieldError> {
    if key.velocity.is_some() {
        return Err(path.field("velocity").error("is given", "root and pose only"));
    }
    let checked = keyframe::check(path, key, Role::Context, skeleton)?;
    // A character's first position has no earlier frame, so the distance is from the origin.
    keyframe::check_reach(path, &checked, Vec3::ZERO)?;
    let world = SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0));
    let given = checked.given(&world);
    match (given.root, given.rotations) {
        (Some(root), Some(rotations)) => Ok(ContextFrame {
            root: root.position,
            rotations,
        }),
        _ => Err(path.error("is incomplete", "root and pose")),
    }
}

/// Converts a keyframe to the native convention. It does not check the values.
pub fn to_native(key: &v1::Keyframe, convention: Convention) -> v1::Keyframe {
    if convention == Convention::Native {
        return key.clone();
    }
    let mut native = key.clone();
    if let Some(root) = &mut native.root {
        root.heading = root.heading.map(|heading| convention.heading_to_native(heading));
        root.position = root.position.map(|p| {
            let Vec3 { x, y, z } = convention.position_to_native(Vec3::new(p.x, p.y, p.z));
            v1::Vec3 { x, y, z }
        });
    }
    if let Some(pose) = &mut native.pose {
        pose.root_height = pose
            .root_height
            .map(|height| height / convention.units_per_metre());
        for rotation in pose.rotations.as_chunks_mut::<4>().0 {
            *rotation = to_wxyz(convention.rotation_to_native(from_wxyz(*rotation)));
        }
    }
    native
}

//! Turns a generator's numbers into frames.

use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::model::{Dims, GLOBAL_ROOT, Motion};
use troupe_motion::rotation::{align_sign, from_six_ds};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Skeleton};

/// The model gave numbers that are not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the model gave frames that are not finite")]
pub struct NonFinite;

/// Checks that all numbers of the networks are finite.
///
/// # Errors
/// [`NonFinite`] if not.
pub fn check_finite(motion: &Motion) -> Result<(), NonFinite> {
    match motion.is_finite() {
        true => Ok(()),
        false => Err(NonFinite),
    }
}

/// Roots from `[frames, 5]` numbers.
pub fn roots(values: &[f32]) -> impl Iterator<Item = GlobalRoot> {
    values
        .chunks_exact(GLOBAL_ROOT)
        .map(|r| GlobalRoot::from_array([r[0], r[1], r[2], r[3], r[4]]))
}

/// Turns 6D world rotations into quaternions: joint 0 in the world of the segment, the others
/// relative to their parents.
pub fn parent_relative(motion: &Motion, frames: usize, dims: &Dims, skeleton: &Skeleton) -> Vec<Quat> {
    let joints = dims.joints;
    let mut world = vec![Quat::IDENTITY; frames * joints];
    from_six_ds(&motion.rotations, &mut world);
    let mut rotations = vec![Quat::IDENTITY; frames * joints];
    for (world, local) in world.chunks_exact(joints).zip(rotations.chunks_exact_mut(joints)) {
        local_from_world_rotations(skeleton, world, local);
    }
    rotations
}

/// Turns joint 0 of every frame into the world. Keeps each joint's quaternion in the hemisphere of
/// the frame before, so that clients can interpolate between frames.
pub fn to_world_rotations(frame: &SegmentFrame, joints: usize, rotations: &mut [Quat]) {
    for pose in rotations.chunks_exact_mut(joints) {
        pose[0] = frame.to_world_rotation(pose[0]).normalize();
    }
    for index in joints..rotations.len() {
        rotations[index] = align_sign(rotations[index], rotations[index - joints]);
    }
}

//! Pose features and velocities: the per-joint state that the model reads (MotionBricks, section
//! 4).

use glam::{Quat, Vec3};

use crate::fk::{WorldMotion, world_transforms};
use crate::rotation::{from_six_d, six_d};
use crate::skeleton::Skeleton;

/// Numbers a joint in a pose feature: position relative to the projected root (3), world rotation
/// in 6D form (6).
pub const FEATURES_PER_JOINT: usize = 9;

/// Writes the pose feature of one pose into `out` (`joints * 9`).
///
/// `root` is the world position of the pelvis, and `local` the pose (joint 0 in the world, others
/// parent-relative). Positions are in metres and world axes, relative to the projected root
/// `(root.x, 0, root.z)`. Allocates scratch memory. With world transforms at hand,
/// [`pose_features_from_world`] allocates nothing.
///
/// # Panics
/// If `local` is shorter than the skeleton or `out` than `joints * 9`.
pub fn pose_features(skeleton: &Skeleton, root: Vec3, local: &[Quat], out: &mut [f32]) {
    let n = skeleton.joint_count();
    let mut positions = vec![Vec3::ZERO; n];
    let mut rotations = vec![Quat::IDENTITY; n];
    world_transforms(skeleton, root, local, &mut positions, &mut rotations);
    pose_features_from_world(root, &positions, &rotations, out);
}

/// Writes the pose feature of one frame's world transforms into `out` (`joints * 9`). Does not
/// allocate.
///
/// # Panics
/// If `out` is shorter than `positions.len() * 9`.
pub fn pose_features_from_world(root: Vec3, positions: &[Vec3], rotations: &[Quat], out: &mut [f32]) {
    let origin = Vec3::new(root.x, 0.0, root.z);
    let out = &mut out[..positions.len() * FEATURES_PER_JOINT];
    for ((out, &p), &q) in out
        .chunks_exact_mut(FEATURES_PER_JOINT)
        .zip(positions)
        .zip(rotations)
    {
        (p - origin).write_to_slice(out);
        out[3..].copy_from_slice(&six_d(q));
    }
}

/// Writes the world rotations of one pose feature (`joints * 9`), one a joint, into `out`. Does not
/// allocate.
pub fn world_rotations_from_features(features: &[f32], out: &mut [Quat]) {
    for (f, out) in features.chunks_exact(FEATURES_PER_JOINT).zip(out) {
        *out = from_six_d([f[3], f[4], f[5], f[6], f[7], f[8]]);
    }
}

/// World velocities in m/s by backward difference, `frames * joints`. Frame 0 copies frame 1, or is
/// zero if there is only one.
pub fn velocities(motion: &WorldMotion, fps: f32) -> Vec<Vec3> {
    let joints = motion.joints;
    let mut out = vec![Vec3::ZERO; motion.positions.len()];
    if motion.frames() < 2 {
        return out;
    }
    let (first, rest) = out.split_at_mut(joints);
    for ((out, now), before) in rest
        .iter_mut()
        .zip(&motion.positions[joints..])
        .zip(&motion.positions)
    {
        *out = (*now - *before) * fps;
    }
    first.copy_from_slice(&rest[..joints]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::angle_between;
    use crate::testing::{arm, stand, walk};

    #[test]
    fn features_of_an_arm_by_hand() {
        let mut clip = arm();
        clip.root_positions[0] = Vec3::new(5.0, 1.0, -2.0);
        let mut out = [0.0; 27];
        pose_features(
            &clip.skeleton,
            clip.root_positions[0],
            clip.rotations_at(0),
            &mut out,
        );
        // Position over the projected root, then the columns of Rz(90°): Y and -X.
        let want = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
        for (a, b) in out.iter().zip(want) {
            assert!((a - b).abs() < 1e-6, "{out:?}");
        }
        assert!(Vec3::from_slice(&out[18..]).abs_diff_eq(Vec3::new(0.0, 2.0, 2.0), 1e-6));
    }

    #[test]
    fn features_do_not_depend_on_the_place() {
        let clip = walk(3);
        let n = clip.skeleton.joint_count() * FEATURES_PER_JOINT;
        let (mut here, mut there) = (vec![0.0; n], vec![0.0; n]);
        let root = clip.root_positions[2];
        pose_features(&clip.skeleton, root, clip.rotations_at(2), &mut here);
        pose_features(
            &clip.skeleton,
            root + Vec3::new(3.0, 0.0, -4.0),
            clip.rotations_at(2),
            &mut there,
        );
        assert!(here.iter().zip(&there).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn rotations_come_back() {
        let clip = walk(9);
        let world = WorldMotion::from_clip(&clip);
        let mut features = vec![0.0; 8 * FEATURES_PER_JOINT];
        pose_features_from_world(
            clip.root_positions[8],
            world.positions_at(8),
            world.rotations_at(8),
            &mut features,
        );
        let mut back = [Quat::IDENTITY; 8];
        world_rotations_from_features(&features, &mut back);
        assert!(
            back.iter()
                .zip(world.rotations_at(8))
                .all(|(a, b)| angle_between(*a, *b) < 1e-5)
        );
    }

    #[test]
    fn velocities_are_backward_differences() {
        let mut clip = stand(3);
        clip.root_positions[1].x = 0.1;
        clip.root_positions[2].y += 0.2;
        let v = velocities(&WorldMotion::from_clip(&clip), 30.0);
        assert!(v[8].abs_diff_eq(Vec3::new(3.0, 0.0, 0.0), 1e-4));
        assert!(
            v[16 + 5].abs_diff_eq(Vec3::new(-3.0, 6.0, 0.0), 1e-4),
            "every joint moves along"
        );
        assert_eq!(v[..8], v[8..16], "frame 0 copies frame 1");
        assert!(
            velocities(&WorldMotion::from_clip(&stand(1)), 30.0)
                .iter()
                .all(|v| *v == Vec3::ZERO)
        );
    }
}

//! Gaits that the networks do not know, or know less well: a plan follows their own poses.

use troupe_motion::fk::world_transforms;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::rotation::{slerp, yaw};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::recipe::{FOLLOW_FRAMES, FOLLOWS_M};

/// The poses that a plan is pulled towards, and how far. Positions come from the guide.
#[derive(Debug, Clone, PartialEq)]
pub struct Follow {
    /// `frames * joints` from the segment's first frame on: joint 0 in the world, others relative
    /// to their parents.
    pub rotations: Vec<Quat>,
    /// One a frame: 0 leaves it to the networks, 1 takes the pose.
    pub weights: Vec<f32>,
}

/// Weights of `frames` frames, whose last context frame is `now`, for a gait that is followed by
/// `share`, 0 to 1. A character in step with the gait follows it at once. Otherwise the networks
/// bring it into step first.
pub(super) fn weights(share: f32, off_m: f32, now: usize, frames: usize) -> Vec<f32> {
    let at_once = 1.0 - smoothstep((off_m / FOLLOWS_M - 1.0).clamp(0.0, 1.0));
    let weight = |frame: usize| {
        let passed = frame.saturating_sub(now) as f32 / FOLLOW_FRAMES;
        share * (at_once + (1.0 - at_once) * smoothstep(passed.min(1.0)))
    };
    (0..frames).map(weight).collect()
}

/// Distance between two poses: root mean square over the joints, metres. Each pose has its root at
/// a height and a heading; headings do not count.
pub(super) fn apart_m(skeleton: &Skeleton, one: (f32, f32, &[Quat]), other: (f32, f32, &[Quat])) -> f32 {
    let joints = skeleton.joint_count();
    let mut rotations = vec![Quat::IDENTITY; joints];
    let mut places = |(height_m, heading, pose): (f32, f32, &[Quat])| {
        let mut positions = vec![Vec3::ZERO; joints];
        world_transforms(skeleton, Vec3::Y * height_m, pose, &mut positions, &mut rotations);
        let turn = yaw(-heading);
        positions.iter_mut().for_each(|place| *place = turn * *place);
        positions
    };
    let (one, other) = (places(one), places(other));
    let sum: f32 = one.iter().zip(&other).map(|(a, b)| a.distance_squared(*b)).sum();
    (sum / joints.max(1) as f32).sqrt()
}

impl Follow {
    /// Pulls frames after the context towards the poses, and towards `path`. All have the same
    /// number of frames; the poses carry on from the context.
    pub(crate) fn draw(&self, path: &[Vec3], roots: &mut [Vec3], rotations: &mut [Quat]) {
        let joints = rotations.len() / roots.len().max(1);
        let frames = roots.iter_mut().zip(path).zip(&self.weights);
        for ((root, place), &weight) in frames {
            *root = root.lerp(*place, weight);
        }
        let poses = rotations
            .chunks_exact_mut(joints)
            .zip(self.rotations.chunks_exact(joints));
        for ((pose, own), &weight) in poses.zip(&self.weights) {
            for (rotation, &own) in pose.iter_mut().zip(own) {
                *rotation = slerp(*rotation, own, weight);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::walker;

    #[test]
    fn a_character_in_its_step_follows_at_once_and_any_other_in_time() {
        let here = weights(1.0, 0.5 * FOLLOWS_M, 3, 20);
        assert!(here.iter().all(|&weight| weight == 1.0), "{here:?}");
        let far = weights(0.5, 3.0 * FOLLOWS_M, 3, 20);
        assert_eq!((far[3], far[19]), (0.0, 0.5));
        assert!(far.is_sorted());
    }

    #[test]
    fn the_distance_of_poses_does_not_depend_on_headings() {
        let skeleton = walker();
        let pose = vec![Quat::IDENTITY; skeleton.joint_count()];
        let mut turned = pose.clone();
        turned[0] = yaw(1.0);
        let apart = |other: (f32, f32, &[Quat])| apart_m(&skeleton, (0.9, 0.0, &pose), other);
        assert!(apart((0.9, 1.0, &turned)) < 1e-5);
        assert!((apart((1.0, 0.0, &pose)) - 0.1).abs() < 1e-5);
    }

    #[test]
    fn frames_are_pulled_by_their_weights() {
        let follow = Follow {
            rotations: vec![Quat::from_rotation_x(1.0); 3],
            weights: vec![0.0, 0.5, 1.0],
        };
        let (mut roots, mut rotations) = (vec![Vec3::ZERO; 3], vec![Quat::IDENTITY; 3]);
        follow.draw(&[Vec3::X; 3], &mut roots, &mut rotations);
        assert_eq!(roots, [Vec3::ZERO, Vec3::X * 0.5, Vec3::X]);
        for (rotation, angle) in rotations.iter().zip([0.0, 0.5, 1.0]) {
            assert!(
                rotation.abs_diff_eq(Quat::from_rotation_x(angle), 1e-5),
                "{rotation}"
            );
        }
    }
}

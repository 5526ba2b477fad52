//! The segment frame, in which models work, and the pinning of a generated root to given targets.

use glam::{Quat, Vec3};

use crate::features::FEATURES_PER_JOINT;
use crate::interpolate::smoothstep;
use crate::root::{GlobalRoot, LocalRoot, wrap_angle};
use crate::rotation::yaw;

/// A frame of reference on the ground. The projected root of the last context frame is its origin,
/// and that root's heading is 0 in it. Heights do not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentFrame {
    /// World position of the origin, y = 0.
    pub origin: Vec3,
    /// World heading of the frame's +Z, radians.
    pub heading: f32,
}

impl SegmentFrame {
    /// The frame of reference with `root` at its ground origin, with heading 0.
    pub fn from_root(root: GlobalRoot) -> Self {
        Self {
            origin: root.projected(),
            heading: root.heading,
        }
    }

    /// World position to segment position.
    pub fn to_segment_position(&self, p: Vec3) -> Vec3 {
        yaw(-self.heading) * (p - self.origin)
    }

    /// Segment position to world position.
    pub fn to_world_position(&self, p: Vec3) -> Vec3 {
        yaw(self.heading) * p + self.origin
    }

    /// World direction or velocity to the segment frame.
    pub fn to_segment_vector(&self, v: Vec3) -> Vec3 {
        yaw(-self.heading) * v
    }

    /// Segment direction or velocity to the world.
    pub fn to_world_vector(&self, v: Vec3) -> Vec3 {
        yaw(self.heading) * v
    }

    /// World rotation to segment rotation. In a pose only joint 0 needs it: the others are
    /// parent-relative.
    pub fn to_segment_rotation(&self, q: Quat) -> Quat {
        yaw(-self.heading) * q
    }

    /// Segment rotation to world rotation.
    pub fn to_world_rotation(&self, q: Quat) -> Quat {
        yaw(self.heading) * q
    }

    /// World root to segment root; the result's heading is in (-π, π].
    pub fn to_segment_root(&self, r: GlobalRoot) -> GlobalRoot {
        GlobalRoot::new(
            self.to_segment_position(r.position),
            wrap_angle(r.heading - self.heading),
        )
    }

    /// Segment root to world root; the result's heading is in (-π, π].
    pub fn to_world_root(&self, r: GlobalRoot) -> GlobalRoot {
        GlobalRoot::new(
            self.to_world_position(r.position),
            wrap_angle(r.heading + self.heading),
        )
    }

    /// World local root to segment local root: the velocity turns; angular velocity and height are
    /// unchanged.
    pub fn to_segment_local_root(&self, l: LocalRoot) -> LocalRoot {
        turn_local_root(l, -self.heading)
    }

    /// Segment local root to world local root.
    pub fn to_world_local_root(&self, l: LocalRoot) -> LocalRoot {
        turn_local_root(l, self.heading)
    }

    /// Turns pose features (`[.., joints * 9]`, any number of frames) from the world to the segment
    /// frame, in place. Their positions are relative to their own projected root, so turning is
    /// enough.
    pub fn rotate_pose_features_to_segment(&self, features: &mut [f32]) {
        rotate_pose_features(features, -self.heading);
    }

    /// Turns pose features from the segment frame to the world, in place.
    pub fn rotate_pose_features_to_world(&self, features: &mut [f32]) {
        rotate_pose_features(features, self.heading);
    }
}

fn turn_local_root(l: LocalRoot, angle: f32) -> LocalRoot {
    let v = yaw(angle) * Vec3::new(l.vx, 0.0, l.vz);
    LocalRoot {
        vx: v.x,
        vz: v.z,
        ..l
    }
}

/// Turns every position and both rotation columns by `angle` about +Y. Does not allocate.
fn rotate_pose_features(features: &mut [f32], angle: f32) {
    let (sin, cos) = angle.sin_cos();
    // Position, column 0 and column 1 are three vectors, so a feature is a run of vectors.
    debug_assert_eq!(features.len() % FEATURES_PER_JOINT, 0);
    for v in features.chunks_exact_mut(3) {
        (v[0], v[2]) = (cos * v[0] + sin * v[2], cos * v[2] - sin * v[0]);
    }
}

/// A root that a frame must have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RootPin {
    /// Index of the frame.
    pub frame: usize,
    /// The required root.
    pub root: GlobalRoot,
}

/// Moves a generated root to given target roots (root interpolation, MotionBricks fig. 14).
///
/// The residual between given and generated root (position and heading) at each target is spread
/// with a smoothstep ramp over the frames since the target before. For the first target these begin
/// at the last context frame, with residual 0. Frames after the last target keep its residual.
/// Poses turn about their root with the heading: `rotations` has `roots.len() * joints` rotations,
/// of which each frame's joint 0 is in the world and changes. Afterwards the targets' roots are met
/// up to rounding.
///
/// Targets may be in any order. Those at or before `last_context_frame`, or beyond the end, are
/// ignored. Everything is in one frame of reference, world or segment.
pub fn pin_targets(
    roots: &mut [GlobalRoot],
    rotations: &mut [Quat],
    joints: usize,
    last_context_frame: usize,
    targets: &[RootPin],
) {
    let mut residuals: Vec<Residual> = targets
        .iter()
        .filter(|t| t.frame > last_context_frame && t.frame < roots.len())
        .map(|t| Residual::between(t.frame, roots[t.frame], t.root))
        .collect();
    residuals.sort_by_key(|r| r.frame);
    residuals.dedup_by_key(|r| r.frame);
    let mut before = Residual {
        frame: last_context_frame,
        position: Vec3::ZERO,
        heading: 0.0,
    };
    for &next in &residuals {
        // The short way round from one residual to the next.
        let next = Residual {
            heading: before.heading + wrap_angle(next.heading - before.heading),
            ..next
        };
        for frame in before.frame + 1..=next.frame {
            before.blend(&next, frame).apply(frame, roots, rotations, joints);
        }
        before = next;
    }
    for frame in before.frame + 1..roots.len() {
        before.apply(frame, roots, rotations, joints);
    }
}

/// What must be added to a frame's root.
#[derive(Clone, Copy)]
struct Residual {
    frame: usize,
    position: Vec3,
    heading: f32,
}

impl Residual {
    fn between(frame: usize, generated: GlobalRoot, given: GlobalRoot) -> Self {
        Self {
            frame,
            position: given.position - generated.position,
            heading: wrap_angle(given.heading - generated.heading),
        }
    }

    fn blend(&self, next: &Self, frame: usize) -> Self {
        let t = (frame - self.frame) as f32 / (next.frame - self.frame) as f32;
        let s = smoothstep(t);
        Self {
            frame,
            position: self.position.lerp(next.position, s),
            heading: self.heading + (next.heading - self.heading) * s,
        }
    }

    fn apply(&self, frame: usize, roots: &mut [GlobalRoot], rotations: &mut [Quat], joints: usize) {
        let root = &mut roots[frame];
        root.position += self.position;
        root.heading = wrap_angle(root.heading + self.heading);
        if let Some(pelvis) = rotations.get_mut(frame * joints) {
            *pelvis = (yaw(self.heading) * *pelvis).normalize();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::pose_features;
    use crate::root::{global_from_local, heading_of, local_from_global};
    use crate::rotation::angle_between;
    use crate::rotation::tests::any_quat;
    use crate::testing::walk;
    use proptest::prelude::*;
    use std::f32::consts::{FRAC_PI_2, PI};

    #[test]
    fn the_frames_own_root_is_its_origin() {
        let root = GlobalRoot::new(Vec3::new(2.0, 0.9, -1.0), FRAC_PI_2);
        let frame = SegmentFrame::from_root(root);
        let own = frame.to_segment_root(root);
        assert!(own.position.abs_diff_eq(Vec3::new(0.0, 0.9, 0.0), 1e-6) && own.heading.abs() < 1e-6);
        // One metre ahead of a root that faces +X is one metre along the segment's +Z.
        let ahead = frame.to_segment_position(Vec3::new(3.0, 0.5, -1.0));
        assert!(ahead.abs_diff_eq(Vec3::new(0.0, 0.5, 1.0), 1e-6));
    }

    #[test]
    fn features_and_roots_turn_with_the_clip() {
        // Turning the features equals turning the clip and computing features.
        let clip = walk(12);
        let frame = SegmentFrame::from_root(clip.root_at(3));
        let n = 8 * FEATURES_PER_JOINT;
        let (mut turned, mut want) = (vec![0.0; n], vec![0.0; n]);
        let mut pose = clip.rotations_at(9).to_vec();
        pose_features(&clip.skeleton, clip.root_positions[9], &pose, &mut turned);
        frame.rotate_pose_features_to_segment(&mut turned);
        pose[0] = frame.to_segment_rotation(pose[0]);
        pose_features(
            &clip.skeleton,
            frame.to_segment_position(clip.root_positions[9]),
            &pose,
            &mut want,
        );
        assert!(turned.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-5));
        // Local roots turn like their global roots.
        let roots = clip.roots();
        let moved: Vec<_> = roots.iter().map(|&r| frame.to_segment_root(r)).collect();
        for (a, b) in local_from_global(&roots, 30.0)
            .iter()
            .zip(local_from_global(&moved, 30.0))
        {
            let (a, b) = (frame.to_segment_local_root(*a).to_array(), b.to_array());
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3));
        }
        // Integrating in the segment and converting back gives the world's.
        let back = global_from_local(moved[0], &local_from_global(&moved, 30.0), 30.0);
        let last = frame.to_world_root(back[11]);
        assert!(last.position.abs_diff_eq(roots[11].position, 1e-4));
    }

    fn frames() -> impl Strategy<Value = SegmentFrame> {
        ([-50.0f32..50.0, 0.0f32..2.0, -50.0f32..50.0], -7.0f32..7.0)
            .prop_map(|(p, heading)| SegmentFrame::from_root(GlobalRoot::new(Vec3::from(p), heading)))
    }

    proptest! {
        #[test]
        fn all_pairs_are_inverse(
            frame in frames(), p in [-50.0f32..50.0, -2.0f32..2.0, -50.0f32..50.0], q in any_quat(),
            heading in -3.1f32..3.1, features in proptest::collection::vec(-2.0f32..2.0, 18),
        ) {
            let p = Vec3::from(p);
            prop_assert!(frame.to_world_position(frame.to_segment_position(p)).abs_diff_eq(p, 1e-4));
            prop_assert!(frame.to_segment_position(frame.to_world_position(p)).abs_diff_eq(p, 1e-4));
            prop_assert!(frame.to_world_vector(frame.to_segment_vector(p)).abs_diff_eq(p, 1e-4));
            prop_assert!(angle_between(frame.to_world_rotation(frame.to_segment_rotation(q)), q) < 1e-5);
            let root = GlobalRoot::new(p, heading);
            let back = frame.to_world_root(frame.to_segment_root(root));
            prop_assert!(back.position.abs_diff_eq(p, 1e-4));
            prop_assert!(wrap_angle(back.heading - heading).abs() < 1e-5);
            let local = LocalRoot { vx: p.x, vz: p.z, omega: heading, height: p.y };
            let back = frame.to_world_local_root(frame.to_segment_local_root(local)).to_array();
            prop_assert!(back.iter().zip(local.to_array()).all(|(a, b)| (a - b).abs() < 1e-4));
            let mut turned = features.clone();
            frame.rotate_pose_features_to_segment(&mut turned);
            frame.rotate_pose_features_to_world(&mut turned);
            prop_assert!(turned.iter().zip(&features).all(|(a, b)| (a - b).abs() < 1e-5));
        }

        #[test]
        fn headings_of_poses_follow_the_frame(frame in frames(), psi in -3.0f32..3.0) {
            let turned = heading_of(frame.to_segment_rotation(yaw(psi)), Vec3::X);
            let want = frame.to_segment_root(GlobalRoot::new(Vec3::ZERO, psi)).heading;
            prop_assert!(wrap_angle(turned - want).abs() < 1e-4);
        }

        #[test]
        fn pinned_targets_are_met(
            seeds in proptest::collection::vec(([-2.0f32..2.0, 0.5f32..1.5, -2.0f32..2.0], -3.1f32..3.1), 24),
            given in proptest::collection::vec((0usize..30, [-2.0f32..2.0, 0.5f32..1.5, -2.0f32..2.0], -3.1f32..3.1), 1..5),
        ) {
            let mut roots: Vec<_> = seeds.iter().map(|&(p, h)| GlobalRoot::new(Vec3::from(p), h)).collect();
            let generated = roots.clone();
            let mut rotations: Vec<Quat> = roots.iter().flat_map(|r| [yaw(r.heading), yaw(1.0)]).collect();
            let targets: Vec<_> = given.iter().map(|&(frame, p, h)| RootPin { frame, root: GlobalRoot::new(Vec3::from(p), h) }).collect();
            pin_targets(&mut roots, &mut rotations, 2, 3, &targets);
            prop_assert_eq!(&roots[..4], &generated[..4], "the context is unchanged");
            for (nth, t) in targets.iter().enumerate() {
                let first = targets[..nth].iter().all(|o| o.frame != t.frame);
                if t.frame > 3 && t.frame < 24 && first {
                    prop_assert!(roots[t.frame].position.abs_diff_eq(t.root.position, 1e-5));
                    prop_assert!(wrap_angle(roots[t.frame].heading - t.root.heading).abs() < 1e-5);
                }
            }
            for (f, r) in roots.iter().enumerate() {
                prop_assert!(wrap_angle(heading_of(rotations[2 * f], Vec3::X) - r.heading).abs() < 1e-4, "poses turn along");
                prop_assert_eq!(rotations[2 * f + 1], yaw(1.0), "parent-relative rotations are unchanged");
            }
        }
    }

    #[test]
    fn the_residual_is_spread_with_smoothstep() {
        // Frames 4..=7 lie between context (3) and target (8), which is off by one metre to the
        // right and half a turn.
        let mut roots = vec![GlobalRoot::new(Vec3::ZERO, 0.0); 10];
        let mut rotations = vec![Quat::IDENTITY; 10];
        let target = RootPin {
            frame: 8,
            root: GlobalRoot::new(Vec3::new(1.0, 0.5, 0.0), PI / 2.0),
        };
        pin_targets(&mut roots, &mut rotations, 1, 3, &[target]);
        let share = |f: usize| roots[f].position.x;
        assert_eq!(share(3), 0.0);
        assert!((share(5) - 0.352).abs() < 1e-6, "3·0.4² - 2·0.4³");
        assert!(
            (share(5) + share(6) - 1.0).abs() < 1e-6,
            "symmetric about the middle"
        );
        assert!((roots[5].heading - 0.352 * FRAC_PI_2).abs() < 1e-5);
        assert!((roots[6].position.y - 0.5 * 0.648).abs() < 1e-6);
        assert_eq!(
            (share(8), share(9)),
            (1.0, 1.0),
            "frames after the target keep its residual"
        );
    }
}

//! Forward kinematics, its inverse, and the world-space form of a whole clip.

use glam::{Quat, Vec3};

use crate::clip::Clip;
use crate::skeleton::Skeleton;

/// World positions (metres) and rotations of every joint.
///
/// `root` is the world position of joint 0 and `local` the pose (joint 0 in the world, others
/// parent-relative). Does not allocate. Rotations are not renormalised: unit quaternions in give
/// unit quaternions out to rounding.
///
/// # Panics
/// If `local`, `out_pos` or `out_rot` is shorter than the skeleton.
pub fn world_transforms(
    skeleton: &Skeleton,
    root: Vec3,
    local: &[Quat],
    out_pos: &mut [Vec3],
    out_rot: &mut [Quat],
) {
    let n = skeleton.joint_count();
    let (local, out_pos, out_rot) = (&local[..n], &mut out_pos[..n], &mut out_rot[..n]);
    for (j, joint) in skeleton.joints.iter().enumerate() {
        match joint.parent {
            None => {
                out_pos[j] = root;
                out_rot[j] = local[j];
            }
            Some(p) => {
                out_pos[j] = out_pos[p] + out_rot[p] * joint.offset_m;
                out_rot[j] = out_rot[p] * local[j];
            }
        }
    }
}

/// World position (metres) and rotation of one joint. Takes time that grows with the joint's depth,
/// and does not allocate.
///
/// The result equals that of [`world_transforms`] bit for bit.
///
/// # Panics
/// If the skeleton has no such joint or `local` is shorter than the skeleton.
pub fn joint_transform(skeleton: &Skeleton, root: Vec3, local: &[Quat], joint: usize) -> (Vec3, Quat) {
    transforms_down_to(skeleton, root, local, joint, &mut |_, _, _| {})
}

/// World positions (metres) and rotations of the joints from joint 0 down to `joint`, each passed
/// to `visit`. Takes time that grows with the joint's depth, and does not allocate.
///
/// The results equal those of [`world_transforms`] bit for bit.
///
/// # Panics
/// If the skeleton has no such joint or `local` is shorter than the skeleton.
pub fn transforms_down_to(
    skeleton: &Skeleton,
    root: Vec3,
    local: &[Quat],
    joint: usize,
    visit: &mut impl FnMut(usize, Vec3, Quat),
) -> (Vec3, Quat) {
    let (position, rotation) = match skeleton.joints[joint].parent {
        None => (root, local[joint]),
        Some(parent) => {
            let (above, turned) = transforms_down_to(skeleton, root, local, parent, visit);
            (
                above + turned * skeleton.joints[joint].offset_m,
                turned * local[joint],
            )
        }
    };
    visit(joint, position, rotation);
    (position, rotation)
}

/// Pose (joint 0 in the world, others parent-relative) from world rotations. Does not allocate.
///
/// # Panics
/// If `world` or `out` is shorter than the skeleton.
pub fn local_from_world_rotations(skeleton: &Skeleton, world: &[Quat], out: &mut [Quat]) {
    let n = skeleton.joint_count();
    let (world, out) = (&world[..n], &mut out[..n]);
    for (j, joint) in skeleton.joints.iter().enumerate() {
        out[j] = match joint.parent {
            None => world[j],
            Some(p) => (world[p].inverse() * world[j]).normalize(),
        };
    }
}

/// World positions and rotations of consecutive frames: the input of features, contacts and
/// metrics.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldMotion {
    /// Joints a frame.
    pub joints: usize,
    /// `frames * joints` world positions, metres.
    pub positions: Vec<Vec3>,
    /// `frames * joints` world rotations.
    pub rotations: Vec<Quat>,
}

impl WorldMotion {
    /// Forward kinematics of every frame of `clip`.
    pub fn from_clip(clip: &Clip) -> Self {
        let joints = clip.skeleton.joint_count();
        let total = clip.frames() * joints;
        let mut positions = vec![Vec3::ZERO; total];
        let mut rotations = vec![Quat::IDENTITY; total];
        for (f, &root) in clip.root_positions.iter().enumerate() {
            let at = f * joints..(f + 1) * joints;
            world_transforms(
                &clip.skeleton,
                root,
                clip.rotations_at(f),
                &mut positions[at.clone()],
                &mut rotations[at],
            );
        }
        Self {
            joints,
            positions,
            rotations,
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.positions.len().checked_div(self.joints).unwrap_or(0)
    }

    /// World positions of one frame's joints.
    ///
    /// # Panics
    /// If `frame` is out of range.
    pub fn positions_at(&self, frame: usize) -> &[Vec3] {
        &self.positions[frame * self.joints..(frame + 1) * self.joints]
    }

    /// World rotations of one frame's joints.
    ///
    /// # Panics
    /// If `frame` is out of range.
    pub fn rotations_at(&self, frame: usize) -> &[Quat] {
        &self.rotations[frame * self.joints..(frame + 1) * self.joints]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::angle_between;
    use crate::rotation::tests::any_quat;
    use crate::testing::{arm, biped, walk};
    use proptest::prelude::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn an_arm_by_hand() {
        let world = WorldMotion::from_clip(&arm());
        let p = world.positions_at(0);
        // a at (0,1,0), turned 90° about Z: b is one along its X, the world's Y.
        assert!(
            p[0].abs_diff_eq(Vec3::new(0.0, 1.0, 0.0), 1e-6),
            "the root's own offset is ignored"
        );
        assert!(p[1].abs_diff_eq(Vec3::new(0.0, 2.0, 0.0), 1e-6));
        // b is turned 90° about its own X, so its Y is a's Z, the world's Z.
        assert!(p[2].abs_diff_eq(Vec3::new(0.0, 2.0, 2.0), 1e-6));
        let want = Quat::from_rotation_z(FRAC_PI_2) * Quat::from_rotation_x(FRAC_PI_2);
        assert!(angle_between(world.rotations_at(0)[2], want) < 1e-6);
    }

    #[test]
    fn a_whole_clip_is_its_frames() {
        let clip = walk(5);
        let world = WorldMotion::from_clip(&clip);
        assert_eq!((world.frames(), world.joints), (5, 8));
        let mut p = [Vec3::ZERO; 8];
        let mut q = [Quat::IDENTITY; 8];
        world_transforms(
            &clip.skeleton,
            clip.root_positions[3],
            clip.rotations_at(3),
            &mut p,
            &mut q,
        );
        assert_eq!((world.positions_at(3), world.rotations_at(3)), (&p[..], &q[..]));
    }

    proptest! {
        #[test]
        fn one_joint_is_where_all_joints_put_it(local in proptest::collection::vec(any_quat(), 8)) {
            let skeleton = biped();
            let mut p = [Vec3::ZERO; 8];
            let mut world = [Quat::IDENTITY; 8];
            world_transforms(&skeleton, Vec3::ONE, &local, &mut p, &mut world);
            for j in 0..8 {
                prop_assert_eq!(joint_transform(&skeleton, Vec3::ONE, &local, j), (p[j], world[j]));
                let mut seen = Vec::new();
                let mut visit = |joint, position, rotation| seen.push((joint, position, rotation));
                transforms_down_to(&skeleton, Vec3::ONE, &local, j, &mut visit);
                let mut path: Vec<usize> = std::iter::successors(Some(j), |&j| skeleton.joints[j].parent).collect();
                path.reverse();
                let wanted: Vec<_> = path.into_iter().map(|j| (j, p[j], world[j])).collect();
                prop_assert_eq!(seen, wanted);
            }
        }

        #[test]
        fn local_rotations_come_back(local in proptest::collection::vec(any_quat(), 8)) {
            let skeleton = biped();
            let mut p = [Vec3::ZERO; 8];
            let mut world = [Quat::IDENTITY; 8];
            world_transforms(&skeleton, Vec3::ONE, &local, &mut p, &mut world);
            let mut back = [Quat::IDENTITY; 8];
            local_from_world_rotations(&skeleton, &world, &mut back);
            for (j, (a, b)) in local.iter().zip(&back).enumerate() {
                prop_assert!(angle_between(*a, *b) < 1e-5);
                // Bones keep their length.
                if let Some(parent) = skeleton.joints[j].parent {
                    let length = p[j].distance(p[parent]);
                    prop_assert!((length - skeleton.joints[j].offset_m.length()).abs() < 1e-5);
                }
            }
        }
    }
}

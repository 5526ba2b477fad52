//! Conversions between Troupe's convention and those of engines and robots: axes, handedness and
//! units.
//!
//! Troupe: right-handed, metres, X to the character's left, Y up, Z forward. A conversion is a
//! signed permutation of axes and a scale. Rotations convert by change of basis, joint by joint, so
//! forward kinematics commutes with it. Convert a skeleton's offsets with
//! [`Convention::position_from_native`] and a pose's rotations with
//! [`Convention::rotation_from_native`], and the positions come out converted. The bones' local
//! axes change with it.

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A convention of axes and units. Apart from Troupe's own, each is named after its main user.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Convention {
    /// Troupe's own, and glTF's: right-handed, X left, Y up, Z forward, metres.
    #[default]
    Native,
    /// Unreal Engine: left-handed, X forward, Y right, Z up, centimetres.
    Unreal,
    /// Unity: left-handed, X right, Y up, Z forward, metres.
    Unity,
    /// ROS (REP 103) and MuJoCo: right-handed, X forward, Y left, Z up, metres. Quaternions are (w,
    /// x, y, z) in MuJoCo and (x, y, z, w) in ROS messages; this type does not change that order.
    Ros,
}

impl Convention {
    /// All conventions.
    pub const ALL: [Self; 4] = [Self::Native, Self::Unreal, Self::Unity, Self::Ros];

    /// Units of the convention in a metre.
    pub fn units_per_metre(self) -> f32 {
        if self == Self::Unreal { 100.0 } else { 1.0 }
    }

    /// Whether it is left-handed: angles about a shared axis then change sign.
    pub fn is_left_handed(self) -> bool {
        matches!(self, Self::Unreal | Self::Unity)
    }

    /// The signed permutation from native axes to the convention's: `v' = M v`. Its inverse is its
    /// transpose.
    pub fn axes_from_native(self) -> Mat3 {
        // Columns: directions of native X (left), Y (up) and Z (forward).
        match self {
            Self::Native => Mat3::IDENTITY,
            Self::Unreal => Mat3::from_cols(Vec3::NEG_Y, Vec3::Z, Vec3::X),
            Self::Unity => Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::Z),
            Self::Ros => Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::X),
        }
    }

    /// A native position, offset or velocity (metres) in the convention's axes and units.
    pub fn position_from_native(self, p: Vec3) -> Vec3 {
        self.axes_from_native() * p * self.units_per_metre()
    }

    /// A position, offset or velocity of the convention in native axes and metres.
    pub fn position_to_native(self, p: Vec3) -> Vec3 {
        self.axes_from_native().transpose() * p / self.units_per_metre()
    }

    /// A native direction in the convention's axes; lengths are kept.
    pub fn direction_from_native(self, d: Vec3) -> Vec3 {
        self.axes_from_native() * d
    }

    /// A direction of the convention in native axes; lengths are kept.
    pub fn direction_to_native(self, d: Vec3) -> Vec3 {
        self.axes_from_native().transpose() * d
    }

    /// A native rotation (world or parent-relative) in the convention's axes.
    pub fn rotation_from_native(self, q: Quat) -> Quat {
        // A rotation's axis is a pseudovector: a mirror reverses it.
        let v = self.axes_from_native() * q.xyz() * self.angle_sign();
        Quat::from_vec4(v.extend(q.w))
    }

    /// A rotation of the convention in native axes.
    pub fn rotation_to_native(self, q: Quat) -> Quat {
        let v = self.axes_from_native().transpose() * q.xyz() * self.angle_sign();
        Quat::from_vec4(v.extend(q.w))
    }

    /// A native heading, or its rate, about the convention's up axis, with the sign of its
    /// handedness.
    pub fn heading_from_native(self, heading: f32) -> f32 {
        heading * self.angle_sign()
    }

    /// A heading of the convention, or its rate, as the native one.
    pub fn heading_to_native(self, heading: f32) -> f32 {
        heading * self.angle_sign()
    }

    fn angle_sign(self) -> f32 {
        if self.is_left_handed() { -1.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fk::world_transforms;
    use crate::root::heading_of;
    use crate::rotation::angle_between;
    use crate::rotation::tests::any_quat;
    use crate::skeleton::Skeleton;
    use crate::testing::biped;
    use proptest::prelude::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn left_up_and_forward_by_hand() {
        let at = |c: Convention| [Vec3::X, Vec3::Y, Vec3::Z].map(|v| c.position_from_native(v).to_array());
        // Left, up, forward one metre.
        assert_eq!(
            at(Convention::Unreal),
            [[0.0, -100.0, 0.0], [0.0, 0.0, 100.0], [100.0, 0.0, 0.0]]
        );
        assert_eq!(
            at(Convention::Unity),
            [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        );
        assert_eq!(
            at(Convention::Ros),
            [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
        );
        assert_eq!(
            at(Convention::Native),
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        );
        for c in Convention::ALL {
            let det = c.axes_from_native().determinant();
            assert_eq!(det < 0.0, c.is_left_handed(), "{c:?}");
        }
    }

    #[test]
    fn a_quarter_turn_to_the_left_by_hand() {
        let left = Quat::from_rotation_y(FRAC_PI_2);
        // ROS: about +Z, positive to the left. Left-handed engines: positive to the right.
        let ros = Convention::Ros.rotation_from_native(left);
        assert!(angle_between(ros, Quat::from_rotation_z(FRAC_PI_2)) < 1e-6);
        let unity = Convention::Unity.rotation_from_native(left);
        assert!(angle_between(unity, Quat::from_rotation_y(-FRAC_PI_2)) < 1e-6);
        let unreal = Convention::Unreal.rotation_from_native(left);
        assert!(angle_between(unreal, Quat::from_rotation_z(-FRAC_PI_2)) < 1e-6);
        assert_eq!(Convention::Unreal.heading_from_native(0.3), -0.3);
        assert_eq!(Convention::Ros.heading_from_native(0.3), 0.3);
    }

    proptest! {
        #[test]
        fn all_conversions_come_back(p in [-9.0f32..9.0, -9.0f32..9.0, -9.0f32..9.0], q in any_quat(), h in -3.0f32..3.0) {
            let p = Vec3::from(p);
            for c in Convention::ALL {
                prop_assert!(c.position_to_native(c.position_from_native(p)).abs_diff_eq(p, 1e-5));
                prop_assert!(c.direction_to_native(c.direction_from_native(p)).abs_diff_eq(p, 1e-6));
                prop_assert!((c.direction_from_native(p).length() - p.length()).abs() < 1e-5);
                prop_assert!(angle_between(c.rotation_to_native(c.rotation_from_native(q)), q) < 1e-5);
                prop_assert_eq!(c.heading_to_native(c.heading_from_native(h)), h);
                // Converting a turned vector gives the same as turning the converted vector.
                let a = c.direction_from_native(q * p);
                let b = c.rotation_from_native(q) * c.direction_from_native(p);
                prop_assert!(a.abs_diff_eq(b, 1e-4), "{:?}", c);
            }
        }

        #[test]
        fn kinematics_commutes_with_conversion(local in proptest::collection::vec(any_quat(), 8)) {
            let native = biped();
            for c in Convention::ALL {
                let mut joints = native.joints.clone();
                joints.iter_mut().for_each(|j| j.offset_m = c.position_from_native(j.offset_m));
                let left = c.direction_from_native(native.left_axis);
                let skeleton = Skeleton::new(joints, left, 0.0, None).unwrap();
                let converted: Vec<_> = local.iter().map(|&q| c.rotation_from_native(q)).collect();
                let mut p = [[Vec3::ZERO; 8]; 2];
                let mut q = [[Quat::IDENTITY; 8]; 2];
                let root = Vec3::new(1.0, 0.9, -2.0);
                world_transforms(&native, root, &local, &mut p[0], &mut q[0]);
                world_transforms(&skeleton, c.position_from_native(root), &converted, &mut p[1], &mut q[1]);
                for j in 0..8 {
                    prop_assert!(c.position_to_native(p[1][j]).abs_diff_eq(p[0][j], 1e-4));
                    prop_assert!(angle_between(c.rotation_to_native(q[1][j]), q[0][j]) < 1e-4);
                }
            }
        }

        #[test]
        fn a_yaw_is_its_heading_in_the_convention(h in -3.0f32..3.0) {
            // Z-up conventions turn about +Z, Unity about +Y.
            for c in [Convention::Unreal, Convention::Unity, Convention::Ros] {
                let turned = c.rotation_from_native(crate::rotation::yaw(h));
                let angle = c.heading_from_native(h);
                let want = if c == Convention::Unity { Quat::from_rotation_y(angle) } else { Quat::from_rotation_z(angle) };
                prop_assert!(angle_between(turned, want) < 1e-5);
                prop_assert!((heading_of(c.rotation_to_native(turned), Vec3::X) - h).abs() < 1e-4);
            }
        }
    }
}

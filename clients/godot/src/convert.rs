//! Godot's types and those of the rest of this library. Neither changes the frame of reference.

use glam::{Affine3A, Mat3A, Quat, Vec3};
use godot::builtin::{Quaternion, Transform3D, Vector3};

/// A vector of Godot's.
pub fn vec3(of: Vector3) -> Vec3 {
    Vec3::new(of.x, of.y, of.z)
}

/// A vector for Godot.
pub fn vector3(of: Vec3) -> Vector3 {
    Vector3::new(of.x, of.y, of.z)
}

/// A rotation for Godot.
pub fn quaternion(of: Quat) -> Quaternion {
    Quaternion::new(of.x, of.y, of.z, of.w)
}

/// A transform of Godot's.
pub fn affine(of: Transform3D) -> Affine3A {
    let columns = [of.basis.col_a(), of.basis.col_b(), of.basis.col_c()];
    let [x, y, z] = columns.map(|column| vec3(column).into());
    Affine3A::from_mat3_translation(Mat3A::from_cols(x, y, z).into(), vec3(of.origin))
}

#[cfg(test)]
mod tests {
    use godot::builtin::Basis;

    use super::*;
    use crate::axes;

    /// The types of the engine compute without it.
    #[test]
    fn a_transform_does_the_same_in_both_types() {
        let turn = Quaternion::from_axis_angle(Vector3::new(0.6, 0.48, 0.64), 1.7);
        let basis = Basis::from_quaternion(turn).scaled(Vector3::new(2.0, 2.0, 2.0));
        let of = Transform3D::new(basis, Vector3::new(0.5, 1.25, -2.0));
        let point = Vector3::new(-3.0, 0.2, 1.0);
        let moved = affine(of).transform_point3(vec3(point));
        assert!(moved.abs_diff_eq(vec3(of * point), 1e-5), "{moved}");
        let turned = Quat::from_xyzw(turn.x, turn.y, turn.z, turn.w);
        assert!((quaternion(turned) * point).distance_to(turn * point) < 1e-5);
        assert_eq!(vector3(vec3(point)), point);
    }

    #[test]
    fn half_a_turn_about_y_leads_to_the_frame_of_godot() {
        let half = Quaternion::from_axis_angle(Vector3::UP, std::f32::consts::PI);
        for point in [
            Vector3::LEFT,
            Vector3::UP,
            Vector3::FORWARD,
            Vector3::new(0.3, -2.0, 5.0),
        ] {
            assert!(vector3(axes::position(vec3(point))).distance_to(half * point) < 1e-5);
        }
        // Troupe's X is to the left, its Z ahead.
        assert_eq!(vector3(axes::position(Vec3::X)), Vector3::LEFT);
        assert_eq!(vector3(axes::position(Vec3::Z)), Vector3::FORWARD);
    }
}

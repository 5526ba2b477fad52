//! Rotations: the continuous 6D form, sign alignment, yaw, and wire order.

use glam::{Quat, Vec3};

/// The 6D form of a rotation: the first two columns of its matrix, column 0 then column 1 (Zhou et al. 2019).
#[inline]
pub fn six_d(q: Quat) -> [f32; 6] {
    let (a, b) = (q * Vec3::X, q * Vec3::Y);
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

/// The unit quaternion whose matrix columns are the Gram-Schmidt orthonormalisation of the two columns in `d`.
///
/// Inverse of [`six_d`] up to the quaternion's sign. Never fails: where the columns are zero, parallel or not
/// finite, the missing direction is chosen arbitrarily but deterministically.
pub fn from_six_d(d: [f32; 6]) -> Quat {
    let a = Vec3::new(d[0], d[1], d[2]);
    let b = Vec3::new(d[3], d[4], d[5]);
    let x = a.try_normalize().unwrap_or(Vec3::X);
    let y = b - x * x.dot(b);
    let y = if y.length_squared() > NEARLY_ALONG * b.length_squared() {
        y.normalize()
    } else {
        across(x, y)
    };
    Quat::from_mat3(&glam::Mat3::from_cols(x, y, x.cross(y)))
}

/// Square of the sine below which two columns count as nearly along each other: what is left of one across the other
/// has lost digits then.
const NEARLY_ALONG: f32 = 1e-3;

/// A direction across `x`, as near to `y` as its digits allow.
#[cold]
fn across(x: Vec3, y: Vec3) -> Vec3 {
    match y.try_normalize() {
        // A second pass: after cancellation the first leaves a visible component along x.
        Some(y) => (y - x * x.dot(y))
            .try_normalize()
            .unwrap_or_else(|| x.any_orthonormal_vector()),
        None => x.any_orthonormal_vector(),
    }
}

/// Spherical interpolation along the shorter way from `a` (`t` = 0) to `b` (`t` = 1), of unit length.
#[inline]
pub fn slerp(a: Quat, b: Quat, t: f32) -> Quat {
    a.slerp(b, t).normalize()
}

/// Interpolates two poses joint by joint into `out`; all three have one quaternion a joint.
pub fn slerp_pose(a: &[Quat], b: &[Quat], t: f32, out: &mut [Quat]) {
    for ((out, &a), &b) in out.iter_mut().zip(a).zip(b) {
        *out = slerp(a, b, t);
    }
}

/// `q` or `-q`, whichever lies in the hemisphere of `reference`. Both are the same rotation.
#[inline]
pub fn align_sign(q: Quat, reference: Quat) -> Quat {
    if q.dot(reference) < 0.0 { -q } else { q }
}

/// The angle between two rotations, in radians, 0 to π. Precise for small angles too.
pub fn angle_between(a: Quat, b: Quat) -> f32 {
    let d = a.inverse() * b;
    2.0 * d.xyz().length().atan2(d.w.abs())
}

/// The rotation about +Y that turns +Z to heading `heading` (radians).
#[inline]
pub fn yaw(heading: f32) -> Quat {
    Quat::from_rotation_y(heading)
}

/// The wire order `(w, x, y, z)`.
#[inline]
pub fn to_wxyz(q: Quat) -> [f32; 4] {
    [q.w, q.x, q.y, q.z]
}

/// From the wire order `(w, x, y, z)`. Neither checks nor changes the length.
#[inline]
pub fn from_wxyz(v: [f32; 4]) -> Quat {
    Quat::from_xyzw(v[1], v[2], v[3], v[0])
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::{FRAC_PI_2, PI};

    /// Any rotation, from four numbers that are not all tiny.
    pub(crate) fn any_quat() -> impl Strategy<Value = Quat> {
        [-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0]
            .prop_map(Quat::from_array)
            .prop_filter("long enough to normalise", |q| q.length() > 1e-2)
            .prop_map(|q| q.normalize())
    }

    #[test]
    fn six_d_is_two_columns() {
        // 90° about Z takes X to Y and Y to -X.
        let d = six_d(Quat::from_rotation_z(FRAC_PI_2));
        let want = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
        for (a, b) in d.iter().zip(want) {
            assert!((a - b).abs() < 1e-6, "{d:?}");
        }
    }

    #[test]
    fn degenerate_six_d_gives_a_rotation() {
        for d in [
            [0.0; 6],
            [1.0, 0.0, 0.0, 2.0, 0.0, 0.0],
            [f32::NAN; 6],
            [f32::INFINITY; 6],
            [1e-30; 6],
        ] {
            let q = from_six_d(d);
            assert!(
                q.is_finite() && (q.length() - 1.0).abs() < 1e-5,
                "{d:?} gave {q:?}"
            );
        }
    }

    #[test]
    fn scaled_and_sheared_columns_are_orthonormalised() {
        // Columns 3·X and X+2·Y: Gram-Schmidt gives the identity.
        let q = from_six_d([3.0, 0.0, 0.0, 1.0, 2.0, 0.0]);
        assert!(angle_between(q, Quat::IDENTITY) < 1e-6);
    }

    #[test]
    fn yaw_turns_forward_to_the_heading() {
        let f = yaw(FRAC_PI_2) * Vec3::Z;
        assert!(f.abs_diff_eq(Vec3::X, 1e-6));
        assert!((angle_between(yaw(0.3), yaw(-0.2)) - 0.5).abs() < 1e-6);
        assert!((angle_between(yaw(0.0), -yaw(PI)) - PI).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn six_d_round_trip(q in any_quat()) {
            prop_assert!(angle_between(from_six_d(six_d(q)), q) < 1e-3);
            let (a, b) = (six_d(from_six_d(six_d(q))), six_d(q));
            for i in 0..6 { prop_assert!((a[i] - b[i]).abs() < 2e-6); }
        }

        #[test]
        fn from_six_d_is_always_unit(d in proptest::array::uniform6(-1e3f32..1e3)) {
            prop_assert!((from_six_d(d).length() - 1.0).abs() < 1e-5);
        }

        #[test]
        fn slerp_hits_both_ends_and_halves_the_angle(a in any_quat(), b in any_quat()) {
            prop_assert!(angle_between(slerp(a, b, 0.0), a) < 1e-3);
            prop_assert!(angle_between(slerp(a, b, 1.0), b) < 1e-3);
            let whole = angle_between(a, b);
            // Close to half a turn the way is not unique.
            prop_assume!(whole < 3.1);
            prop_assert!((angle_between(a, slerp(a, b, 0.5)) - whole / 2.0).abs() < 2e-3);
        }

        #[test]
        fn wire_order_round_trip(q in any_quat()) {
            prop_assert_eq!(from_wxyz(to_wxyz(q)), q);
            prop_assert!(align_sign(-q, q).dot(q) > 0.0);
        }
    }
}

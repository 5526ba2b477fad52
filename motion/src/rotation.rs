//! Rotations: the continuous 6D form, sign alignment, yaw, and wire order.

use glam::{Quat, Vec3};
use wide::f32x4;

/// The 6D form of a rotation: the first two columns of its matrix, column 0 then column 1 (Zhou et
/// al. 2019).
#[inline]
pub fn six_d(q: Quat) -> [f32; 6] {
    let (a, b) = (q * Vec3::X, q * Vec3::Y);
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

/// The unit quaternion whose matrix columns are the Gram-Schmidt orthonormalisation of the two
/// columns in `d`.
///
/// The inverse of [`six_d`] up to the quaternion's sign. Never fails: for zero, parallel or
/// infinite columns, the missing direction is arbitrary but deterministic.
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

/// [`from_six_d`] of as many rotations as both `six_d` (six numbers each) and `out` hold. Does not
/// allocate.
///
/// Four at a time, equal to [`from_six_d`] one by one to the last bit.
pub fn from_six_ds(six_d: &[f32], out: &mut [Quat]) {
    let one_by_one = |six_d: &[[f32; 6]], out: &mut [Quat]| {
        for (out, &d) in out.iter_mut().zip(six_d) {
            *out = from_six_d(d);
        }
    };
    let each = six_d.as_chunks().0;
    let count = each.len().min(out.len());
    let (fours, rest) = each[..count].as_chunks();
    let (out_fours, out_rest) = out[..count].as_chunks_mut();
    for (d, out) in fours.iter().zip(out_fours) {
        match four_from_six_d(d) {
            Some(rotations) => *out = rotations,
            None => one_by_one(d, out),
        }
    }
    one_by_one(rest, out_rest);
}

/// Four rotations at once. `None` if the columns of one are almost parallel, or of an unusual size.
///
/// The branches of [`from_six_d`], and of the conversion from a matrix to a quaternion after it,
/// become selections number by number.
#[inline]
fn four_from_six_d(d: &[[f32; 6]; 4]) -> Option<[Quat; 4]> {
    let across_four = |number: usize| f32x4::new([d[0][number], d[1][number], d[2][number], d[3][number]]);
    let [ax, ay, az, bx, by, bz] = std::array::from_fn(across_four);

    let a_squared = ax * ax + ay * ay + az * az;
    let b_squared = bx * bx + by * by + bz * bz;
    let shrink = f32x4::ONE / a_squared.sqrt();
    let (xx, xy, xz) = (ax * shrink, ay * shrink, az * shrink);
    let along = xx * bx + xy * by + xz * bz;
    let (yx, yy, yz) = (bx - xx * along, by - xy * along, bz - xz * along);
    let y_squared = yx * yx + yy * yy + yz * yz;
    let usual = |squared: f32x4| squared.simd_gt(f32x4::splat(1e-12)) & squared.simd_lt(f32x4::splat(1e12));
    let well_apart = y_squared.simd_gt(b_squared * NEARLY_ALONG);
    if !(usual(a_squared) & usual(b_squared) & well_apart).all() {
        return None;
    }
    let shrink = f32x4::ONE / y_squared.sqrt();
    let (yx, yy, yz) = (yx * shrink, yy * shrink, yz * shrink);
    let (zx, zy, zz) = (xy * yz - xz * yy, xz * yx - xx * yz, xx * yy - xy * yx);

    // Four times the squares of x, y, z and w; the largest is used as divisor.
    let (one_less, one_more) = (f32x4::ONE - zz, f32x4::ONE + zz);
    let (sum, difference) = (xx + yy, yy - xx);
    let (x4, y4) = (one_less - difference, one_less + difference);
    let (z4, w4) = (one_more - sum, one_more + sum);
    let (xy_sum, xz_sum, yz_sum) = (xy + yx, xz + zx, yz + zy);
    let (yz_gap, zx_gap, xy_gap) = (yz - zy, zx - xz, xy - yx);
    let pick = |x: f32x4, y: f32x4, z: f32x4, w: f32x4| {
        let x_or_y = difference.simd_le(f32x4::ZERO).select(x, y);
        let z_or_w = sum.simd_le(f32x4::ZERO).select(z, w);
        zz.simd_le(f32x4::ZERO).select(x_or_y, z_or_w)
    };
    let scale = f32x4::HALF / pick(x4, y4, z4, w4).sqrt();
    let columns = [
        pick(x4, xy_sum, xz_sum, yz_gap) * scale,
        pick(xy_sum, y4, yz_sum, zx_gap) * scale,
        pick(xz_sum, yz_sum, z4, xy_gap) * scale,
        pick(yz_gap, zx_gap, xy_gap, w4) * scale,
    ];
    Some(f32x4::transpose(columns).map(|row| Quat::from_array(row.to_array())))
}

/// Square of the sine below which two columns count as nearly parallel: the component of one across
/// the other has then lost digits.
const NEARLY_ALONG: f32 = 1e-3;

/// A direction perpendicular to `x`, as near to `y` as its digits allow.
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

/// Spherical interpolation the shorter way from `a` (`t` = 0) to `b` (`t` = 1), of unit length.
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

/// From the wire order `(w, x, y, z)`. The length is neither checked nor changed.
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
        fn four_at_a_time_is_one_by_one(
            rotations in proptest::collection::vec((any_quat(), 1e-3f32..1e3, any::<bool>()), 0..14),
            bent in -1f32..1.0,
        ) {
            let six_ds: Vec<[f32; 6]> = rotations
                .iter()
                .map(|&(rotation, size, plain)| {
                    let d = six_d(rotation).map(|number| number * size);
                    // Columns that are not perpendicular, and some that are.
                    if plain { d } else { [d[0], d[1], d[2], d[3] + bent, d[1], d[2]] }
                })
                .collect();
            for room in 0..=rotations.len() + 5 {
                let mut found = vec![Quat::IDENTITY; room];
                from_six_ds(six_ds.as_flattened(), &mut found);
                let mut wanted: Vec<Quat> = six_ds.iter().map(|&d| from_six_d(d)).collect();
                wanted.resize(room, Quat::IDENTITY);
                prop_assert_eq!(found, wanted);
            }
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
            // Near half a turn the shorter way is not unique.
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

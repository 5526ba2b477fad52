//! The compact form of frames: a root in tenths of a millimetre, and smallest-three quaternions
//! with 15 bits a component.
//!
//! A unit quaternion's largest component follows from the other three, which lie within ±1/√2. Each
//! of those takes the low 15 bits of a little-endian 16-bit word, in the order (w, x, y, z). The
//! top bits of the first two words, lower first, give the index of the component that is left out.
//! That component is positive: of `q` and `-q`, which are the same rotation, the one with that sign
//! is encoded. The top bit of the third word is 0.
//!
//! | part | bytes | error |
//! |---|---|---|
//! | root position | [`BYTES_PER_ROOT`] | at most [`MAX_ROOT_ERROR_M`] an axis |
//! | rotation of a joint | [`BYTES_PER_ROTATION`] | at most [`MAX_ROTATION_ERROR_RAD`] |

use std::f32::consts::FRAC_1_SQRT_2;

use glam::{Quat, Vec3};

use crate::rotation::{from_wxyz, to_wxyz};

/// Bytes of an encoded root position: three little-endian 32-bit integers.
pub const BYTES_PER_ROOT: usize = 12;
/// Bytes of an encoded rotation: three little-endian 16-bit words.
pub const BYTES_PER_ROTATION: usize = 6;
/// Length of an encoded root position's unit, metres.
pub const ROOT_STEP_M: f32 = 1e-4;
/// Largest angle between a rotation and what its encoding decodes to, radians.
///
/// Half a step is h = 1 / (32767 √2). Each of the three written components is off by at most h, and
/// the fourth by at most 3 h (worst if all four are 1/2). So the angle is at most 2 √12 h =
/// 1.495e-4; the rest is rounding.
pub const MAX_ROTATION_ERROR_RAD: f32 = 1.6e-4;
/// Largest error of an encoded root position along each axis within 256 m of the origin, metres.
///
/// It is half of [`ROOT_STEP_M`] plus the rounding of a 32-bit float. Farther out, the float's own
/// spacing is coarser.
pub const MAX_ROOT_ERROR_M: f32 = 6e-5;

/// Highest value of a component's 15 bits.
const COMPONENT_MAX: u16 = 0x7fff;
/// The bit above a component, which holds a bit of the index.
const INDEX_BIT: u16 = 0x8000;

/// Encodes a rotation of any length. A rotation that is not finite, or zero, becomes the identity.
#[inline]
pub fn encode_rotation(rotation: Quat) -> [u16; 3] {
    let length = rotation.length();
    let unit = if length.is_finite() && length > 1e-12 {
        rotation * length.recip()
    } else {
        Quat::IDENTITY
    };
    let q = to_wxyz(unit);
    let mut largest = 0;
    for i in 1..4 {
        if q[i].abs() > q[largest].abs() {
            largest = i;
        }
    }
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut words = [0; 3];
    for (word, i) in words.iter_mut().zip((0..4).filter(|&i| i != largest)) {
        *word = quantise(sign * q[i]);
    }
    for (bit, word) in words.iter_mut().take(2).enumerate() {
        if largest >> bit & 1 == 1 {
            *word |= INDEX_BIT;
        }
    }
    words
}

/// Decodes a rotation. Any words give unit length, with the left-out component not negative.
#[inline]
pub fn decode_rotation(words: [u16; 3]) -> Quat {
    let largest = usize::from(words[0] >> 15) | usize::from(words[1] >> 15) << 1;
    let mut q = [0.0; 4];
    let mut rest = 1.0;
    for (word, i) in words.into_iter().zip((0..4).filter(|&i| i != largest)) {
        q[i] = component(word);
        rest -= q[i] * q[i];
    }
    q[largest] = rest.max(0.0).sqrt();
    from_wxyz(q).normalize()
}

/// Encodes a root position in steps of [`ROOT_STEP_M`]. A coordinate beyond ±214748 m, or infinite,
/// becomes the nearest end of the range; NaN becomes 0.
#[inline]
pub fn encode_root(position: Vec3) -> [i32; 3] {
    // In double precision, so that only the rounding to a step loses precision. The cast saturates.
    position
        .to_array()
        .map(|v| (f64::from(v) / f64::from(ROOT_STEP_M)).round() as i32)
}

/// Decodes a root position, metres.
#[inline]
pub fn decode_root(steps: [i32; 3]) -> Vec3 {
    Vec3::from_array(steps.map(|v| (f64::from(v) * f64::from(ROOT_STEP_M)) as f32))
}

/// Appends encoded rotations, [`BYTES_PER_ROTATION`] each. Allocates only if `out` lacks capacity.
pub fn write_rotations(rotations: &[Quat], out: &mut Vec<u8>) {
    out.reserve(rotations.len() * BYTES_PER_ROTATION);
    for &rotation in rotations {
        for word in encode_rotation(rotation) {
            out.extend_from_slice(&word.to_le_bytes());
        }
    }
}

/// Appends decoded rotations, without an incomplete one at the end. Allocates only if `out` lacks
/// capacity.
pub fn read_rotations(bytes: &[u8], out: &mut Vec<Quat>) {
    let (rotations, _) = bytes.as_chunks::<BYTES_PER_ROTATION>();
    out.extend(rotations.iter().map(|b| {
        decode_rotation([
            u16::from_le_bytes([b[0], b[1]]),
            u16::from_le_bytes([b[2], b[3]]),
            u16::from_le_bytes([b[4], b[5]]),
        ])
    }));
}

/// Appends encoded root positions, [`BYTES_PER_ROOT`] each. Allocates only if `out` lacks capacity.
pub fn write_roots(positions: &[Vec3], out: &mut Vec<u8>) {
    out.reserve(positions.len() * BYTES_PER_ROOT);
    for &position in positions {
        for step in encode_root(position) {
            out.extend_from_slice(&step.to_le_bytes());
        }
    }
}

/// Appends decoded root positions, without an incomplete one at the end. Allocates only if `out`
/// lacks capacity.
pub fn read_roots(bytes: &[u8], out: &mut Vec<Vec3>) {
    let (positions, _) = bytes.as_chunks::<BYTES_PER_ROOT>();
    out.extend(positions.iter().map(|b| {
        decode_root([
            i32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            i32::from_le_bytes([b[4], b[5], b[6], b[7]]),
            i32::from_le_bytes([b[8], b[9], b[10], b[11]]),
        ])
    }));
}

/// Quantises a component within ±1/√2 to 15 bits, rounded to the nearest.
#[inline]
fn quantise(value: f32) -> u16 {
    let share = (value / FRAC_1_SQRT_2 + 1.0) * 0.5;
    (share.clamp(0.0, 1.0) * f32::from(COMPONENT_MAX)).round() as u16
}

/// The component in the low 15 bits of `word`.
#[inline]
fn component(word: u16) -> f32 {
    let share = f32::from(word & COMPONENT_MAX) / f32::from(COMPONENT_MAX);
    (share * 2.0 - 1.0) * FRAC_1_SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::angle_between;
    use crate::rotation::tests::any_quat;
    use proptest::prelude::*;

    /// Angle in double precision: a 32-bit one is as coarse as the errors that the tests look for.
    fn angle(a: Quat, b: Quat) -> f64 {
        let (a, b) = (a.as_dquat().normalize(), b.as_dquat().normalize());
        let d = a.inverse() * b;
        2.0 * d.xyz().length().atan2(d.w.abs())
    }

    #[test]
    fn words_follow_the_documented_format() {
        // The identity leaves out w (index 0): no index bits, and three zeros between two steps.
        for word in encode_rotation(Quat::IDENTITY) {
            assert!((16383..=16384).contains(&word));
        }
        // Half a turn about x, y, z leaves out component 1, 2, 3: lower bit in the first word,
        // higher in the second.
        for (q, bits) in [
            (Quat::from_xyzw(1.0, 0.0, 0.0, 0.0), [1, 0, 0]),
            (Quat::from_xyzw(0.0, 1.0, 0.0, 0.0), [0, 1, 0]),
            (Quat::from_xyzw(0.0, 0.0, 1.0, 0.0), [1, 1, 0]),
        ] {
            assert_eq!(encode_rotation(q).map(|word| word >> 15), bits);
        }
        // The others in the order (w, x, y, z). x is the largest, so the words are w, y, z.
        let q = Quat::from_xyzw(0.8, 0.4, -0.2, 0.4).normalize();
        let words = encode_rotation(q).map(|word| f32::from(word & 0x7fff));
        for (word, want) in words.into_iter().zip([q.w, q.y, q.z]) {
            assert!(((word / 32767.0 * 2.0 - 1.0) / 2f32.sqrt() - want).abs() < 3e-5);
        }
    }

    #[test]
    fn invalid_rotations_become_the_identity() {
        let near = |q: Quat| angle_between(q, Quat::IDENTITY) < MAX_ROTATION_ERROR_RAD;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..4 {
                let mut q = [0.0, 0.0, 0.0, 1.0];
                q[i] = bad;
                assert!(
                    near(decode_rotation(encode_rotation(Quat::from_array(q)))),
                    "{q:?}"
                );
            }
        }
        assert!(near(decode_rotation(encode_rotation(Quat::from_array([0.0; 4])))));
    }

    #[test]
    fn roots_saturate() {
        let far = encode_root(Vec3::new(1e9, -1e9, f32::NAN));
        assert_eq!(far, [i32::MAX, i32::MIN, 0]);
        assert_eq!(
            encode_root(Vec3::new(f32::INFINITY, f32::NEG_INFINITY, -0.00016)),
            [i32::MAX, i32::MIN, -2]
        );
        assert!((decode_root([i32::MAX, 1, -10_000]) - Vec3::new(214_748.36, 0.0001, -1.0)).length() < 0.02);
    }

    #[test]
    fn slices_have_the_documented_sizes_and_keep_their_room() {
        let rotations = [Quat::from_rotation_x(1.0), Quat::from_rotation_y(-2.0)];
        let roots = [Vec3::new(1.0, 2.0, -3.0), Vec3::ZERO];
        let mut bytes = Vec::with_capacity(36);
        let before = bytes.as_ptr();
        write_roots(&roots, &mut bytes);
        assert_eq!(bytes.len(), 2 * BYTES_PER_ROOT);
        assert_eq!(bytes[..4], 10_000i32.to_le_bytes());
        write_rotations(&rotations, &mut bytes);
        assert_eq!(bytes.len(), 2 * (BYTES_PER_ROOT + BYTES_PER_ROTATION));
        assert_eq!(bytes.as_ptr(), before, "no allocation within the capacity");

        let (mut q, mut p) = (Vec::new(), Vec::new());
        read_roots(&bytes[..30], &mut p);
        assert_eq!(p, roots, "the six surplus bytes are ignored");
        read_rotations(&bytes[24..], &mut q);
        assert_eq!(q.len(), 2);
        assert!(q.iter().zip(rotations).all(|(&a, b)| angle(a, b) < 1.6e-4));
    }

    proptest! {
        #[test]
        fn rotations_come_back_within_the_bound(q in any_quat(), scale in 1e-3f32..1e3) {
            let back = decode_rotation(encode_rotation(q * scale));
            prop_assert!(angle(q, back) <= f64::from(MAX_ROTATION_ERROR_RAD));
        }

        #[test]
        fn the_worst_corner_is_within_the_bound(
            off in proptest::array::uniform4(-2e-4f32..2e-4),
            signs in proptest::array::uniform4(proptest::bool::ANY),
        ) {
            // All four components near 1/2: the largest error of the left-out one.
            let q: [f32; 4] = std::array::from_fn(|i| (0.5 + off[i]) * if signs[i] { 1.0 } else { -1.0 });
            let q = Quat::from_array(q).normalize();
            prop_assert!(angle(q, decode_rotation(encode_rotation(q))) <= f64::from(MAX_ROTATION_ERROR_RAD));
        }

        #[test]
        fn both_signs_have_one_code(q in any_quat()) {
            let a = to_wxyz(q).map(f32::abs);
            let mut sorted = a;
            sorted.sort_by(f32::total_cmp);
            // If two components tie for the largest, either may be left out.
            prop_assume!(sorted[3] - sorted[2] > 1e-6);
            let diff = encode_rotation(q).into_iter().zip(encode_rotation(-q)).map(|(a, b)| a.abs_diff(b)).max();
            prop_assert_eq!(diff, Some(0));
        }

        #[test]
        fn any_words_give_a_canonical_unit_quaternion(words in proptest::array::uniform3(any::<u16>())) {
            let q = decode_rotation(words);
            prop_assert!((q.length() - 1.0).abs() < 1e-5);
            let index = usize::from(words[0] >> 15) | usize::from(words[1] >> 15) << 1;
            prop_assert!(to_wxyz(q)[index] >= 0.0);
        }

        #[test]
        fn roots_come_back_within_the_bound(p in proptest::array::uniform3(-256.0f32..256.0)) {
            let p = Vec3::from_array(p);
            let off = (decode_root(encode_root(p)) - p).abs();
            prop_assert!(off.max_element() <= MAX_ROOT_ERROR_M, "{off}");
        }
    }
}

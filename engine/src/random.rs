//! Random numbers from a seed and a counter: they do not depend on numbers that were drawn before.

use std::f64::consts::TAU;

/// 2^64 divided by the golden ratio, odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of splitmix64 (Steele et al. 2014).
fn mix64(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// 64 random bits for a base and an index: `mix64(base + GOLDEN (index + 1))`.
pub(crate) fn step64(base: u64, index: u64) -> u64 {
    mix64(base.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))))
}

/// Standard normal noise by the transform of Box and Muller. Each pair of numbers comes from the
/// two halves of `step64(key, pair)`, is computed in 64 bits and rounded to 32.
pub(crate) fn normal(key: u64, out: &mut [f32]) {
    let unit = |half: u64| (half as f64 + 0.5) / 2_f64.powi(32);
    for (pair, out) in out.chunks_mut(2).enumerate() {
        let u = step64(key, pair as u64);
        let (a, b) = (unit(u >> 32), unit(u & 0xffff_ffff));
        let (radius, angle) = ((-2.0 * a.ln()).sqrt(), TAU * b);
        let numbers = [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32];
        out.copy_from_slice(&numbers[..out.len()]);
    }
}

//! Noise that depends on seed, row, frame and channel alone: neither on a window's length nor on who else is in the batch.

use std::f64::consts::TAU;

use super::ROW_CHANNELS;

/// 2^64 divided by the golden ratio, odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
/// Channels of the root's place; the others are zero.
const PLACE_CHANNELS: usize = 3;

/// The finaliser of splitmix64 (Steele et al. 2014).
fn mix64(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Standard normal noise of one row, `[frames, 6]`. Row 0 is the root's place.
///
/// `key = mix64(seed + GOLDEN (row + 1))`, `u = mix64(key + GOLDEN (pair + 1))` for each pair of channels, and Box and Muller on
/// its two halves, in 64 bits, rounded to 32.
pub(super) fn row_noise(seed: u64, row: usize, out: &mut [f32]) {
    let step = |base: u64, index: u64| mix64(base.wrapping_add(GOLDEN.wrapping_mul(index + 1)));
    let key = step(seed, row as u64);
    let unit = |half: u64| (half as f64 + 0.5) / 2_f64.powi(32);
    for (pair, out) in out.chunks_exact_mut(2).enumerate() {
        let u = step(key, pair as u64);
        let (a, b) = (unit(u >> 32), unit(u & 0xffff_ffff));
        let (radius, angle) = ((-2.0 * a.ln()).sqrt(), TAU * b);
        out[0] = (radius * angle.cos()) as f32;
        out[1] = (radius * angle.sin()) as f32;
    }
    if row == 0 {
        for frame in out.chunks_exact_mut(ROW_CHANNELS) {
            frame[PLACE_CHANNELS..].fill(0.0);
        }
    }
}

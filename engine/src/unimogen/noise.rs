//! Noise that depends on seed, row, frame and channel alone, not on the window's length or the
//! other characters of a call.

use super::ROW_CHANNELS;
use crate::random::{normal, step64};

/// Channels of the root's position in its row; the others are zero.
const PLACE_CHANNELS: usize = 3;

/// Standard normal noise of one row, `[frames, 6]`. Row 0 is the root's position.
///
/// `key = mix64(seed + GOLDEN (row + 1))`, and `u = mix64(key + GOLDEN (pair + 1))` for each pair
/// of channels.
pub(super) fn row_noise(seed: u64, row: usize, out: &mut [f32]) {
    normal(step64(seed, row as u64), out);
    if row == 0 {
        for frame in out.chunks_exact_mut(ROW_CHANNELS) {
            frame[PLACE_CHANNELS..].fill(0.0);
        }
    }
}

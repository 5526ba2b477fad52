//! Random choices of a take: each sample and each window has numbers of its own.

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The choices of one sample.
pub(super) fn dice(seed: u64, sample: usize) -> ChaCha8Rng {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    dice.set_stream(sample as u64);
    dice
}

/// The seed of a window of a sample.
pub(super) fn window_seed(seed: u64, sample: usize, window: usize) -> u64 {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    // `dice` uses the streams below 2^32.
    dice.set_stream(((window as u64 + 1) << 32) | sample as u64);
    dice.next_u64()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_window_of_each_sample_has_a_seed_of_its_own() {
        let mut seeds: Vec<u64> = (0..4)
            .flat_map(|sample| (0..4).map(move |window| window_seed(7, sample, window)))
            .collect();
        assert_eq!(seeds[0], window_seed(7, 0, 0));
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 16);
    }
}

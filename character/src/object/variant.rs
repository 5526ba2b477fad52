//! Chooses among variants.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::{Definition, Variant};

impl Definition {
    /// Index of a variant by weight. The same seed always chooses the same.
    pub fn variant_for(&self, seed: u64) -> usize {
        let total: f64 = self.variants.iter().map(weight).sum();
        let mut left = ChaCha8Rng::seed_from_u64(seed).random::<f64>() * total;
        let mut chosen = 0;
        for (index, variant) in self.variants.iter().enumerate() {
            if weight(variant) <= 0.0 {
                continue;
            }
            // If rounding leaves a remainder, the last variant with a weight is chosen.
            chosen = index;
            left -= weight(variant);
            if left < 0.0 {
                break;
            }
        }
        chosen
    }

    /// Index of the variant of this name.
    pub fn variant_named(&self, name: &str) -> Option<usize> {
        self.variants.iter().position(|variant| variant.name == name)
    }
}

fn weight(variant: &Variant) -> f64 {
    f64::from(variant.weight)
}

#[cfg(test)]
mod tests {
    use super::super::testing::definition;
    use super::*;
    use proptest::prelude::*;

    fn with_weights(weights: &[f32]) -> Definition {
        let mut thing = definition();
        thing.variants = (weights.iter().enumerate())
            .map(|(index, &weight)| Variant {
                name: index.to_string(),
                weight,
                entry: vec![0],
                exit: Vec::new(),
            })
            .collect();
        thing
    }

    #[test]
    fn shares_follow_weights() {
        let thing = with_weights(&[1.0, 0.0, 3.0, 6.0]);
        let mut counts = [0_u32; 4];
        for seed in 0..10_000 {
            counts[thing.variant_for(seed)] += 1;
        }
        assert_eq!(counts[1], 0);
        for (index, share) in [(0, 0.1), (2, 0.3), (3, 0.6)] {
            let found = f64::from(counts[index]) / 10_000.0;
            assert!((found - share).abs() < 0.02, "{counts:?}");
        }
        assert_eq!(thing.variant_named("2"), Some(2));
        assert_eq!(thing.variant_named("wave"), None);
    }

    #[test]
    fn choices_do_not_change_with_versions() {
        let thing = with_weights(&[1.0, 1.0, 1.0]);
        let chosen: Vec<_> = (0..12).map(|seed| thing.variant_for(seed)).collect();
        assert_eq!(chosen, EXPECTED);
    }

    /// What seeds 0 to 11 choose of three equal variants. Must not change: recordings depend on it.
    const EXPECTED: [usize; 12] = [2, 1, 2, 1, 2, 0, 1, 0, 0, 0, 1, 1];

    proptest! {
        #[test]
        fn one_seed_one_choice(
            weights in prop::collection::vec(prop_oneof![Just(0.0_f32), 1e-3_f32..1000.0], 1..16),
            seed in any::<u64>(),
        ) {
            prop_assume!(weights.iter().any(|&weight| weight > 0.0));
            let thing = with_weights(&weights);
            let chosen = thing.variant_for(seed);
            prop_assert!(weights[chosen] > 0.0);
            prop_assert_eq!(thing.variant_for(seed), chosen);
        }
    }
}

use proptest::prelude::*;

use super::*;

#[test]
fn the_schedule_is_a_falling_cosine() {
    let stay: Vec<usize> = (0..=4).map(|pass| masked_after(64, pass, 4)).collect();
    assert_eq!(stay, [64, 59, 45, 24, 0]);
    assert_eq!(masked_after(64, 1, 1), 0);
}

#[test]
fn count_noise_is_gumbel_and_follows_the_seed() {
    let mut noise = vec![9.0; 10_000];
    fill_count_noise(1, 0.0, &mut noise);
    assert!(noise.iter().all(|&value| value == 0.0));
    fill_count_noise(1, 2.0, &mut noise);
    let mean = noise.iter().sum::<f32>() / noise.len() as f32;
    // The mean of standard Gumbel noise is the Euler-Mascheroni constant.
    assert!((mean - 2.0 * 0.5772).abs() < 0.08, "{mean}");
    let mut again = vec![0.0; 10_000];
    fill_count_noise(1, 2.0, &mut again);
    assert_eq!(noise, again);
    fill_count_noise(2, 2.0, &mut again);
    assert_ne!(noise, again);
}

#[test]
fn samples_follow_the_distribution() {
    let logits = [0.0, 3.0f32.ln(), f32::MIN];
    let count = (0..1000)
        .filter(|&n| sample(&logits, 1.0, n as f32 / 1000.0) == 1)
        .count();
    assert_eq!(count, 750);
    // Half the temperature squares the odds.
    let count = (0..1000)
        .filter(|&n| sample(&logits, 0.5, n as f32 / 1000.0) == 1)
        .count();
    assert_eq!(count, 900);
    assert!((0..1000).all(|n| sample(&logits, 2.0, n as f32 / 1000.0) != 2));
}

#[test]
fn one_pass_takes_every_argmax() {
    let mut tokens = [3; 4];
    let logits = [0.0, 2.0, 1.0, 5.0, 5.0, -1.0, 0.0, 0.0, 0.1, 1.0, 0.0, 0.0];
    assert!(PoseSampler::new(0, 0.0, 1).commit(1, 3, &logits, &mut tokens));
    assert_eq!(tokens, [1, 0, 2, 0]);
}

#[test]
fn the_most_confident_tokens_come_first() {
    let mut sampler = PoseSampler::new(0, 0.0, 2);
    let mut tokens = [2; 4];
    let logits = [0.0, 0.1, 9.0, 0.0, 0.3, 0.0, 0.0, 4.0];
    assert!(sampler.commit(1, 2, &logits, &mut tokens));
    // cos(pi / 4) of 4 entries leaves 2 masked.
    assert_eq!(tokens, [2, 0, 2, 1]);
    let changed = [5.0, 0.0, 0.0, 9.0, 5.0, 0.0, 9.0, 0.0];
    assert!(sampler.commit(2, 2, &changed, &mut tokens));
    assert_eq!(tokens, [0, 0, 0, 1], "committed tokens must stay");
}

#[test]
fn logits_that_are_not_finite_are_reported() {
    let mut tokens = [2; 2];
    assert!(!PoseSampler::new(0, 0.0, 1).commit(1, 2, &[0.0, 1.0, f32::NAN, 0.0], &mut tokens));
    assert_eq!(tokens, [2; 2]);
}

proptest! {
    #[test]
    fn every_token_is_committed_once_within_the_passes(
        entries in 1usize..40,
        passes in 1u32..=10,
        temperature in prop_oneof![Just(0.0f32), 0.01f32..2.0],
        seed: u64,
    ) {
        let codes = 7;
        let run = || {
            let mut sampler = PoseSampler::new(seed, temperature, passes);
            let mut tokens = vec![codes as i64; entries];
            for pass in 1..=passes {
                let before = tokens.clone();
                let logits: Vec<f32> = (0..entries * codes)
                    .map(|index| ((index * 31 + pass as usize * 17) % 13) as f32)
                    .collect();
                prop_assert!(sampler.commit(pass, codes, &logits, &mut tokens));
                for (before, now) in before.iter().zip(&tokens) {
                    prop_assert!(*before == codes as i64 || before == now, "a committed token changed");
                }
            }
            prop_assert!(tokens.iter().all(|&token| (0..codes as i64).contains(&token)), "{:?}", tokens);
            Ok(tokens)
        };
        prop_assert_eq!(run()?, run()?);
    }
}

#[test]
fn root_noise_is_normal_and_follows_the_seed() {
    let mut noise = vec![9.0; 10_000];
    fill_root_noise(1, 0.0, &mut noise);
    assert!(noise.iter().all(|&value| value == 0.0));
    fill_root_noise(1, 0.5, &mut noise);
    let mean = noise.iter().sum::<f32>() / noise.len() as f32;
    let variance = noise.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / noise.len() as f32;
    assert!(
        mean.abs() < 0.02 && (variance - 0.25).abs() < 0.02,
        "{mean} {variance}"
    );
    let mut other = vec![0.0; 10_000];
    fill_root_noise(1, 1.0, &mut other);
    assert!(noise.iter().zip(&other).all(|(half, whole)| *half == 0.5 * whole));
    let first = other[0];
    fill_root_noise(2, 1.0, &mut other);
    assert_ne!(first, other[0]);
    // Neighbouring seeds draw independent numbers.
    let pairs = noise.iter().zip(&other).map(|(a, b)| 2.0 * a * b);
    assert!((pairs.sum::<f32>() / 10_000.0).abs() < 0.05);
}

#[test]
fn the_number_of_root_choices_does_not_change_the_first_ones() {
    let (mut few, mut many) = ([0.0; 5], [0.0; 16]);
    fill_root_noise(7, 1.0, &mut few);
    fill_root_noise(7, 1.0, &mut many);
    assert_eq!(few, many[..5]);
    fill_root_noise(7, 1.0, &mut []);
}

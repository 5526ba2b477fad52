//! Random choices: token counts, root trajectories and pose tokens. Every character has its own
//! generator, so that a choice depends on the character's seed and logits alone, never on the batch
//! it travels in.

use std::f32::consts::FRAC_PI_2;

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use troupe_motion::model::all_finite;

use crate::random::normal;

/// Random streams of a character, one a purpose: a choice in one stage does not shift those of
/// another.
#[derive(Debug, Clone, Copy)]
enum Stream {
    Count = 1,
    Pose = 2,
    Root = 3,
}

fn generator(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(stream as u64);
    generator
}

/// Fills `noise` with `temperature` times standard Gumbel noise: added to log-probabilities, the
/// largest sum is a sample at that temperature. All zero at temperature 0.
pub(super) fn fill_count_noise(seed: u64, temperature: f32, noise: &mut [f32]) {
    noise.fill(0.0);
    if temperature > 0.0 {
        let mut generator = generator(seed, Stream::Count);
        for value in noise {
            *value = temperature * -(-open_unit(&mut generator).ln()).ln();
        }
    }
}

/// Fills `noise` with `temperature` times standard normal numbers, which choose a root trajectory.
/// All zero at temperature 0.
pub(super) fn fill_root_noise(seed: u64, temperature: f32, noise: &mut [f32]) {
    noise.fill(0.0);
    if temperature > 0.0 && !noise.is_empty() {
        normal(generator(seed, Stream::Root).next_u64(), noise);
        for value in noise {
            *value *= temperature;
        }
    }
}

/// Uniform in (0, 1), both ends excluded, with 24 random bits.
fn open_unit(generator: &mut ChaCha8Rng) -> f32 {
    ((generator.next_u32() >> 8) as f32 + 0.5) / (1 << 24) as f32
}

/// How many of `total` tokens stay masked after `pass` of `passes`: the cosine schedule of MaskGIT
/// (Chang et al. 2022, section 3.3), which the pose module uses (MotionBricks, section 5).
pub(super) fn masked_after(total: usize, pass: u32, passes: u32) -> usize {
    if pass >= passes {
        return 0;
    }
    (total as f32 * (FRAC_PI_2 * pass as f32 / passes as f32).cos()) as usize
}

/// Chooses the pose tokens of one character over one or more passes.
#[derive(Debug)]
pub(super) struct PoseSampler {
    generator: ChaCha8Rng,
    temperature: f32,
    passes: u32,
    /// `(confidence, entry, code)` of the entries still masked; kept to reuse its memory.
    candidates: Vec<(f32, usize, usize)>,
}

impl PoseSampler {
    pub(super) fn new(seed: u64, temperature: f32, passes: u32) -> Self {
        Self {
            generator: generator(seed, Stream::Pose),
            temperature,
            passes,
            candidates: Vec::new(),
        }
    }

    /// Commits tokens after pass number `pass` (from 1): all that are masked in the last pass, else
    /// the most confident.
    ///
    /// `tokens` are the character's (token, head) entries without padding, `logits` their `codes`
    /// logits each. An entry equal to `codes` is masked. Answers `false`, with nothing committed,
    /// where a logit is not finite.
    pub(super) fn commit(&mut self, pass: u32, codes: usize, logits: &[f32], tokens: &mut [i64]) -> bool {
        let masked = codes as i64;
        self.candidates.clear();
        for (entry, logits) in logits.chunks_exact(codes).enumerate().take(tokens.len()) {
            if tokens[entry] != masked {
                continue;
            }
            if !all_finite(logits) {
                return false;
            }
            let code = if self.temperature > 0.0 {
                sample(logits, self.temperature, self.generator.random::<f32>())
            } else {
                argmax(logits)
            };
            let confidence = if self.passes > 1 {
                log_probability(logits, code)
            } else {
                0.0
            };
            self.candidates.push((confidence, entry, code));
        }
        let stay = masked_after(tokens.len(), pass, self.passes);
        // Every pass commits something, so that no pass is wasted on rounding.
        let commit = self.candidates.len().saturating_sub(stay).max(1);
        self.candidates
            .sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, entry, code) in self.candidates.iter().take(commit) {
            tokens[entry] = code as i64;
        }
        true
    }
}

/// Index of the largest value, the first of equals; 0 of none.
fn argmax(values: &[f32]) -> usize {
    // As many running maxima as a processor takes at once; which of them has the largest is looked
    // up after.
    const LANES: usize = 8;
    let larger = |a: f32, b: f32| if b > a { b } else { a };
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut tops = [f32::NEG_INFINITY; LANES];
    for chunk in chunks {
        for (top, &value) in tops.iter_mut().zip(chunk) {
            *top = larger(*top, value);
        }
    }
    let top = tops
        .iter()
        .chain(rest)
        .fold(f32::NEG_INFINITY, |top, &value| larger(top, value));
    values.iter().position(|&value| value == top).unwrap_or(0)
}

/// Inverse-CDF sample of `softmax(logits / temperature)` at `unit` in [0, 1).
fn sample(logits: &[f32], temperature: f32, unit: f32) -> usize {
    let top = logits[argmax(logits)];
    let weight = |logit: f32| f64::from((logit - top) / temperature).exp();
    let total: f64 = logits.iter().map(|&logit| weight(logit)).sum();
    let mut left = f64::from(unit) * total;
    for (index, &logit) in logits.iter().enumerate() {
        left -= weight(logit);
        if left < 0.0 {
            return index;
        }
    }
    argmax(logits)
}

fn log_probability(logits: &[f32], code: usize) -> f32 {
    let top = logits[argmax(logits)];
    let total: f32 = logits.iter().map(|logit| (logit - top).exp()).sum();
    logits[code] - top - total.ln()
}

#[cfg(test)]
#[path = "sampling_tests.rs"]
mod tests;

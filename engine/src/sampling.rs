//! Random choices: token counts, root trajectories and pose tokens. Every character has its own
//! generator: a choice depends on the character's seed and logits alone, never on the other rows of
//! the batch.

use std::f32::consts::FRAC_PI_2;

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use troupe_motion::model::all_finite;

use crate::random::normal;

/// Random streams of a character. Each stage has one, so that choices of one stage do not shift
/// those of another.
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

/// Fills `noise` with `temperature` times standard Gumbel noise; all 0 at temperature 0. The index
/// of the largest sum of log-probability and noise is a sample at that temperature.
pub(super) fn fill_count_noise(seed: u64, temperature: f32, noise: &mut [f32]) {
    noise.fill(0.0);
    if temperature > 0.0 {
        let mut generator = generator(seed, Stream::Count);
        for value in noise {
            *value = temperature * -(-open_unit(&mut generator).ln()).ln();
        }
    }
}

/// Fills `noise` with `temperature` times standard normal numbers, which choose a root trajectory;
/// all 0 at temperature 0.
pub(super) fn fill_root_noise(seed: u64, temperature: f32, noise: &mut [f32]) {
    noise.fill(0.0);
    if temperature > 0.0 && !noise.is_empty() {
        normal(generator(seed, Stream::Root).next_u64(), noise);
        for value in noise {
            *value *= temperature;
        }
    }
}

/// A uniform number between 0 and 1, both excluded, with 24 random bits.
fn open_unit(generator: &mut ChaCha8Rng) -> f32 {
    ((generator.next_u32() >> 8) as f32 + 0.5) / (1 << 24) as f32
}

/// How many of `total` tokens remain masked after `pass` of `passes`: the cosine schedule of
/// MaskGIT (Chang et al. 2022, section 3.3), which the pose module uses (MotionBricks, section 5).
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
    /// `(confidence, entry, code)` of the entries that are still masked; a field so that its memory
    /// is reused.
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

    /// Commits tokens after pass number `pass` (from 1): the most confident ones, and all that
    /// remain in the last pass.
    ///
    /// `tokens` are the character's (token, head) entries without padding. `logits` has `codes`
    /// numbers for each entry. An entry equal to `codes` is masked. Returns `false` and commits
    /// nothing if a logit is not finite.
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
        // Every pass commits at least one entry, so that rounding does not waste a pass.
        let commit = self.candidates.len().saturating_sub(stay).max(1);
        self.candidates
            .sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, entry, code) in self.candidates.iter().take(commit) {
            tokens[entry] = code as i64;
        }
        true
    }
}

/// Index of the largest value, the first of equal ones; 0 for an empty slice.
fn argmax(values: &[f32]) -> usize {
    // As many running maxima as a processor computes at once. The index is searched afterwards.
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

/// A sample of `softmax(logits / temperature)` by the inverse of its distribution function, at
/// `unit` in [0, 1).
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

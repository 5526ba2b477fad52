//! The choice of a token. It depends on logits, seed and the token's place in the reply alone,
//! never on other sequences.

use std::cmp::Ordering;

use super::reply::Allowed;
use crate::random::step64;

/// Tokens that repetition looks back at.
const RECENT: usize = 8;
/// Candidates that are sorted before more are looked at.
const SORTED_AT_ONCE: usize = 64;

/// How tokens are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// 0 for the most likely token, above 0 to sample.
    pub temperature: f32,
    /// How many of the likeliest may be chosen; 0 for all.
    pub top_k: usize,
    /// The likeliest that may be chosen are together at least so likely; 1 for all.
    pub top_p: f32,
    /// What logits of codes among the last tokens are weakened by; 1 for nothing.
    pub repetition: f32,
}

/// Chooses tokens; keeps its memory between choices.
#[derive(Debug, Default)]
pub(super) struct Sampler {
    /// Logit and id of what may be chosen.
    candidates: Vec<(f32, u32)>,
}

impl Sampler {
    /// The next token of a reply whose tokens so far are `reply`, from the logits of the whole
    /// vocabulary. `index` is its place among all tokens that are drawn with the seed. None where a
    /// logit is not finite, or nothing is allowed.
    pub(super) fn choose(
        &mut self,
        logits: &[f32],
        allowed: &Allowed,
        reply: &[u32],
        sampling: &Sampling,
        (seed, index): (u64, u64),
    ) -> Option<u32> {
        let Allowed { codes, mark } = allowed;
        let candidates = &mut self.candidates;
        candidates.clear();
        for id in allowed.ids() {
            let logit = *logits.get(id as usize).filter(|logit| logit.is_finite())?;
            candidates.push((logit, id));
        }
        if sampling.repetition != 1.0 {
            let recent = &reply[reply.len().saturating_sub(RECENT)..];
            for (n, id) in recent.iter().enumerate() {
                if codes.contains(id) && !recent[..n].contains(id) {
                    let at = usize::from(mark.is_some()) + (id - codes.start) as usize;
                    let logit = &mut candidates[at].0;
                    *logit = weakened(*logit, sampling.repetition);
                }
            }
        }
        match sampling.temperature > 0.0 {
            true => self.draw(sampling, unit(seed, index)),
            false => self.likeliest(),
        }
    }

    /// The largest logit, the first of equals.
    fn likeliest(&self) -> Option<u32> {
        let mut best = *self.candidates.first()?;
        for &candidate in &self.candidates {
            if candidate.0 > best.0 {
                best = candidate;
            }
        }
        Some(best.1)
    }

    /// Cuts to the likeliest by number, then by probability, and draws at `unit` in [0, 1).
    fn draw(&mut self, sampling: &Sampling, unit: f64) -> Option<u32> {
        let candidates = &mut self.candidates;
        if (1..candidates.len()).contains(&sampling.top_k) {
            candidates.select_nth_unstable_by(sampling.top_k - 1, by_likelihood);
            candidates.truncate(sampling.top_k);
        }
        let top = candidates.iter().copied().min_by(by_likelihood)?.0;
        let weight = |logit: f32| f64::from((logit - top) / sampling.temperature).exp();
        let all: f64 = candidates.iter().map(|&(logit, _)| weight(logit)).sum();
        let drawn_from = match sampling.top_p < 1.0 {
            true => self.likeliest_until(f64::from(sampling.top_p) * all, weight).1,
            false => all,
        };
        let (last, _) = self.likeliest_until(unit * drawn_from, weight);
        Some(self.candidates.get(last)?.1)
    }

    /// Goes through the candidates, the likeliest first, until their weights are together `wanted`.
    /// Gives the index of the last one, behind which nothing is in order, and the sum.
    ///
    /// A few are nearly all of it, so that no more than those are sorted.
    fn likeliest_until(&mut self, wanted: f64, weight: impl Fn(f32) -> f64) -> (usize, f64) {
        let candidates = &mut self.candidates;
        let mut sum = 0.0;
        let mut sorted = 0;
        while sorted < candidates.len() {
            let rest = &mut candidates[sorted..];
            let more = SORTED_AT_ONCE.max(sorted).min(rest.len());
            if more < rest.len() {
                rest.select_nth_unstable_by(more, by_likelihood);
            }
            rest[..more].sort_unstable_by(by_likelihood);
            for (index, &(logit, _)) in rest[..more].iter().enumerate() {
                sum += weight(logit);
                if sum >= wanted {
                    return (sorted + index, sum);
                }
            }
            sorted += more;
        }
        (candidates.len().saturating_sub(1), sum)
    }
}

/// Descending by logit; ids part equals, so that the order is always the same.
fn by_likelihood(a: &(f32, u32), b: &(f32, u32)) -> Ordering {
    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
}

fn weakened(logit: f32, repetition: f32) -> f32 {
    match logit > 0.0 {
        true => logit / repetition,
        false => logit * repetition,
    }
}

/// A number in [0, 1) of seed and index: 53 bits of splitmix64's finaliser, twice.
fn unit(seed: u64, index: u64) -> f64 {
    let bits = step64(step64(seed, 0), index);
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

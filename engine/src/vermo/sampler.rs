//! Chooses tokens. A choice depends on logits, seed and the token's index in the reply alone, never
//! on other sequences.

use std::cmp::Ordering;

use super::reply::Allowed;
use crate::random::step64;

/// Number of latest tokens that the penalty for repetition looks at.
const RECENT: usize = 8;
/// Number of candidates that are sorted at a time.
const SORTED_AT_ONCE: usize = 64;

/// How tokens are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// 0 takes the likeliest token, above 0 samples.
    pub temperature: f32,
    /// Only the `top_k` likeliest tokens may be chosen; 0 allows all.
    pub top_k: usize,
    /// Only the likeliest tokens, up to this sum of probabilities, may be chosen; 1 allows all.
    pub top_p: f32,
    /// Divisor of the logits of codes among the latest tokens; 1 changes nothing.
    pub repetition: f32,
}

/// The logits of the whole vocabulary for one token.
#[derive(Debug, Clone, Copy)]
pub(super) struct Logits<'a> {
    /// Those of the reply's own message.
    pub(super) own: &'a [f32],
    /// Those of its guides, with their weights. The own logits have the rest of the weight.
    pub(super) guides: &'a [(&'a [f32], f32)],
}

impl Logits<'_> {
    /// The logit of a token. None if it is not finite.
    fn of(&self, id: u32) -> Option<f32> {
        let own = *self.own.get(id as usize)?;
        let mut logit = own;
        for (guide, weight) in self.guides {
            logit += weight * (guide.get(id as usize)? - own);
        }
        logit.is_finite().then_some(logit)
    }
}

/// Chooses tokens. It reuses its memory between choices.
#[derive(Debug, Default)]
pub(super) struct Sampler {
    /// Logit and id of the tokens that may be chosen.
    candidates: Vec<(f32, u32)>,
}

impl Sampler {
    /// The next token after `reply`. `index` counts all tokens that were drawn with the seed. None
    /// if a logit is not finite, or no token is allowed.
    pub(super) fn choose(
        &mut self,
        logits: Logits<'_>,
        allowed: &Allowed,
        reply: &[u32],
        sampling: &Sampling,
        (seed, index): (u64, u64),
    ) -> Option<u32> {
        let Allowed { codes, mark } = allowed;
        let candidates = &mut self.candidates;
        candidates.clear();
        for id in allowed.ids() {
            candidates.push((logits.of(id)?, id));
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

    /// Id of the largest logit, the first of equal ones.
    fn likeliest(&self) -> Option<u32> {
        let mut best = *self.candidates.first()?;
        for &candidate in &self.candidates {
            if candidate.0 > best.0 {
                best = candidate;
            }
        }
        Some(best.1)
    }

    /// Restricts the candidates to `top_k`, then to `top_p`, and draws one at `unit` in [0, 1).
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

    /// Sums the candidates' weights, the likeliest first, until the sum is `wanted`. Returns the
    /// index of the last candidate and the sum. Candidates behind that index are not sorted.
    ///
    /// A few candidates usually have almost the whole sum, so only a few are sorted.
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

/// Descending by logit. Ids decide between equal logits, so that the order is always the same.
fn by_likelihood(a: &(f32, u32), b: &(f32, u32)) -> Ordering {
    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
}

fn weakened(logit: f32, repetition: f32) -> f32 {
    match logit > 0.0 {
        true => logit / repetition,
        false => logit * repetition,
    }
}

/// A number in [0, 1) from seed and index: 53 bits of splitmix64's finaliser, applied twice.
fn unit(seed: u64, index: u64) -> f64 {
    let bits = step64(step64(seed, 0), index);
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

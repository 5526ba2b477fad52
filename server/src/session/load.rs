//! How long a plan takes at the moment, from what waits and how fast the networks were lately.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use crate::batch::Served;

/// Time of a plan before any was made.
const FIRST_GUESS: Duration = Duration::from_millis(5);
/// A new measurement's weight is one part of this many.
const SMOOTHING: u64 = 16;
/// How many times its turn in the queue a plan may take: what comes after it and travels in its batch holds it up as well.
const MARGIN: u64 = 2;

/// The plans of one pack that are under way.
#[derive(Debug)]
pub struct PlanLoad {
    waiting: AtomicUsize,
    /// Time of the networks for one plan of a batch, smoothed, microseconds.
    plan_us: AtomicU64,
}

impl Default for PlanLoad {
    fn default() -> Self {
        Self {
            waiting: AtomicUsize::new(0),
            plan_us: AtomicU64::new(FIRST_GUESS.as_micros() as u64),
        }
    }
}

impl PlanLoad {
    /// A plan is asked for.
    pub fn asked(&self) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
    }

    /// It has come, or will not.
    pub fn answered(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    /// Notes how long the batch of a plan took.
    pub fn measured(&self, served: &Served) {
        let batch = (served.assemble + served.inference + served.scatter).as_micros() as u64;
        let plan = batch / served.batch_size.max(1) as u64;
        // Two at once may lose one of them; it is an estimate.
        let before = self.plan_us.load(Ordering::Relaxed);
        let after = (before * (SMOOTHING - 1) + plan) / SMOOTHING;
        self.plan_us.store(after, Ordering::Relaxed);
    }

    /// Frames, rounded up, that a plan asked for now is expected to take.
    pub fn expected_frames(&self, fps: f32) -> u32 {
        let waiting = self.waiting.load(Ordering::Relaxed) as u64 + 1;
        let us = waiting * self.plan_us.load(Ordering::Relaxed) * MARGIN;
        (us as f32 * 1e-6 * fps).ceil() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_and_how_fast_it_was_make_the_expectation() {
        let load = PlanLoad::default();
        assert_eq!(load.expected_frames(30.0), 1);
        for _ in 0..24 {
            load.asked();
        }
        // Twice 25 plans of 5 ms are 250 ms.
        assert_eq!(load.expected_frames(30.0), 8);
        let served = Served {
            inference: Duration::from_millis(160),
            batch_size: 16,
            ..Served::default()
        };
        for _ in 0..200 {
            load.measured(&served);
        }
        // The networks turn out to take 10 ms a plan.
        assert!((15..=16).contains(&load.expected_frames(30.0)));
        for _ in 0..24 {
            load.answered();
        }
        assert_eq!(load.expected_frames(30.0), 1);
    }
}

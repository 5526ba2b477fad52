//! When requests arrive in an open loop.
//!
//! A process first generates arrivals at a constant rate of 1. Then they are stretched along the
//! [`Stages`]: arrival number `n` comes when the integral of the rate reaches `n`. So every process
//! follows ramps, and the same seed gives the same arrivals.

mod stages;

use std::collections::VecDeque;
use std::time::Duration;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Exp1};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use stages::{LoadStage, Stages, StagesError};

/// The distribution of arrivals over time, at a given rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Process {
    /// At equal intervals.
    Constant,
    /// Independent of each other, like those of many users: intervals are exponential.
    Poisson,
    /// Many at one moment, then none until the next burst. The rate is the mean.
    Bursts {
        /// Number of arrivals in a burst, at least 1.
        size: u32,
    },
    /// Bursts at equal intervals. A burst has all arrivals that became due since the one before.
    Periodic {
        /// Seconds from burst to burst.
        period_s: f64,
    },
}

/// The arrivals of an open loop in order, as times from the start.
#[derive(Debug, Clone)]
pub struct Schedule {
    process: Process,
    stages: Stages,
    random: ChaCha8Rng,
    /// Integral of the level so far.
    sum: f64,
    given: u64,
    /// Remaining arrivals of the current burst.
    ready: VecDeque<Duration>,
    periods: u64,
}

impl Schedule {
    /// Makes the arrivals of a process along stages. The level of a stage is in requests/s.
    pub fn new(process: Process, stages: Stages, seed: u64) -> Self {
        Self {
            process,
            stages,
            random: ChaCha8Rng::seed_from_u64(seed),
            sum: 0.0,
            given: 0,
            ready: VecDeque::new(),
            periods: 0,
        }
    }

    /// The arrivals of process number `nth` of `of`. Together the processes send each arrival once.
    pub fn share(self, nth: u32, of: u32) -> impl Iterator<Item = (u64, Duration)> + Send {
        let (nth, of) = (u64::from(nth), u64::from(of.max(1)));
        (0_u64..).zip(self).filter(move |(number, _)| number % of == nth)
    }

    fn at_sum(&self, sum: f64) -> Option<Duration> {
        self.stages.time_of_sum(sum).map(Duration::from_secs_f64)
    }

    /// All arrivals that are due at the end of a period, at the same time. Periods without one are
    /// skipped.
    fn period(&mut self, period_s: f64) -> Option<Duration> {
        while self.ready.is_empty() {
            self.periods += 1;
            let at = self.periods as f64 * period_s;
            if at > self.stages.seconds() {
                return None;
            }
            let due = (self.stages.sum_until(at) + 1e-9) as u64;
            let at = Duration::from_secs_f64(at);
            self.ready.extend((self.given..due).map(|_| at));
            self.given = due.max(self.given);
        }
        self.ready.pop_front()
    }
}

impl Iterator for Schedule {
    type Item = Duration;

    fn next(&mut self) -> Option<Duration> {
        match self.process {
            Process::Constant => {
                let at = self.at_sum(self.given as f64)?;
                self.given += 1;
                Some(at)
            }
            Process::Poisson => {
                let step: f64 = Exp1.sample(&mut self.random);
                self.sum += step;
                self.at_sum(self.sum)
            }
            Process::Bursts { size } => {
                if self.ready.is_empty() {
                    let at = self.at_sum(self.given as f64)?;
                    self.ready.extend((0..size.max(1)).map(|_| at));
                    self.given += u64::from(size.max(1));
                }
                self.ready.pop_front()
            }
            Process::Periodic { period_s } => self.period(period_s),
        }
    }
}

#[cfg(test)]
mod tests;

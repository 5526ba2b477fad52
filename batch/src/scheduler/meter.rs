//! Measures the speed of the workers and the rate at which calls leave the queue. All estimates of
//! the scheduler come from here.

use std::time::{Duration, Instant};

/// Assumed time of a unit of work on a worker before any measurement: about 5 ms for a character of
/// 64 frames. It has the weight of one measured unit.
const FIRST_GUESS_S: f64 = 25e-6;
/// Factor on the weight of older worker measurements after each step that finishes a character.
const WORKER_MEMORY: f64 = 0.9;
/// Time, in seconds, after which older measurements of the queue have lost two thirds of their
/// weight.
const QUEUE_MEMORY_S: f64 = 0.5;
/// Weight, in seconds, of the first estimate when calls begin to wait: that they leave at the
/// workers' full speed.
const QUEUE_PRIOR_S: f64 = 0.1;
/// Longest estimate of a wait. If hardly any call leaves the queue, the estimate would be infinite.
const LONGEST_WAIT_S: f64 = 3600.0;

/// Two measures, in units of [work](crate::Order::work).
///
/// - **Workers**: a worker's mean time for a unit, over the latest steps. It gives the work that a
///   worker does in a given time.
/// - **Queue**: work of calls that left the queue per second, over the latest time with a backlog
///   of calls. It accounts for the plans that are served in between, and gives the expected
///   wait of a call (Little's law).
#[derive(Debug)]
pub(super) struct Meter {
    workers: usize,
    worker_time_s: f64,
    worker_units: f64,
    /// Time of steps since a step last finished a character. The next finished characters pay for
    /// all of it, because a character may need many steps.
    open_s: f64,
    queue_time_s: f64,
    queue_units: f64,
    /// If calls wait: the last time at which the calls that left were counted.
    backlog_since: Option<Instant>,
}

impl Meter {
    pub(super) fn new(workers: usize) -> Self {
        Self {
            workers,
            worker_time_s: FIRST_GUESS_S,
            worker_units: 1.0,
            open_s: 0.0,
            queue_time_s: 0.0,
            queue_units: 0.0,
            backlog_since: None,
        }
    }

    /// Records a step: its time, and the work of the characters that it finished.
    pub(super) fn stepped(&mut self, took: Duration, work: u64) {
        self.open_s += took.as_secs_f64();
        if work > 0 {
            self.worker_time_s = self.worker_time_s * WORKER_MEMORY + self.open_s;
            self.worker_units = self.worker_units * WORKER_MEMORY + work as f64;
            self.open_s = 0.0;
        }
    }

    /// A worker is lost.
    pub(super) fn lost(&mut self) {
        self.workers = self.workers.saturating_sub(1);
    }

    /// Records the work of calls that have left the queue since the last time. `some_wait` is
    /// whether others still wait.
    pub(super) fn left(&mut self, now: Instant, work: u64, some_wait: bool) {
        match self.backlog_since {
            Some(since) => {
                let passed = now.saturating_duration_since(since).as_secs_f64();
                let memory = (-passed / QUEUE_MEMORY_S).exp();
                self.queue_time_s = self.queue_time_s * memory + passed;
                self.queue_units = self.queue_units * memory + work as f64;
            }
            None => {
                self.queue_time_s = QUEUE_PRIOR_S;
                self.queue_units = QUEUE_PRIOR_S * self.workers.max(1) as f64 / self.unit_s();
            }
        }
        self.backlog_since = some_wait.then_some(now);
    }

    /// Expected time until so much work of calls has left the queue.
    pub(super) fn wait(&self, work: u64) -> Duration {
        if work == 0 {
            return Duration::ZERO;
        }
        let unit_s = match self.queue_units > 0.0 {
            true => self.queue_time_s / self.queue_units,
            false => self.unit_s() / self.workers.max(1) as f64,
        };
        Duration::from_secs_f64((work as f64 * unit_s).min(LONGEST_WAIT_S))
    }

    /// Expected work that a worker does in `time`.
    pub(super) fn within(&self, time: Duration) -> u64 {
        (time.as_secs_f64() / self.unit_s()) as u64
    }

    /// A worker's expected time for so much work.
    pub(super) fn time_of(&self, work: u64) -> Duration {
        Duration::from_secs_f64((work as f64 * self.unit_s()).min(LONGEST_WAIT_S))
    }

    fn unit_s(&self) -> f64 {
        (self.worker_time_s / self.worker_units).max(1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn workers_are_measured_by_what_their_steps_finish() {
        let mut meter = Meter::new(2);
        assert_eq!(meter.within(MS * 51), 2039);
        for _ in 0..100 {
            meter.stepped(MS * 20, 10);
        }
        assert!((24..=25).contains(&meter.within(MS * 50)));
        // Ten characters that need four steps of 5 ms each.
        for step in 0..400 {
            meter.stepped(MS * 5, if step % 4 == 3 { 10 } else { 0 });
        }
        assert!((24..=25).contains(&meter.within(MS * 50)));
    }

    #[test]
    fn a_wait_follows_the_rate_at_which_calls_leave() {
        let start = Instant::now();
        let mut meter = Meter::new(2);
        assert_eq!(meter.wait(0), Duration::ZERO);
        // Nothing known: two workers at 25 µs a unit.
        meter.left(start, 0, true);
        assert_eq!(meter.wait(20_000).as_millis(), 250);
        // Live plans take most of the time: 4 characters of calls in 100 ms.
        for take in 1..=50 {
            meter.left(start + MS * 100 * take, 4, true);
        }
        assert!((2400..2600).contains(&meter.wait(100).as_millis()));
        // None leave any more.
        meter.left(start + Duration::from_secs(60), 0, true);
        assert_eq!(meter.wait(1000), Duration::from_secs(3600));
        // All are gone, and it starts again.
        meter.left(start + Duration::from_secs(61), 100, false);
        meter.left(start + Duration::from_secs(90), 0, true);
        assert_eq!(meter.wait(20_000).as_millis(), 250);
    }
}

//! The load that the plans of a pack put on its engine, and what follows from it: how long a plan
//! takes, and the pressure on its characters.

use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, TryLockError};
use std::time::{Duration, Instant};

use super::budget::{Controller, Reading};

/// Assumed time of a plan before the first measurement.
const FIRST_GUESS: Duration = Duration::from_millis(5);
/// A new measurement has a weight of 1 / this.
const SMOOTHING: u64 = 16;
/// A plan may take its turn in the queue times this: plans that come after it and share its batch
/// delay it too.
const MARGIN: u64 = 2;
/// Fastest change of the lead, in seconds a second. While the lead grows, plans are asked for that
/// much sooner, which makes more of them.
const LEAD_SPEED: f32 = 0.1;
/// Time between two readings of the controller.
const READING: Duration = Duration::from_millis(100);

/// The plans of one pack that are under way. Nothing here blocks: counters are atomic, and only the
/// occasional reading takes a lock, which is skipped if it is taken.
#[derive(Debug)]
pub struct PlanLoad {
    waiting: AtomicUsize,
    /// Time of a worker for one plan of a batch, smoothed, microseconds.
    plan_us: AtomicU64,
    /// Plans answered since the last reading, their time from request to answer, and the time that
    /// workers took for them.
    came: AtomicU64,
    delays_us: AtomicU64,
    work_us: AtomicU64,
    /// Bits of two `f32`: the pressure, and the lead in seconds.
    pressure: AtomicU32,
    lead_s: AtomicU32,
    readings: Mutex<Readings>,
}

#[derive(Debug, Default)]
struct Readings {
    controller: Controller,
    lead_s: f32,
    last: Option<Instant>,
}

impl Default for PlanLoad {
    fn default() -> Self {
        Self {
            waiting: AtomicUsize::new(0),
            plan_us: AtomicU64::new(FIRST_GUESS.as_micros() as u64),
            came: AtomicU64::new(0),
            delays_us: AtomicU64::new(0),
            work_us: AtomicU64::new(0),
            pressure: AtomicU32::new(0.0f32.to_bits()),
            lead_s: AtomicU32::new(0.0f32.to_bits()),
            readings: Mutex::default(),
        }
    }
}

impl PlanLoad {
    /// Notes that a plan is asked for.
    pub fn asked(&self) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
    }

    /// Notes that a plan has arrived, or will not.
    pub fn answered(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }

    /// Plans that were asked for and have not arrived.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Notes how long a plan took from request to answer, and how much of a worker's time.
    pub fn measured(&self, delay: Duration, work: Duration) {
        let plan = work.as_micros() as u64;
        // Of two concurrent measurements one may be lost: this is an estimate.
        let before = self.plan_us.load(Ordering::Relaxed);
        let after = (before * (SMOOTHING - 1) + plan) / SMOOTHING;
        self.plan_us.store(after, Ordering::Relaxed);
        self.came.fetch_add(1, Ordering::Relaxed);
        self.delays_us
            .fetch_add(delay.as_micros() as u64, Ordering::Relaxed);
        self.work_us.fetch_add(plan, Ordering::Relaxed);
    }

    /// Time until a plan asked for now has been made, with `workers` workers.
    fn turn(&self, workers: usize) -> Duration {
        let waiting = self.waiting.load(Ordering::Relaxed) as u64 + 1;
        let us = waiting * self.plan_us.load(Ordering::Relaxed);
        Duration::from_micros(us / workers.max(1) as u64)
    }

    /// Frames, rounded up, that a plan asked for now is expected to take.
    pub fn expected_frames(&self, workers: usize, fps: f32) -> u32 {
        let turn = self.turn(workers) * MARGIN as u32;
        (turn.as_secs_f32() * fps).ceil() as u32
    }

    /// Has the controller read the load at `now`, unless the last reading is too recent. Answers
    /// the pressure if it did.
    pub fn read(&self, now: Instant, workers: usize) -> Option<f32> {
        let mut readings = match self.readings.try_lock() {
            Ok(readings) => readings,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        let last = *readings.last.get_or_insert(now);
        let passed = now.saturating_duration_since(last);
        if passed < READING {
            return None;
        }
        readings.last = Some(now);
        let came = self.came.swap(0, Ordering::Relaxed);
        let delays_us = self.delays_us.swap(0, Ordering::Relaxed);
        let work_us = self.work_us.swap(0, Ordering::Relaxed);
        let took_s = delays_us as f32 / came.max(1) as f32 / 1e6;
        let reading = Reading {
            delay_s: took_s.max(self.turn(workers).as_secs_f32()),
            share: work_us as f32 / 1e6 / (passed.as_secs_f32() * workers.max(1) as f32),
        };
        readings.controller.observe(passed.as_secs_f32(), reading);
        let target = readings.controller.lead_s();
        let most = LEAD_SPEED * passed.as_secs_f32();
        readings.lead_s += (target - readings.lead_s).clamp(-most, most);
        self.lead_s.store(readings.lead_s.to_bits(), Ordering::Relaxed);
        let pressure = readings.controller.pressure();
        self.pressure.store(pressure.to_bits(), Ordering::Relaxed);
        Some(pressure)
    }

    /// Frames by which plans should be asked for ahead: as long as they recently took.
    pub fn lead_frames(&self, fps: f32) -> u32 {
        (f32::from_bits(self.lead_s.load(Ordering::Relaxed)) * fps).ceil() as u32
    }

    /// The pressure on the pack's characters, 0 to 2: see [`super::budget`].
    pub fn pressure(&self) -> f32 {
        f32::from_bits(self.pressure.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan_of(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_expectation_follows_queue_and_speed() {
        let load = PlanLoad::default();
        assert_eq!(load.expected_frames(1, 30.0), 1);
        for _ in 0..24 {
            load.asked();
        }
        // Twice 25 plans of 5 ms are 250 ms, and half of that with two workers.
        assert_eq!(load.expected_frames(1, 30.0), 8);
        assert_eq!(load.expected_frames(2, 30.0), 4);
        for _ in 0..200 {
            load.measured(Duration::ZERO, plan_of(10));
        }
        // The networks turn out to take 10 ms a plan.
        assert!((15..=16).contains(&load.expected_frames(1, 30.0)));
        for _ in 0..24 {
            load.answered();
        }
        assert_eq!(load.expected_frames(1, 30.0), 1);
    }

    #[test]
    fn only_slow_plans_that_fill_the_engine_are_pressure() {
        for (plans, pressed) in [(20, true), (2, false)] {
            let load = PlanLoad::default();
            let start = Instant::now();
            assert_eq!(load.read(start, 2), None);
            for step in 1..40u32 {
                // 10 ms of a worker for each.
                for _ in 0..plans {
                    load.measured(Duration::from_millis(200), plan_of(10));
                }
                let now = start + READING * step;
                assert!(load.read(now, 2).is_some());
                assert_eq!(load.read(now + READING / 2, 2), None, "not yet");
            }
            assert_eq!(load.pressure() > 0.2, pressed, "{}", load.pressure());
        }
    }
}

//! The load that the plans of a pack put on its engine, and what follows from it: how long a plan
//! takes, and the pressure on the characters of each client.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, TryLockError, Weak};
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

/// Clients of a pack from which those without plans and streams are forgotten.
const MANY_CLIENTS: usize = 64;

/// The plans of one pack that are under way, of all clients.
#[derive(Debug)]
pub struct PlanLoad {
    waiting: AtomicUsize,
    /// Clients with a plan under way.
    waiting_clients: AtomicUsize,
    /// Time of a worker for one plan of a batch, smoothed, microseconds.
    plan_us: AtomicU64,
    /// Time that workers took for plans since the last reading.
    work_us: AtomicU64,
    /// Bits of an `f32`: the share of the engine's time that plans took in the last reading.
    share: AtomicU32,
    last: Mutex<Option<Instant>>,
    clients: Mutex<Clients>,
}

#[derive(Debug, Default)]
struct Clients {
    by_number: HashMap<u64, Weak<ClientLoad>>,
    /// Number of clients at which those that are gone are forgotten next.
    many: usize,
}

impl Default for PlanLoad {
    fn default() -> Self {
        Self {
            waiting: AtomicUsize::new(0),
            waiting_clients: AtomicUsize::new(0),
            plan_us: AtomicU64::new(FIRST_GUESS.as_micros() as u64),
            work_us: AtomicU64::new(0),
            share: AtomicU32::new(0.0f32.to_bits()),
            last: Mutex::default(),
            clients: Mutex::default(),
        }
    }
}

impl PlanLoad {
    /// The load of a client, by the number that the queue gives it.
    pub fn of(self: &Arc<Self>, client: u64) -> Arc<ClientLoad> {
        let mut clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = clients.by_number.get(&client).and_then(Weak::upgrade) {
            return known;
        }
        if clients.by_number.len() >= clients.many.max(MANY_CLIENTS) {
            clients.by_number.retain(|_, load| load.strong_count() > 0);
            clients.many = 2 * clients.by_number.len();
        }
        let new = Arc::new(ClientLoad::new(self.clone()));
        clients.by_number.insert(client, Arc::downgrade(&new));
        new
    }

    /// Plans that were asked for and have not arrived.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Measures at `now` how much of the engine plans take, unless the last reading is too recent.
    /// Answers the highest pressure of a client if it did.
    pub fn read(&self, now: Instant, workers: usize) -> Option<f32> {
        let passed = passed(&mut *self.last.try_lock().ok()?, now)?;
        let work_us = self.work_us.swap(0, Ordering::Relaxed);
        let share = work_us as f32 / 1e6 / (passed.as_secs_f32() * workers.max(1) as f32);
        self.share.store(share.to_bits(), Ordering::Relaxed);
        let clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        let loads = clients.by_number.values().filter_map(Weak::upgrade);
        Some(loads.map(|load| load.pressure()).fold(0.0, f32::max))
    }
}

/// Time since the last reading, which is now; none if it is too recent, or this is the first.
fn passed(last: &mut Option<Instant>, now: Instant) -> Option<Duration> {
    let before = *last.get_or_insert(now);
    let passed = now.saturating_duration_since(before);
    if passed < READING {
        return None;
    }
    *last = Some(now);
    Some(passed)
}

/// The plans of one client that are under way in a pack. The pressure of its characters follows
/// from how long its own plans take. The queue shares the engine between clients, so a client with
/// many characters puts itself under pressure, not others.
#[derive(Debug)]
pub struct ClientLoad {
    pack: Arc<PlanLoad>,
    waiting: AtomicUsize,
    /// Plans answered since the last reading, and their time from request to answer.
    came: AtomicU64,
    delays_us: AtomicU64,
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

impl ClientLoad {
    fn new(pack: Arc<PlanLoad>) -> Self {
        Self {
            pack,
            waiting: AtomicUsize::new(0),
            came: AtomicU64::new(0),
            delays_us: AtomicU64::new(0),
            pressure: AtomicU32::new(0.0f32.to_bits()),
            lead_s: AtomicU32::new(0.0f32.to_bits()),
            readings: Mutex::default(),
        }
    }

    /// Notes that a plan is asked for.
    pub fn asked(&self) {
        self.pack.waiting.fetch_add(1, Ordering::Relaxed);
        if self.waiting.fetch_add(1, Ordering::Relaxed) == 0 {
            self.pack.waiting_clients.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Notes that a plan has arrived, or will not.
    pub fn answered(&self) {
        self.pack.waiting.fetch_sub(1, Ordering::Relaxed);
        if self.waiting.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.pack.waiting_clients.fetch_sub(1, Ordering::Relaxed);
        }
    }

    /// Notes how long a plan took from request to answer, and how much of a worker's time.
    pub fn measured(&self, delay: Duration, work: Duration) {
        let plan = work.as_micros() as u64;
        // Of two concurrent measurements one may be lost: this is an estimate.
        let before = self.pack.plan_us.load(Ordering::Relaxed);
        let after = (before * (SMOOTHING - 1) + plan) / SMOOTHING;
        self.pack.plan_us.store(after, Ordering::Relaxed);
        self.pack.work_us.fetch_add(plan, Ordering::Relaxed);
        self.came.fetch_add(1, Ordering::Relaxed);
        self.delays_us
            .fetch_add(delay.as_micros() as u64, Ordering::Relaxed);
    }

    /// Time until a plan asked for now has been made, with `workers` workers. Of each other client
    /// as many plans go before it as this one has under way.
    fn turn(&self, workers: usize) -> Duration {
        let [own, all] =
            [&self.waiting, &self.pack.waiting].map(|count| count.load(Ordering::Relaxed) as u64);
        let others = (self.pack.waiting_clients.load(Ordering::Relaxed) as u64).max(1);
        let before = (own * others).min(all).max(own);
        let us = (before + 1) * self.pack.plan_us.load(Ordering::Relaxed);
        Duration::from_micros(us / workers.max(1) as u64)
    }

    /// Frames, rounded up, that a plan asked for now is expected to take.
    pub fn expected_frames(&self, workers: usize, fps: f32) -> u32 {
        let turn = self.turn(workers) * MARGIN as u32;
        (turn.as_secs_f32() * fps).ceil() as u32
    }

    /// Has the controller read the load at `now`, unless the last reading is too recent.
    pub fn read(&self, now: Instant, workers: usize) {
        let mut readings = match self.readings.try_lock() {
            Ok(readings) => readings,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        let Some(passed) = passed(&mut readings.last, now) else {
            return;
        };
        let came = self.came.swap(0, Ordering::Relaxed);
        let delays_us = self.delays_us.swap(0, Ordering::Relaxed);
        let took_s = delays_us as f32 / came.max(1) as f32 / 1e6;
        let reading = Reading {
            delay_s: took_s.max(self.turn(workers).as_secs_f32()),
            share: f32::from_bits(self.pack.share.load(Ordering::Relaxed)),
        };
        readings.controller.observe(passed.as_secs_f32(), reading);
        let target = readings.controller.lead_s();
        let most = LEAD_SPEED * passed.as_secs_f32();
        readings.lead_s += (target - readings.lead_s).clamp(-most, most);
        self.lead_s.store(readings.lead_s.to_bits(), Ordering::Relaxed);
        let pressure = readings.controller.pressure();
        self.pressure.store(pressure.to_bits(), Ordering::Relaxed);
    }

    /// Frames by which plans should be asked for ahead: as long as they recently took.
    pub fn lead_frames(&self, fps: f32) -> u32 {
        (f32::from_bits(self.lead_s.load(Ordering::Relaxed)) * fps).ceil() as u32
    }

    /// The pressure on the client's characters, 0 to 2: see [`super::budget`].
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
        let pack = Arc::new(PlanLoad::default());
        let load = pack.of(1);
        assert_eq!(load.expected_frames(1, 30.0), 1);
        for _ in 0..24 {
            load.asked();
        }
        // Twice 25 plans of 5 ms are 250 ms, and half of that with two workers.
        assert_eq!(load.expected_frames(1, 30.0), 8);
        assert_eq!(load.expected_frames(2, 30.0), 4);
        // Another client with one plan waits for one of these.
        let other = pack.of(2);
        other.asked();
        assert_eq!(other.expected_frames(1, 30.0), 1);
        other.answered();
        for _ in 0..200 {
            load.measured(Duration::ZERO, plan_of(10));
        }
        // The networks turn out to take 10 ms a plan.
        assert!((15..=16).contains(&load.expected_frames(1, 30.0)));
        for _ in 0..24 {
            load.answered();
        }
        assert_eq!((load.expected_frames(1, 30.0), pack.waiting()), (1, 0));
    }

    #[test]
    fn only_slow_plans_that_fill_the_engine_are_pressure() {
        for (plans, delay_ms, pressed) in [(20, 200, true), (2, 200, false), (20, 40, false)] {
            let pack = Arc::new(PlanLoad::default());
            // A crowd whose plans are slow and fill the engine, and the client in question.
            let (crowd, load) = (pack.of(1), pack.of(2));
            let start = Instant::now();
            assert_eq!(pack.read(start, 2), None);
            for step in 1..40u32 {
                // 10 ms of a worker for each.
                for _ in 0..plans {
                    crowd.measured(plan_of(200), plan_of(10));
                }
                load.measured(plan_of(delay_ms), plan_of(10));
                let now = start + READING * step;
                let highest = pack.read(now, 2);
                assert_eq!(highest, Some(crowd.pressure().max(load.pressure())));
                assert_eq!(pack.read(now + READING / 2, 2), None, "not yet");
                for client in [&crowd, &load] {
                    client.read(now, 2);
                }
            }
            assert_eq!(crowd.pressure() > 0.2, plans == 20, "{}", crowd.pressure());
            assert_eq!(load.pressure() > 0.2, pressed, "{}", load.pressure());
        }
    }

    #[test]
    fn clients_that_are_gone_are_forgotten() {
        let pack = Arc::new(PlanLoad::default());
        let kept = pack.of(0);
        for client in 1..10_000 {
            pack.of(client);
        }
        assert!(Arc::ptr_eq(&kept, &pack.of(0)));
        let known = pack.clients.lock().unwrap().by_number.len();
        assert!(known <= MANY_CLIENTS, "{known}");
    }
}

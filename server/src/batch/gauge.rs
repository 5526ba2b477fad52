//! How busy the lanes of an engine are.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// What the lanes of a pack's engine do, readable at any time without a lock.
#[derive(Debug)]
pub struct EngineGauge {
    /// Where the nanoseconds below are counted from.
    origin: Instant,
    lanes: Box<[LaneClock]>,
    alive: AtomicUsize,
    served: AtomicU64,
    waiting: AtomicUsize,
}

/// A lane's busy time. The lowest bit says whether a batch runs; the others are nanoseconds: all busy time while none
/// runs, and less the start of the running batch while one does. So one load gives the sum up to any moment, and it
/// never falls. Only the lane itself writes.
#[derive(Debug, Default)]
struct LaneClock(AtomicU64);

impl LaneClock {
    fn busy(&self, now: u64) -> u64 {
        let value = self.0.load(Ordering::Acquire);
        let running = value & 1 == 1;
        let sum = (value >> 1).wrapping_add(if running { now } else { 0 });
        sum & (u64::MAX >> 1)
    }

    fn switch(&self, now: u64, running: bool) {
        let value = self.0.load(Ordering::Acquire);
        if (value & 1 == 1) == running {
            return;
        }
        let sum = (value >> 1).wrapping_add(if running { now.wrapping_neg() } else { now });
        self.0.store(sum << 1 | u64::from(running), Ordering::Release);
    }
}

impl EngineGauge {
    /// A gauge of idle lanes.
    pub fn new(lanes: usize, origin: Instant) -> Self {
        Self {
            origin,
            lanes: (0..lanes).map(|_| LaneClock::default()).collect(),
            alive: AtomicUsize::new(lanes),
            served: AtomicU64::new(0),
            waiting: AtomicUsize::new(0),
        }
    }

    /// Time that all lanes together have spent on batches until `now`, those that still run included. It grows by up to
    /// [`EngineGauge::lanes`] seconds a second.
    pub fn busy(&self, now: Instant) -> Duration {
        let now = self.nanos(now);
        Duration::from_nanos(self.lanes.iter().map(|lane| lane.busy(now)).sum())
    }

    /// Lanes that serve.
    pub fn lanes(&self) -> usize {
        self.alive.load(Ordering::Relaxed)
    }

    /// Characters served since the start.
    pub fn served(&self) -> u64 {
        self.served.load(Ordering::Relaxed)
    }

    /// Characters that wait for a batch.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// `lane` has begun with a batch. For the lane itself.
    pub fn began(&self, lane: usize, now: Instant) {
        self.lanes[lane].switch(self.nanos(now), true);
    }

    /// `lane` is done with a batch, `characters` of which were served. For the lane itself.
    pub fn ended(&self, lane: usize, now: Instant, characters: usize) {
        self.lanes[lane].switch(self.nanos(now), false);
        self.served.fetch_add(characters as u64, Ordering::Relaxed);
    }

    /// A lane will serve no more.
    pub(super) fn lost_lane(&self, lane: usize, now: Instant) {
        self.lanes[lane].switch(self.nanos(now), false);
        self.alive.fetch_sub(1, Ordering::Relaxed);
    }

    /// So many characters wait now.
    pub fn wait(&self, characters: usize) {
        self.waiting.store(characters, Ordering::Relaxed);
    }

    fn nanos(&self, now: Instant) -> u64 {
        now.saturating_duration_since(self.origin).as_nanos() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn busy_time_counts_running_batches_and_never_falls() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let gauge = EngineGauge::new(2, start);
        let busy = |ms: u64| gauge.busy(at(ms)).as_millis();
        assert_eq!(busy(10), 0);
        gauge.began(0, at(10));
        assert_eq!(busy(15), 5);
        gauge.began(1, at(20));
        assert_eq!(busy(30), 30);
        gauge.ended(0, at(30), 4);
        assert_eq!((busy(30), busy(40)), (30, 40));
        gauge.ended(1, at(40), 1);
        gauge.ended(1, at(50), 0);
        assert_eq!((busy(50), busy(100), gauge.served()), (40, 40, 5));
        gauge.began(0, at(100));
        assert_eq!(busy(101), 41);
        assert_eq!(gauge.lanes(), 2);
        gauge.lost_lane(0, at(102));
        assert_eq!(busy(200), 42);
        assert_eq!(gauge.lanes(), 1);
    }
}

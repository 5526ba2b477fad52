//! How a lane without work waits: it listens for a moment, then it sleeps.
//!
//! A core that sleeps is slow to wake: on a virtual machine a caller alone, whose next request comes half a millisecond after
//! an answer, would find lane and core asleep each time. So the first free lane listens for a while after its last batch, and lets every
//! thread go first that wants its core meanwhile. An idle server sleeps.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Looks at the clock and lets others go first once in so many turns, each a few nanoseconds long.
const TURNS: usize = 20;

/// A lane's own.
#[derive(Debug, Default)]
struct Bell {
    /// Where it sleeps.
    sleeps: Condvar,
    /// Rung since it last began to listen.
    rung: AtomicBool,
}

/// One bell for each lane, rung where there is work for it.
#[derive(Debug)]
pub(super) struct Bells {
    bells: Box<[Bell]>,
    /// How long a lane listens.
    spin: Duration,
}

impl Bells {
    pub(super) fn new(lanes: usize, spin: Duration) -> Self {
        Self {
            bells: (0..lanes).map(|_| Bell::default()).collect(),
            spin,
        }
    }

    pub(super) fn ring(&self, lane: usize) {
        let bell = &self.bells[lane];
        bell.rung.store(true, Ordering::Release);
        bell.sleeps.notify_one();
    }

    pub(super) fn ring_all(&self) {
        for lane in 0..self.bells.len() {
            self.ring(lane);
        }
    }

    /// Until when a lane listens that has just become free.
    pub(super) fn listen_until(&self, now: Instant) -> Instant {
        now + self.spin
    }

    /// Waits awake, without the lock, until the lane's bell rings or it is `until`. A ring for what came while the caller had
    /// the lock comes later than this begins to listen; what came before it the caller has seen.
    pub(super) fn listen<T>(&self, lane: usize, guard: MutexGuard<'_, T>, until: Instant) {
        let rung = &self.bells[lane].rung;
        rung.store(false, Ordering::Relaxed);
        drop(guard);
        while !rung.load(Ordering::Acquire) && Instant::now() < until {
            for _ in 0..TURNS {
                std::hint::spin_loop();
            }
            std::thread::yield_now();
        }
    }

    /// Sleeps until the lane's bell rings, or for `time`.
    pub(super) fn sleep<'a, T>(
        &self,
        lane: usize,
        guard: MutexGuard<'a, T>,
        time: Option<Duration>,
    ) -> MutexGuard<'a, T> {
        let bell = &self.bells[lane].sleeps;
        match time {
            Some(time) => {
                let woken = bell.wait_timeout(guard, time);
                woken.unwrap_or_else(PoisonError::into_inner).0
            }
            None => bell.wait(guard).unwrap_or_else(PoisonError::into_inner),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    const LONG: Duration = Duration::from_secs(60);

    /// What a lane does until it sees work: listens until `until`, then sleeps.
    fn wait_for_work(bells: &Bells, lane: usize, work: &Mutex<bool>, until: Instant) {
        let mut guard = work.lock().unwrap();
        while !*guard {
            guard = match Instant::now() < until {
                true => {
                    bells.listen(lane, guard, until);
                    work.lock().unwrap()
                }
                false => bells.sleep(lane, guard, None),
            };
        }
    }

    #[test]
    fn a_ring_is_heard_by_who_listens_and_by_who_sleeps() {
        for spin in [LONG, Duration::ZERO] {
            for delay in [Duration::ZERO, Duration::from_millis(5)] {
                let bells = Arc::new(Bells::new(2, spin));
                let work = Arc::new(Mutex::new(false));
                let lane = std::thread::spawn({
                    let (bells, work) = (bells.clone(), work.clone());
                    move || {
                        let began = Instant::now();
                        wait_for_work(&bells, 1, &work, bells.listen_until(began));
                        began.elapsed()
                    }
                });
                std::thread::sleep(delay);
                bells.ring(0);
                *work.lock().unwrap() = true;
                bells.ring(1);
                assert!(lane.join().unwrap() < LONG / 2);
            }
        }
    }

    #[test]
    fn who_hears_nothing_listens_for_its_time_and_no_longer() {
        let spin = Duration::from_millis(5);
        let bells = Bells::new(1, spin);
        let work = Mutex::new(());
        // Rung before: that was for something seen.
        bells.ring(0);
        let began = Instant::now();
        bells.listen(0, work.lock().unwrap(), bells.listen_until(began));
        assert!(began.elapsed() >= spin);
        assert!(work.try_lock().is_ok());
    }
}

//! How a worker without work waits: it spins for a moment, then it parks.
//!
//! A core that sleeps is slow to wake. On a virtual machine a lone caller, whose next request comes
//! half a millisecond after an answer, would find worker and core asleep each time. So the first
//! idle worker spins for a while after its last step, and lets every thread go first that wants its
//! core. An idle server sleeps.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Looks at the clock and lets others go first once in so many turns, each a few nanoseconds long.
const TURNS: usize = 20;

/// A worker's own.
#[derive(Debug, Default)]
struct Parker {
    /// Where it is parked.
    parked: Condvar,
    /// Unparked since it last began to spin.
    unparked: AtomicBool,
}

/// One parker for each worker.
#[derive(Debug)]
pub(super) struct Parkers {
    parkers: Box<[Parker]>,
    /// How long a worker spins.
    spin: Duration,
}

impl Parkers {
    pub(super) fn new(workers: usize, spin: Duration) -> Self {
        Self {
            parkers: (0..workers).map(|_| Parker::default()).collect(),
            spin,
        }
    }

    pub(super) fn unpark(&self, worker: usize) {
        let parker = &self.parkers[worker];
        parker.unparked.store(true, Ordering::Release);
        parker.parked.notify_one();
    }

    pub(super) fn unpark_all(&self) {
        for worker in 0..self.parkers.len() {
            self.unpark(worker);
        }
    }

    /// Until when a worker spins that has just become idle.
    pub(super) fn spin_until(&self, now: Instant) -> Instant {
        now + self.spin
    }

    /// Waits awake, without the lock, until the worker is unparked or it is `until`. Who unparks it
    /// for what came while the caller had the lock does so later than this begins; what came before
    /// the caller has seen.
    pub(super) fn spin<T>(&self, worker: usize, guard: MutexGuard<'_, T>, until: Instant) {
        let unparked = &self.parkers[worker].unparked;
        unparked.store(false, Ordering::Relaxed);
        drop(guard);
        while !unparked.load(Ordering::Acquire) && Instant::now() < until {
            for _ in 0..TURNS {
                std::hint::spin_loop();
            }
            std::thread::yield_now();
        }
    }

    /// Sleeps until the worker is unparked.
    pub(super) fn park<'a, T>(&self, worker: usize, guard: MutexGuard<'a, T>) -> MutexGuard<'a, T> {
        let woken = self.parkers[worker].parked.wait(guard);
        woken.unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    const LONG: Duration = Duration::from_secs(60);

    /// What a worker does until it sees work: spins until `until`, then parks.
    fn wait_for_work(parkers: &Parkers, worker: usize, work: &Mutex<bool>, until: Instant) {
        let mut guard = work.lock().unwrap();
        while !*guard {
            guard = match Instant::now() < until {
                true => {
                    parkers.spin(worker, guard, until);
                    work.lock().unwrap()
                }
                false => parkers.park(worker, guard),
            };
        }
    }

    #[test]
    fn whoever_spins_or_is_parked_is_woken() {
        for spin in [LONG, Duration::ZERO] {
            for delay in [Duration::ZERO, Duration::from_millis(5)] {
                let parkers = Arc::new(Parkers::new(2, spin));
                let work = Arc::new(Mutex::new(false));
                let worker = std::thread::spawn({
                    let (parkers, work) = (parkers.clone(), work.clone());
                    move || {
                        let began = Instant::now();
                        wait_for_work(&parkers, 1, &work, parkers.spin_until(began));
                        began.elapsed()
                    }
                });
                std::thread::sleep(delay);
                parkers.unpark(0);
                *work.lock().unwrap() = true;
                parkers.unpark(1);
                assert!(worker.join().unwrap() < LONG / 2);
            }
        }
    }

    #[test]
    fn whoever_is_not_woken_spins_for_its_time_and_no_longer() {
        let spin = Duration::from_millis(5);
        let parkers = Parkers::new(1, spin);
        let work = Mutex::new(());
        // Unparked before: that was for something seen.
        parkers.unpark(0);
        let began = Instant::now();
        parkers.spin(0, work.lock().unwrap(), parkers.spin_until(began));
        assert!(began.elapsed() >= spin);
        assert!(work.try_lock().is_ok());
    }
}

//! How an idle worker waits: it spins for a moment, then it parks.
//!
//! A sleeping core is slow to wake. On a virtual machine, a single caller whose next request comes
//! half a millisecond after an answer would find worker and core asleep each time. So the first
//! idle worker spins for a while after its last step, and yields its core to any other thread. An
//! idle server sleeps.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Spins, of a few nanoseconds each, between two looks at the clock. The worker also yields its
/// core then.
const TURNS: usize = 20;

/// The parker of one worker.
#[derive(Debug, Default)]
struct Parker {
    /// A parked worker waits for it.
    parked: Condvar,
    /// Whether the worker was unparked since it last began to spin.
    unparked: AtomicBool,
}

/// One parker for each worker.
#[derive(Debug)]
pub(super) struct Parkers {
    parkers: Box<[Parker]>,
    /// Time from a worker's last step until it stops spinning.
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

    /// When a worker that becomes idle at `now` stops spinning.
    pub(super) fn spin_until(&self, now: Instant) -> Instant {
        now + self.spin
    }

    /// Releases the lock and spins until the worker is unparked, or until `until`. No wake is lost.
    /// The caller has seen all work from before it took the lock. Later work can only come after
    /// this function has cleared the flag and released the lock.
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

    /// Waits for work as a worker does: spins until `until`, then parks.
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
    fn a_spinning_or_parked_worker_is_woken() {
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
    fn a_worker_that_is_not_woken_spins_for_its_time_and_no_longer() {
        let spin = Duration::from_millis(5);
        let parkers = Parkers::new(1, spin);
        let work = Mutex::new(());
        // A wake from before the spin does not count.
        parkers.unpark(0);
        let began = Instant::now();
        parkers.spin(0, work.lock().unwrap(), parkers.spin_until(began));
        assert!(began.elapsed() >= spin);
        assert!(work.try_lock().is_ok());
    }
}

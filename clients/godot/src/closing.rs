//! Threads of connections that end. The library may only be unloaded when they are done.

use std::sync::{Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest wait for the threads: a little more than they take at most.
const LIMIT: Duration = Duration::from_secs(3);
/// Time between two looks at a thread.
const PAUSE: Duration = Duration::from_millis(2);

static THREADS: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// Adds a thread that ends by itself.
pub fn add(thread: JoinHandle<()>) {
    let mut threads = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    threads.retain(|thread| !thread.is_finished());
    threads.push(thread);
}

/// Waits until all threads have ended.
pub fn wait() {
    let until = Instant::now() + LIMIT;
    let threads = std::mem::take(&mut *THREADS.lock().unwrap_or_else(PoisonError::into_inner));
    for thread in threads {
        while !thread.is_finished() && Instant::now() < until {
            std::thread::sleep(PAUSE);
        }
        if thread.is_finished() {
            // A thread that panicked has ended, too.
            let _ = thread.join();
        }
    }
}

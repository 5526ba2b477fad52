//! Ways to wait for a point in time.

use std::future::Future;

use tokio::time::Instant;

/// Waits for points in time.
pub trait WaitUntil: Send {
    /// Returns at the time `due`, or at once if it has passed.
    fn until(&mut self, due: Instant) -> impl Future<Output = ()> + Send;
}

/// Waits by the runtime's timer, which counts milliseconds. In tests its time is virtual.
#[derive(Debug, Clone, Copy, Default)]
pub struct Timer;

impl WaitUntil for Timer {
    async fn until(&mut self, due: Instant) {
        tokio::time::sleep_until(due).await;
    }
}

/// Waits as precisely as the system can, within about 0.1 ms. It blocks its thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct OwnThread;

impl WaitUntil for OwnThread {
    async fn until(&mut self, due: Instant) {
        let left = due.saturating_duration_since(Instant::now());
        if !left.is_zero() {
            std::thread::sleep(left);
        }
    }
}

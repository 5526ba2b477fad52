//! Separate threads for characters, so that a large crowd does not delay connections and health
//! checks.

use std::future::Future;
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Handle, Runtime};
use tokio_util::task::AbortOnDropHandle;
use tracing::Instrument as _;

use troupe_base::offload::WorkerStopped;
use troupe_base::turns::Turns;

/// A task works for at most this long before others get a turn.
const TURN: Duration = Duration::from_millis(1);

/// Runs the work that advances characters: steps, ticks and commands.
#[derive(Debug)]
pub struct Executor {
    /// `None` in tests that run on the caller's runtime, and while it is dropped.
    threads: Option<Runtime>,
    handle: Handle,
}

impl Executor {
    /// Starts one thread for each core that this process may use.
    ///
    /// # Errors
    /// The system's error if it cannot start threads.
    pub fn new() -> std::io::Result<Self> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let runtime = Builder::new_multi_thread()
            .worker_threads(cores)
            .thread_name("characters")
            .enable_time()
            .build()?;
        Ok(Self {
            handle: runtime.handle().clone(),
            threads: Some(runtime),
        })
    }

    /// Runs on the caller's runtime. Simulations then control the time, and fuzz targets have a
    /// fixed order.
    #[cfg(any(test, feature = "testing"))]
    pub fn here() -> Self {
        Self {
            threads: None,
            handle: Handle::current(),
        }
    }

    /// Runs `work` on these threads, in the turns of `turns`. If the returned future is dropped,
    /// the work is stopped.
    ///
    /// # Errors
    /// [`WorkerStopped`] if the work panicked or the threads ended.
    pub async fn run<T: Send + 'static>(
        &self,
        turns: Turns,
        work: impl Future<Output = T> + Send + 'static,
    ) -> Result<T, WorkerStopped> {
        let task = AbortOnDropHandle::new(self.handle.spawn(turns.take(work).in_current_span()));
        task.await.map_err(|_| WorkerStopped)
    }

    /// Runs `work` on these threads to its end, in the turns of `turns`.
    pub fn spawn(&self, turns: Turns, work: impl Future<Output = ()> + Send + 'static) {
        self.handle.spawn(turns.take(work).in_current_span());
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        // The drop of a runtime blocks, which panics inside of asynchronous code. This does not.
        if let Some(runtime) = self.threads.take() {
            runtime.shutdown_background();
        }
    }
}

/// Measures how long a task has worked since others had a turn.
#[derive(Debug)]
pub struct Turn(Instant);

impl Turn {
    /// Starts a turn now.
    pub fn begin() -> Self {
        Self(Instant::now())
    }

    /// Lets other tasks work if this one has used up its turn. Do not call it while a lock is held.
    pub async fn pause(&mut self) {
        if self.0.elapsed() >= TURN {
            tokio::task::yield_now().await;
            self.0 = Instant::now();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[tokio::test]
    async fn long_work_lets_others_have_a_turn() {
        let executor = Executor::new().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        for _ in 0..64 {
            let stop = stop.clone();
            executor.spawn(Turns::endless(), async move {
                let mut turn = Turn::begin();
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                    turn.pause().await;
                }
            });
        }
        for _ in 0..10 {
            assert_eq!(executor.run(Turns::endless(), async { 7 }).await, Ok(7));
        }
        stop.store(true, Ordering::Relaxed);
    }

    #[tokio::test]
    async fn work_ends_when_its_caller_goes() {
        let executor = Executor::new().unwrap();
        let (alive, ended) = tokio::sync::oneshot::channel::<()>();
        let work = async move {
            let _alive = alive;
            std::future::pending::<()>().await;
        };
        let waited =
            tokio::time::timeout(Duration::from_millis(20), executor.run(Turns::endless(), work)).await;
        assert!(waited.is_err());
        assert!(ended.await.is_err());
    }
}

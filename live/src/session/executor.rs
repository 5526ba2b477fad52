//! Threads of their own for characters: whatever many of them cost, connections and health checks
//! go on.

use std::future::Future;
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Handle, Runtime};
use tokio_util::task::AbortOnDropHandle;
use tracing::Instrument as _;

use troupe_base::offload::WorkerStopped;
use troupe_base::turns::Turns;

/// Longest that one task works before the others get a turn.
const TURN: Duration = Duration::from_millis(1);

/// Runs what advances characters: steps, ticks and commands.
#[derive(Debug)]
pub struct Executor {
    /// Its threads, until it is dropped.
    threads: Option<Runtime>,
    handle: Handle,
}

impl Executor {
    /// Threads for characters, one for each core that this process may use.
    ///
    /// # Errors
    /// Where the system gives no threads.
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

    /// No threads but those that this is called on: a simulation has its time for everything, and a
    /// fuzz target one order.
    #[cfg(any(test, feature = "testing"))]
    pub fn here() -> Self {
        Self {
            threads: None,
            handle: Handle::current(),
        }
    }

    /// Runs `work` there in `turns`, and gives it up where nobody waits for it any more.
    ///
    /// # Errors
    /// [`WorkerStopped`].
    pub async fn run<T: Send + 'static>(
        &self,
        turns: Turns,
        work: impl Future<Output = T> + Send + 'static,
    ) -> Result<T, WorkerStopped> {
        let task = AbortOnDropHandle::new(self.handle.spawn(turns.take(work).in_current_span()));
        task.await.map_err(|_| WorkerStopped)
    }

    /// Runs `work` there in `turns`, whether anybody waits for it or not.
    pub fn spawn(&self, turns: Turns, work: impl Future<Output = ()> + Send + 'static) {
        self.handle.spawn(turns.take(work).in_current_span());
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        // A runtime must not wait for its threads where others must not wait either.
        if let Some(runtime) = self.threads.take() {
            runtime.shutdown_background();
        }
    }
}

/// How long a task has worked since others had a turn.
#[derive(Debug)]
pub struct Turn(Instant);

impl Turn {
    /// A turn that begins now.
    pub fn begin() -> Self {
        Self(Instant::now())
    }

    /// Lets others work where this task has worked long enough. Not for use while a lock is held.
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
    async fn work_ends_when_nobody_waits_for_it() {
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

//! The open loop: requests are sent at fixed times, whether or not earlier ones were answered.

use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::{Semaphore, oneshot};
use tokio::time::Instant;

use super::target::Target;
use super::wait::{OwnThread, WaitUntil};
use crate::failure::Failure;
use crate::measure::{Call, Recorder};

/// Sends each arrival's request at its time, and returns after all answers.
///
/// Latency counts from the time at which a request was due. If `max_in_flight` requests are in
/// flight, further ones are not sent but recorded as dropped.
pub async fn open<T: Target, P: WaitUntil>(
    target: Arc<T>,
    recorder: Arc<Recorder>,
    arrivals: impl Iterator<Item = (u64, Duration)> + Send,
    max_in_flight: u32,
    mut pace: P,
    runtime: Handle,
) {
    let permits = Arc::new(Semaphore::new(max_in_flight as usize));
    let start = recorder.clock().start();
    for (number, at) in arrivals {
        let due = start + at;
        pace.until(due).await;
        let Ok(permit) = permits.clone().try_acquire_owned() else {
            recorder.dropped(due);
            continue;
        };
        let (target, recorder) = (target.clone(), recorder.clone());
        runtime.spawn(async move {
            let sent = Instant::now();
            recorder.sent(sent);
            let outcome = target.call(number, number).await;
            let done = Instant::now();
            recorder.done(&Call {
                due,
                sent,
                done,
                outcome,
            });
            drop(permit);
        });
    }
    // All answers have come once all permits are back. The semaphore is never closed.
    let _ = permits.acquire_many(max_in_flight).await;
}

/// Runs [`open`] with a separate thread for the clock, so that busy connections do not delay it.
///
/// # Errors
/// [`Failure::Other`] if the thread cannot be started or panics.
pub async fn open_on_a_thread<T: Target>(
    target: Arc<T>,
    recorder: Arc<Recorder>,
    arrivals: impl Iterator<Item = (u64, Duration)> + Send + 'static,
    max_in_flight: u32,
) -> Result<(), Failure> {
    let runtime = Handle::current();
    let (finished, wait) = oneshot::channel();
    std::thread::Builder::new()
        .name("arrivals".to_owned())
        .spawn(move || {
            let load = open(
                target,
                recorder,
                arrivals,
                max_in_flight,
                OwnThread,
                runtime.clone(),
            );
            runtime.block_on(load);
            // The receiver may be gone.
            let _ = finished.send(());
        })
        .map_err(|e| Failure::Other(format!("cannot start a thread: {e}")))?;
    wait.await
        .map_err(|_| Failure::Other("the thread that sends requests has stopped".to_owned()))
}

#[cfg(test)]
#[path = "open_tests.rs"]
mod tests;

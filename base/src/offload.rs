//! CPU work of a request, off the task that received it where it is much.

/// The work did not come to its end: it panicked, or the runtime goes down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a worker stopped before it was done")]
pub struct WorkerStopped;

/// Runs CPU work for a request: here where it is for at most `inline` things, on the blocking pool
/// where it is for more.
///
/// # Errors
/// [`WorkerStopped`].
pub async fn offload<T: Send + 'static>(
    things: usize,
    inline: usize,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, WorkerStopped> {
    if things <= inline {
        return Ok(work());
    }
    let span = tracing::Span::current();
    tokio::task::spawn_blocking(move || span.in_scope(work))
        .await
        .map_err(|_| WorkerStopped)
}

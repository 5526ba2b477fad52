//! Moves heavy CPU work of a request to the runtime's blocking pool.

/// The work did not finish: it panicked, or the runtime is shutting down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a worker stopped before it was done")]
pub struct WorkerStopped;

/// Runs CPU work for a request. Work on at most `inline` things runs on this task, larger work on
/// the blocking pool.
///
/// # Errors
/// [`WorkerStopped`] if the work panicked or the runtime is shutting down.
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

//! Why a request was not served.

use std::time::Duration;

use troupe_engine::EngineError;

use super::scheduler::QueueRefusal;

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SubmitError {
    /// The queue has no room for the request, or the request would wait for longer than allowed.
    #[error("the queue is full: {pending_characters} characters are waiting; retry later")]
    QueueFull {
        /// Characters that already wait.
        pending_characters: usize,
        /// How long the caller should wait before it tries again.
        retry_after: Duration,
    },
    /// A newer plan of the same owner replaced it.
    #[error("a newer plan of the same character replaced this one")]
    Superseded,
    /// It had not started when its [`expires`](super::Order::expires) passed.
    #[error("the request timed out after {} ms in the queue", waited.as_millis())]
    DeadlinePassed {
        /// Time in the queue.
        waited: Duration,
    },
    /// Too many pieces of the answer waited for their reader.
    #[error("the answer was cancelled: its parts were not read in time")]
    ReaderSlow,
    /// Inference failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl From<QueueRefusal> for SubmitError {
    fn from(refusal: QueueRefusal) -> Self {
        Self::QueueFull {
            pending_characters: refusal.pending_characters,
            retry_after: refusal.retry_after(),
        }
    }
}

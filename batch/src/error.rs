//! Why a request was not served.

use std::time::Duration;

use troupe_engine::EngineError;

use super::scheduler::QueueRefusal;

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SubmitError {
    /// The queue has no room for the request, or is so slow that it would wait for too long.
    #[error("the queue is full: {pending_characters} characters are waiting; retry later")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// A newer plan of the same owner took its place.
    #[error("a newer plan of the same character replaced this one")]
    Superseded,
    /// It had not started at the moment from which on nobody would want the answer.
    #[error("the request timed out after {} ms in the queue", waited.as_millis())]
    DeadlinePassed {
        /// How long it waited.
        waited: Duration,
    },
    /// Its reader left too many parts of its answer waiting.
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

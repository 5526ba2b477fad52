//! Errors of queues and engines.

use super::row::{ABORTED, FULL, INTERNAL, Row, TOO_LATE, Tabled, UNAVAILABLE};
use troupe_base::offload::WorkerStopped;
use troupe_batch::SubmitError;
use troupe_character::post::NonFinite;
use troupe_engine::EngineError;

impl Tabled for SubmitError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::QueueFull { retry_after, .. } => FULL.because("QUEUE_FULL").retry_after(*retry_after),
            Self::ReaderSlow => FULL.because("READER_SLOW"),
            Self::Superseded => ABORTED.because("SUPERSEDED"),
            Self::DeadlinePassed { .. } => TOO_LATE.because("DEADLINE_EXCEEDED"),
            Self::Engine(EngineError::Stopped) => UNAVAILABLE.because("NOT_READY"),
            Self::Engine(_) => INTERNAL.because("INTERNAL"),
        }
    }
}

impl Tabled for NonFinite {
    fn row(&self) -> Row<'_> {
        INTERNAL.because("INTERNAL")
    }
}

impl Tabled for WorkerStopped {
    fn row(&self) -> Row<'_> {
        INTERNAL.because("INTERNAL")
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use axum::response::IntoResponse as _;
    use http::StatusCode;
    use tonic::Code;

    use super::*;
    use crate::api::ApiError;

    #[test]
    fn an_engine_that_has_stopped_is_unavailable_and_one_that_failed_an_internal_error() {
        let stopped = ApiError::from(SubmitError::Engine(EngineError::Stopped));
        assert_eq!(stopped.status().code(), Code::Unavailable);
        assert_eq!(stopped.to_string(), "the server is broken: an engine has stopped");
        assert_eq!(stopped.into_response().status(), StatusCode::SERVICE_UNAVAILABLE);
        let failed = ApiError::from(SubmitError::Engine(EngineError::Panicked("oh".into())));
        assert_eq!(failed.status().code(), Code::Internal);
    }

    #[test]
    fn what_the_queue_drops_says_why() {
        let shown = |error: SubmitError| {
            let error = ApiError::from(error);
            let Row { codes, reason, .. } = error.row();
            (
                error.to_string(),
                codes.grpc,
                codes.http.as_u16(),
                codes.label,
                reason,
            )
        };
        assert_eq!(
            shown(SubmitError::Superseded),
            (
                "a newer plan of the same character replaced this one".to_owned(),
                Code::Aborted,
                409,
                "ABORTED",
                "SUPERSEDED"
            )
        );
        let late = SubmitError::DeadlinePassed {
            waited: Duration::from_millis(1500),
        };
        assert_eq!(
            shown(late),
            (
                "the request was not served within 1500 ms".to_owned(),
                Code::DeadlineExceeded,
                504,
                "DEADLINE_EXCEEDED",
                "DEADLINE_EXCEEDED"
            )
        );
        let full = SubmitError::QueueFull {
            pending_characters: 7,
            retry_after: Duration::from_millis(20),
        };
        assert_eq!(
            shown(full).0,
            "the queue is full: 7 characters are waiting; retry later"
        );
    }
}

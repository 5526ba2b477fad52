//! Every error of the API, and the one place that says how it looks: gRPC code and details, HTTP status and body,
//! metric label.

use std::time::Duration;

use axum::Json;
use axum::response::{IntoResponse, Response};
use http::{HeaderValue, StatusCode, header};
use serde::{Deserialize, Serialize};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};
use troupe_proto::v1;
use utoipa::ToSchema;

use crate::batch::SubmitError;
use crate::engine::EngineError;
use crate::inbetween::{FieldError, NonFinite};
use crate::session::Refusal;

/// The domain of this API's errors in `google.rpc.ErrorInfo`.
const DOMAIN: &str = "troupe.v1";
/// Most characters of a message that may echo the request.
pub(super) const MAX_MESSAGE: usize = 512;
/// Most characters of a field's path that may echo the request.
pub(super) const MAX_PATH: usize = 256;

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// A value that the server does not accept.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A body that is not a request: truncated, no protobuf, no JSON, or with a field of the wrong form.
    #[error("the request cannot be read: {message}")]
    Malformed {
        /// What is wrong with it.
        message: String,
        /// The field, where it is known.
        field: Option<String>,
    },
    /// A body that ends before its message does.
    #[error("the body ends early: {problem}; allowed: a whole message of at most {limit_bytes} bytes")]
    Truncated {
        /// How that was noticed.
        problem: String,
        /// The limit of a whole one.
        limit_bytes: usize,
    },
    /// A body over the limit.
    #[error("the request is too large; allowed: at most {limit_bytes} bytes")]
    TooLarge {
        /// The limit.
        limit_bytes: usize,
    },
    /// A pack that is not loaded.
    #[error("there is no pack {name:?}; loaded: {}", loaded.join(", "))]
    UnknownPack {
        /// The name that was asked for.
        name: String,
        /// The field of the request that named it.
        field: String,
        /// The names that there are.
        loaded: Vec<String>,
    },
    /// A session that ran out of its time to live.
    #[error("the session {id:?} has expired: nobody commanded, stepped or streamed it within its ttl_ms")]
    SessionExpired {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session that is not open.
    #[error("there is no session {id:?}")]
    UnknownSession {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session of that id is open already.
    #[error("there is a session {id:?} already")]
    SessionExists {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// Somebody else advances the session.
    #[error("the session {id:?} is in the hands of {owner}")]
    SessionBusy {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
        /// Who advances it.
        owner: &'static str,
    },
    /// No room for another session, on the server or on a stream.
    #[error("{open} sessions are open{place}; allowed: at most {limit}")]
    TooManySessions {
        /// How many there are.
        open: usize,
        /// How many there may be.
        limit: usize,
        /// Where: nothing for the server, or ` on this stream`.
        place: &'static str,
    },
    /// No room for another stream.
    #[error("{limit} streams are open, and there is no room for more")]
    TooManyStreams {
        /// How many there may be.
        limit: usize,
    },
    /// A style that the pack does not have.
    #[error("{field}: there is no style {name:?}; allowed: {}", there_are.join(", "))]
    UnknownStyle {
        /// The name that was asked for.
        name: String,
        /// The field of the request that named it.
        field: String,
        /// The names that there are.
        there_are: Vec<String>,
    },
    /// A style that came with its pack cannot be replaced.
    #[error("{field}: the style {name:?} is one of the pack's own")]
    StyleIsBuiltIn {
        /// Its name.
        name: String,
        /// The field of the request that named it.
        field: String,
    },
    /// What a character is asked to do and could not.
    #[error("{refusal}")]
    Refused {
        /// Why.
        refusal: Refusal,
        /// The field of the request that asked for it.
        field: String,
    },
    /// No such route or method.
    #[error("there is no {0}")]
    UnknownRoute(String),
    /// A route that exists, under another HTTP method.
    #[error("this path does not answer {0}")]
    WrongMethod(String),
    /// The queue has no room.
    #[error("the server is busy: {pending_characters} characters are waiting")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// A newer plan of the same character took the place of this one.
    #[error("a newer plan of the same character took the place of this one")]
    Superseded,
    /// The request waited for so long that nobody wants its answer any more.
    #[error("the request was given up after {} ms in the queue", waited.as_millis())]
    WaitedTooLong {
        /// How long it waited.
        waited: Duration,
    },
    /// The server is not ready yet, or no longer.
    #[error("the server is {0}")]
    Unavailable(&'static str),
    /// The time for the request ran out.
    #[error("the request was not served {}", in_time(.0))]
    DeadlineExceeded(Duration),
    /// A feature of gRPC that the server does not speak, such as a compression.
    #[error("{0}")]
    Unimplemented(String),
    /// The server's own fault.
    #[error("{0}")]
    Internal(String),
}

impl From<SubmitError> for ApiError {
    fn from(error: SubmitError) -> Self {
        match error {
            SubmitError::QueueFull {
                pending_characters,
                retry_after,
            } => Self::QueueFull {
                pending_characters,
                retry_after,
            },
            SubmitError::Superseded => Self::Superseded,
            SubmitError::DeadlinePassed { waited } => Self::WaitedTooLong { waited },
            SubmitError::Engine(EngineError::Stopped) => Self::Unavailable("broken: an engine has stopped"),
            SubmitError::Engine(error) => Self::Internal(error.to_string()),
        }
    }
}

/// A time limit in words; one below a millisecond, or that is not known, has no number.
fn in_time(limit: &Duration) -> String {
    match limit.as_millis() {
        0 => "in time".to_owned(),
        limit => format!("within {limit} ms"),
    }
}

/// What an error echoes of a request: at most `limit` characters of it, and an ellipsis where there is more.
pub(super) fn cut(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

impl From<NonFinite> for ApiError {
    fn from(error: NonFinite) -> Self {
        Self::Internal(error.to_string())
    }
}

impl ApiError {
    /// The table: gRPC code, HTTP status, and the code's name in JSON and metrics.
    fn codes(&self) -> (Code, StatusCode, &'static str) {
        match self {
            Self::Field(_) | Self::Malformed { .. } | Self::Truncated { .. } => {
                (Code::InvalidArgument, StatusCode::BAD_REQUEST, "INVALID_ARGUMENT")
            }
            Self::TooLarge { .. } => (
                Code::ResourceExhausted,
                StatusCode::PAYLOAD_TOO_LARGE,
                "RESOURCE_EXHAUSTED",
            ),
            Self::QueueFull { .. } => (
                Code::ResourceExhausted,
                StatusCode::TOO_MANY_REQUESTS,
                "RESOURCE_EXHAUSTED",
            ),
            Self::UnknownPack { .. } => (Code::NotFound, StatusCode::NOT_FOUND, "NOT_FOUND"),
            Self::SessionExpired { .. } => (Code::NotFound, StatusCode::GONE, "NOT_FOUND"),
            Self::UnknownSession { .. } => (Code::NotFound, StatusCode::NOT_FOUND, "NOT_FOUND"),
            Self::SessionExists { .. } => (Code::AlreadyExists, StatusCode::CONFLICT, "ALREADY_EXISTS"),
            Self::SessionBusy { .. } | Self::StyleIsBuiltIn { .. } => (
                Code::FailedPrecondition,
                StatusCode::CONFLICT,
                "FAILED_PRECONDITION",
            ),
            Self::TooManySessions { .. } | Self::TooManyStreams { .. } => (
                Code::ResourceExhausted,
                StatusCode::TOO_MANY_REQUESTS,
                "RESOURCE_EXHAUSTED",
            ),
            Self::UnknownStyle { .. } => (Code::InvalidArgument, StatusCode::BAD_REQUEST, "INVALID_ARGUMENT"),
            Self::Refused { refusal, .. } => match refusal {
                Refusal::UnknownObject { .. } => (Code::NotFound, StatusCode::NOT_FOUND, "NOT_FOUND"),
                Refusal::UnknownVariant { .. } | Refusal::UnknownApproach { .. } => {
                    (Code::InvalidArgument, StatusCode::BAD_REQUEST, "INVALID_ARGUMENT")
                }
                _ => (
                    Code::FailedPrecondition,
                    StatusCode::CONFLICT,
                    "FAILED_PRECONDITION",
                ),
            },
            Self::UnknownRoute(_) => (Code::Unimplemented, StatusCode::NOT_FOUND, "NOT_FOUND"),
            Self::WrongMethod(_) => (
                Code::Unimplemented,
                StatusCode::METHOD_NOT_ALLOWED,
                "METHOD_NOT_ALLOWED",
            ),
            Self::Unavailable(_) => (Code::Unavailable, StatusCode::SERVICE_UNAVAILABLE, "UNAVAILABLE"),
            Self::Superseded => (Code::Aborted, StatusCode::CONFLICT, "ABORTED"),
            Self::DeadlineExceeded(_) | Self::WaitedTooLong { .. } => (
                Code::DeadlineExceeded,
                StatusCode::GATEWAY_TIMEOUT,
                "DEADLINE_EXCEEDED",
            ),
            Self::Unimplemented(_) => (Code::Unimplemented, StatusCode::NOT_IMPLEMENTED, "UNIMPLEMENTED"),
            Self::Internal(_) => (Code::Internal, StatusCode::INTERNAL_SERVER_ERROR, "INTERNAL"),
        }
    }

    /// A word for the kind of error, finer than its code: the reason in `google.rpc.ErrorInfo`.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Field(_) => "INVALID_FIELD",
            Self::Malformed { .. } | Self::Truncated { .. } => "MALFORMED_REQUEST",
            Self::TooLarge { .. } => "REQUEST_TOO_LARGE",
            Self::UnknownPack { .. } => "UNKNOWN_PACK",
            Self::SessionExpired { .. } => "SESSION_EXPIRED",
            Self::UnknownSession { .. } => "UNKNOWN_SESSION",
            Self::SessionExists { .. } => "SESSION_EXISTS",
            Self::SessionBusy { .. } => "SESSION_BUSY",
            Self::TooManySessions { .. } => "TOO_MANY_SESSIONS",
            Self::TooManyStreams { .. } => "TOO_MANY_STREAMS",
            Self::UnknownStyle { .. } => "UNKNOWN_STYLE",
            Self::StyleIsBuiltIn { .. } => "STYLE_IS_BUILT_IN",
            Self::Refused { refusal, .. } => match refusal {
                Refusal::NoScene => "NO_SCENE",
                Refusal::UnknownObject { .. } => "UNKNOWN_OBJECT",
                Refusal::WrongPack { .. } => "WRONG_PACK",
                Refusal::UnknownVariant { .. } => "UNKNOWN_VARIANT",
                Refusal::UnknownApproach { .. } => "UNKNOWN_APPROACH",
                Refusal::Taken { .. } => "OBJECT_TAKEN",
                Refusal::Blocked { .. } => "BLOCKED",
                Refusal::HandFull { .. } => "HAND_FULL",
            },
            Self::UnknownRoute(_) => "UNKNOWN_ROUTE",
            Self::WrongMethod(_) => "WRONG_METHOD",
            Self::QueueFull { .. } => "QUEUE_FULL",
            Self::Unavailable(_) => "NOT_READY",
            Self::Superseded => "SUPERSEDED",
            Self::DeadlineExceeded(_) | Self::WaitedTooLong { .. } => "DEADLINE_EXCEEDED",
            Self::Unimplemented(_) => "UNIMPLEMENTED",
            Self::Internal(_) => "INTERNAL",
        }
    }

    /// The code's name, for metrics.
    pub fn label(&self) -> &'static str {
        self.codes().2
    }

    /// The field that is wrong, where the error is about one.
    fn field(&self) -> Option<&str> {
        match self {
            Self::Field(error) => Some(&error.field),
            Self::Malformed { field, .. } => field.as_deref(),
            Self::TooLarge { .. } | Self::Truncated { .. } => Some("body"),
            Self::UnknownPack { field, .. } => Some(field),
            Self::SessionExpired { field, .. }
            | Self::UnknownSession { field, .. }
            | Self::SessionExists { field, .. }
            | Self::SessionBusy { field, .. }
            | Self::UnknownStyle { field, .. }
            | Self::StyleIsBuiltIn { field, .. }
            | Self::Refused { field, .. } => Some(field),
            _ => None,
        }
    }

    /// What would be allowed, where the error is about a value or a size.
    fn allowed(&self) -> Option<String> {
        match self {
            Self::Field(error) => Some(error.allowed.clone()),
            Self::TooLarge { limit_bytes } => Some(format!("at most {limit_bytes} bytes")),
            Self::Truncated { limit_bytes, .. } => {
                Some(format!("a whole message of at most {limit_bytes} bytes"))
            }
            Self::UnknownPack { loaded, .. } => Some(loaded.join(", ")),
            Self::TooManySessions { limit, .. } | Self::TooManyStreams { limit } => {
                Some(format!("at most {limit}"))
            }
            Self::UnknownStyle { there_are, .. } => Some(there_are.join(", ")),
            Self::Refused { refusal, .. } => match refusal {
                Refusal::UnknownVariant { there_are, .. } | Refusal::UnknownApproach { there_are, .. } => {
                    Some(there_are.join(", "))
                }
                _ => None,
            },
            Self::StyleIsBuiltIn { .. } => Some("a name that none of the pack's own styles has".to_owned()),
            Self::SessionExists { .. } => Some("an id that is free, or none".to_owned()),
            _ => None,
        }
    }

    /// What is wrong with the field, range included.
    fn description(&self) -> String {
        match self {
            Self::Field(error) => format!("{}; allowed: {}", error.message, error.allowed),
            Self::Malformed { message, .. } => message.clone(),
            other => other.to_string(),
        }
    }

    /// The error as JSON.
    pub fn body(&self) -> ErrorBody {
        ErrorBody {
            error: ErrorDetail {
                code: self.label().to_owned(),
                reason: self.reason().to_owned(),
                message: self.to_string(),
                field: self.field().map(str::to_owned),
                allowed: self.allowed(),
                retry_after_ms: self.retry_after().map(|after| after.as_millis() as u64),
            },
        }
    }

    /// The error as part of an answer that serves others.
    pub fn problem(&self) -> v1::Problem {
        v1::Problem {
            reason: self.reason().to_owned(),
            message: self.to_string(),
            field: self.field().unwrap_or_default().to_owned(),
            allowed: self.allowed().unwrap_or_default(),
        }
    }

    /// The error as a gRPC status with `google.rpc` details.
    pub fn status(&self) -> Status {
        let mut details = ErrorDetails::new();
        let mut metadata = std::collections::HashMap::new();
        metadata.extend(self.field().map(|field| ("field".to_owned(), field.to_owned())));
        metadata.extend(self.allowed().map(|allowed| ("allowed".to_owned(), allowed)));
        details.set_error_info(self.reason(), DOMAIN, metadata);
        if let (Code::InvalidArgument, Some(field)) = (self.codes().0, self.field()) {
            details.add_bad_request_violation(field, self.description());
        }
        if let Some(after) = self.retry_after() {
            details.set_retry_info(Some(after));
        }
        let mut status = Status::with_error_details(self.codes().0, self.to_string(), details);
        status.set_source(std::sync::Arc::new(self.clone()));
        status
    }

    /// The error behind a gRPC status: our own, or one that the gRPC library made while it read the request.
    pub fn of_status(status: &Status, limit_bytes: usize) -> Self {
        let own = std::error::Error::source(status).and_then(|source| source.downcast_ref::<Self>());
        if let Some(own) = own {
            return own.clone();
        }
        let message = cut(status.message(), MAX_MESSAGE);
        match status.code() {
            Code::OutOfRange | Code::ResourceExhausted => Self::TooLarge { limit_bytes },
            Code::Unimplemented => Self::Unimplemented(message),
            Code::DeadlineExceeded => Self::DeadlineExceeded(Duration::ZERO),
            // The library calls whatever it cannot read an internal error; it is the caller's.
            _ if message.contains("EOF") => Self::Truncated {
                problem: "its message is not whole".to_owned(),
                limit_bytes,
            },
            _ => Self::Malformed { message, field: None },
        }
    }

    fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::QueueFull { retry_after, .. } => Some(*retry_after),
            _ => None,
        }
    }
}

/// The code of an answer, noted on it for the metrics.
#[derive(Debug, Clone, Copy)]
pub(super) struct CodeLabel(pub(super) &'static str);

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let mut response = (self.codes().1, Json(self.body())).into_response();
        if let Some(after) = self.retry_after() {
            // The header knows whole seconds only; the body has the milliseconds.
            let seconds = after.as_millis().div_ceil(1000).max(1) as u64;
            response
                .headers_mut()
                .insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        response.extensions_mut().insert(CodeLabel(self.label()));
        response
    }
}

/// Every error over HTTP.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ErrorBody {
    /// What went wrong.
    pub error: ErrorDetail,
}

/// What went wrong.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ErrorDetail {
    /// Name of the gRPC code that says the same, such as `INVALID_ARGUMENT`.
    pub code: String,
    /// A word for the kind of error, finer than its code, such as `SESSION_EXPIRED`.
    #[serde(default)]
    pub reason: String,
    /// What went wrong, for people.
    pub message: String,
    /// The field that is wrong, such as `characters[0].context[2].pose.rotations[8]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// What the field may be, such as `12 to 64`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub allowed: Option<String>,
    /// When it is worth to try again, in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_ms: Option<u64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_echoed_is_cut_between_characters() {
        assert_eq!(cut("naïve", 3), "naï…");
        assert_eq!(cut("naïve", 5), "naïve");
        assert_eq!(cut("", 0), "");
    }

    #[test]
    fn an_engine_that_has_stopped_is_unavailable_and_one_that_failed_an_internal_error() {
        let stopped = ApiError::from(SubmitError::Engine(EngineError::Stopped));
        assert_eq!(stopped.status().code(), Code::Unavailable);
        assert_eq!(stopped.into_response().status(), StatusCode::SERVICE_UNAVAILABLE);
        let failed = ApiError::from(SubmitError::Engine(EngineError::Panicked("oh".into())));
        assert_eq!(failed.status().code(), Code::Internal);
    }

    #[test]
    fn what_the_queue_drops_says_why() {
        let shown = |error: SubmitError| {
            let error = ApiError::from(error);
            let (code, status, label) = error.codes();
            (code, status.as_u16(), label, error.reason())
        };
        assert_eq!(
            shown(SubmitError::Superseded),
            (Code::Aborted, 409, "ABORTED", "SUPERSEDED")
        );
        let late = SubmitError::DeadlinePassed {
            waited: Duration::from_millis(1500),
        };
        assert_eq!(
            ApiError::from(late.clone()).to_string(),
            "the request was given up after 1500 ms in the queue"
        );
        assert_eq!(
            shown(late),
            (
                Code::DeadlineExceeded,
                504,
                "DEADLINE_EXCEEDED",
                "DEADLINE_EXCEEDED"
            )
        );
    }

    #[test]
    fn a_time_limit_that_is_not_known_has_no_number() {
        let text = |limit| ApiError::DeadlineExceeded(limit).to_string();
        assert_eq!(text(Duration::ZERO), "the request was not served in time");
        assert_eq!(
            text(Duration::from_millis(20)),
            "the request was not served within 20 ms"
        );
    }
}

//! Every error of the API. This is the only place that maps an error to its gRPC code and details,
//! HTTP status and body, MMCP code and metric label.
//!
//! The layers below have their own error types. Each domain has a file with its rows of the table
//! ([`row`]): [`edge`], [`batch`], [`world`], [`skeleton`], [`session`],
//! [`life`]. Rows of the API's own
//! errors are here. [`form`] turns rows into answers, [`mmcp`] into answers of that protocol.

mod batch;
mod edge;
mod form;
mod life;
mod mmcp;
mod row;
mod session;
mod skeleton;
mod world;

use std::time::Duration;

use crate::mmcp::Fault;
use row::{
    INTERNAL, INVALID, NO_METHOD, NO_ROUTE, Row, TOO_LARGE, TOO_LATE, Tabled, UNAVAILABLE, UNIMPLEMENTED,
    WRONG_TYPE,
};
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_edge::EdgeError;
use troupe_edge::clients::Exhausted;
use troupe_engine::EngineError;
use troupe_live::session::SessionError;
use troupe_live::world::WorldError;
use troupe_service::ServiceError;

pub(super) use form::CodeLabel;
pub use form::{ErrorBody, ErrorDetail};

/// The domain of this API's errors in `google.rpc.ErrorInfo`.
const DOMAIN: &str = "troupe.v1";

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// The request was read, but the service returned an error.
    #[error("{}", message(.0))]
    Service(Box<ServiceError>),
    /// The edge rejects the request.
    #[error(transparent)]
    Edge(#[from] EdgeError),
    /// A value that the API itself rejects.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A rejected request of the Motion Model Context Protocol.
    #[error(transparent)]
    Mmcp(Box<Fault>),
    /// The body is not a request: it is neither protobuf nor JSON, or a field has the wrong form.
    #[error("the request cannot be read: {message}")]
    Malformed {
        /// The parser's message.
        message: String,
        /// Path of the field, if known.
        field: Option<String>,
    },
    /// A body ends before its message does.
    #[error("the body is truncated: {problem}; allowed: a whole one, at most {limit_bytes} bytes")]
    Truncated {
        /// The parser's message.
        problem: String,
        /// Size limit of a body.
        limit_bytes: usize,
    },
    /// A body is over the limit.
    #[error("the request is too large; allowed: at most {limit_bytes} bytes")]
    TooLarge {
        /// Size limit of a body.
        limit_bytes: usize,
    },
    /// The Content-Type is not one that is read. Pages of other sites can send such bodies without
    /// a preflight request.
    #[error("Content-Type is {found:?}; allowed: {allowed}")]
    WrongType {
        /// The Content-Type, shortened.
        found: String,
        /// The types that are read.
        allowed: &'static str,
    },
    /// No such path or gRPC method.
    #[error("there is no {0}")]
    UnknownRoute(String),
    /// The path exists, but not with this HTTP method.
    #[error("this path does not answer {0}")]
    WrongMethod(String),
    /// Not served in time, in the queue or at the edge.
    #[error("the request was not served {}", in_time(.0))]
    DeadlineExceeded(Duration),
    /// The server lacks a gRPC feature, such as a compression.
    #[error("{0}")]
    Unimplemented(String),
    /// The API itself failed.
    #[error("{0}")]
    Internal(String),
}

impl ApiError {
    /// The error's row of the table.
    pub(super) fn row(&self) -> Row<'_> {
        match self {
            Self::Service(error) => error.row(),
            Self::Edge(error) => error.row(),
            Self::Field(error) => error.row(),
            Self::Mmcp(fault) => fault.row(),
            Self::Malformed { message, field } => Row {
                field: field.as_deref(),
                description: Some(message.clone()),
                ..INVALID.because("MALFORMED_REQUEST")
            },
            Self::Truncated { limit_bytes, .. } => INVALID
                .because("MALFORMED_REQUEST")
                .field("body")
                .allowed(format!("a whole one, at most {limit_bytes} bytes")),
            Self::TooLarge { limit_bytes } => TOO_LARGE
                .because("REQUEST_TOO_LARGE")
                .field("body")
                .allowed(format!("at most {limit_bytes} bytes")),
            Self::WrongType { allowed, .. } => WRONG_TYPE
                .because("UNSUPPORTED_MEDIA_TYPE")
                .field("Content-Type")
                .allowed(*allowed),
            Self::UnknownRoute(_) => NO_ROUTE.because("UNKNOWN_ROUTE"),
            Self::WrongMethod(_) => NO_METHOD.because("WRONG_METHOD"),
            Self::DeadlineExceeded(_) => TOO_LATE.because("DEADLINE_EXCEEDED"),
            Self::Unimplemented(_) => UNIMPLEMENTED.because("UNIMPLEMENTED"),
            Self::Internal(_) => INTERNAL.because("INTERNAL"),
        }
    }
}

impl Tabled for ServiceError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Starting => UNAVAILABLE.because("NOT_READY"),
            Self::Store(_) => UNAVAILABLE.because("STORE_BEHIND"),
            Self::Space(error) => error.row(),
            Self::Field(error) => error.row(),
            Self::NotFeasible(error) => Row {
                reason: "NOT_FEASIBLE",
                ..error.0.row()
            },
            Self::UnknownPack(error) => error.row(),
            Self::CannotDo(error) => error.row(),
            Self::Life(error) => error.row(),
            Self::Skeleton(error) => error.row(),
            Self::World(error) => error.row(),
            Self::Session(error) => error.row(),
            Self::Batch(error) => error.row(),
            Self::Frames(error) => error.row(),
            Self::Stopped(error) => error.row(),
        }
    }
}

/// The text of a service error. A stopped engine is reported as a failure of the whole server.
fn message(error: &ServiceError) -> String {
    match error {
        ServiceError::Batch(SubmitError::Engine(EngineError::Stopped)) => {
            "the server is broken: an engine has stopped".to_owned()
        }
        error => error.to_string(),
    }
}

impl From<Exhausted> for ApiError {
    fn from(error: Exhausted) -> Self {
        EdgeError::from(error).into()
    }
}

impl From<ServiceError> for ApiError {
    /// A missed deadline is one error, whether the queue or the edge noticed it.
    fn from(error: ServiceError) -> Self {
        match error {
            ServiceError::Batch(SubmitError::DeadlinePassed { waited }) => Self::DeadlineExceeded(waited),
            error => Self::Service(Box::new(error)),
        }
    }
}

impl From<SessionError> for ApiError {
    fn from(error: SessionError) -> Self {
        ServiceError::from(error).into()
    }
}

impl From<WorldError> for ApiError {
    fn from(error: WorldError) -> Self {
        ServiceError::from(error).into()
    }
}

/// A time limit in words, without a number if it is unknown or below a millisecond.
fn in_time(limit: &Duration) -> String {
    match limit.as_millis() {
        0 => "in time".to_owned(),
        limit => format!("within {limit} ms"),
    }
}

#[cfg(test)]
mod tests {
    use axum::response::IntoResponse as _;
    use http::StatusCode;
    use troupe_live::session::StoreBehind;

    use super::*;

    impl From<SubmitError> for ApiError {
        fn from(error: SubmitError) -> Self {
            ServiceError::from(error).into()
        }
    }

    #[test]
    fn a_store_that_is_behind_makes_the_server_unavailable_and_says_why() {
        let behind = StoreBehind {
            age: Duration::from_secs(7),
            reason: "the disk is full".to_owned(),
        };
        let error = ApiError::from(ServiceError::from(behind));
        assert_eq!(
            error.to_string(),
            "the store of sessions is 7 s behind, allowed: at most 5 s; the disk is full"
        );
        assert_eq!(error.into_response().status(), StatusCode::SERVICE_UNAVAILABLE);
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

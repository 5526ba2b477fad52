//! Every error of the API, and the one place that says how it looks: gRPC code and details, HTTP
//! status and body, metric label.
//!
//! The layers below have errors of their own. Each has its lines of the table ([`row`]) in a file
//! of its domain: [`edge`], [`batch`], [`world`], [`session`]; those of the API itself are here. [`form`]
//! makes answers of them.

mod batch;
mod edge;
mod form;
mod mmcp;
mod row;
mod session;
mod world;

use std::time::Duration;

use crate::mmcp::Fault;
use crate::service::ServiceError;
use row::{
    FULL, INTERNAL, INVALID, NO_METHOD, NO_ROUTE, Row, TOO_LARGE, TOO_LATE, Tabled, UNAVAILABLE,
    UNIMPLEMENTED, WRONG_TYPE,
};
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_edge::EdgeError;
use troupe_edge::clients::Exhausted;
use troupe_engine::EngineError;
use troupe_live::session::SessionError;
use troupe_live::world::WorldError;

pub(super) use form::CodeLabel;
pub use form::{ErrorBody, ErrorDetail};

/// The domain of this API's errors in `google.rpc.ErrorInfo`.
const DOMAIN: &str = "troupe.v1";

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// A request that could be read, but was not served.
    #[error("{}", message(.0))]
    Service(Box<ServiceError>),
    /// A request that the edge turns away.
    #[error(transparent)]
    Edge(#[from] EdgeError),
    /// A value that the API itself does not accept.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A request of the Motion Model Context Protocol that is not accepted.
    #[error(transparent)]
    Mmcp(Box<Fault>),
    /// A body that is not a request: truncated, no protobuf, no JSON, or with a field of the wrong
    /// form.
    #[error("the request cannot be read: {message}")]
    Malformed {
        /// What is wrong with it.
        message: String,
        /// The field, where it is known.
        field: Option<String>,
    },
    /// A body that ends before its message does.
    #[error("the body is truncated: {problem}; allowed: a whole message of at most {limit_bytes} bytes")]
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
    /// A body that is not said to be JSON. Pages of other sites may send any other without asking
    /// the server first.
    #[error("Content-Type is {found:?}; allowed: application/json")]
    WrongType {
        /// What it is said to be.
        found: String,
    },
    /// No such route or method.
    #[error("there is no {0}")]
    UnknownRoute(String),
    /// A route that exists, under another HTTP method.
    #[error("this path does not answer {0}")]
    WrongMethod(String),
    /// The time for the request ran out.
    #[error("the request was not served {}", in_time(.0))]
    DeadlineExceeded(Duration),
    /// A feature of gRPC that the server does not speak, such as a compression.
    #[error("{0}")]
    Unimplemented(String),
    /// The API's own fault.
    #[error("{0}")]
    Internal(String),
}

impl ApiError {
    /// What it is to a caller.
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
                .allowed(format!("a whole message of at most {limit_bytes} bytes")),
            Self::TooLarge { limit_bytes } => TOO_LARGE
                .because("REQUEST_TOO_LARGE")
                .field("body")
                .allowed(format!("at most {limit_bytes} bytes")),
            Self::WrongType { .. } => WRONG_TYPE
                .because("UNSUPPORTED_MEDIA_TYPE")
                .field("Content-Type")
                .allowed("application/json"),
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
            Self::TooManyTenants { most } => FULL
                .because("TOO_MANY_TENANTS")
                .allowed(format!("at most {most} at a time (max_tenants)")),
            Self::Tenant => INTERNAL.because("TENANT_NOT_READ"),
            Self::Field(error) => error.row(),
            Self::NotFeasible(error) => Row {
                reason: "NOT_FEASIBLE",
                ..error.0.row()
            },
            Self::UnknownPack(error) => error.row(),
            Self::CannotDo(error) => error.row(),
            Self::World(error) => error.row(),
            Self::Session(error) => error.row(),
            Self::Batch(error) => error.row(),
            Self::Frames(error) => error.row(),
            Self::Stopped(error) => error.row(),
        }
    }
}

/// What the error says. That an engine has stopped is, to a caller, about the whole server.
fn message(error: &ServiceError) -> String {
    match error {
        ServiceError::Batch(SubmitError::Engine(EngineError::Stopped))
        | ServiceError::Session(SessionError::Plan(SubmitError::Engine(EngineError::Stopped))) => {
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
    fn from(error: ServiceError) -> Self {
        Self::Service(Box::new(error))
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

/// A time limit in words; one below a millisecond, or that is not known, has no number.
fn in_time(limit: &Duration) -> String {
    match limit.as_millis() {
        0 => "in time".to_owned(),
        limit => format!("within {limit} ms"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl From<SubmitError> for ApiError {
        fn from(error: SubmitError) -> Self {
            ServiceError::from(error).into()
        }
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

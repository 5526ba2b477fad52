//! Every error of the API, and the one place that says how it looks: gRPC code and details, HTTP
//! status and body, metric label.
//!
//! The layers below have errors of their own. Each has its lines of the table ([`row`]) in a file
//! of its domain: [`batch`], [`world`], [`session`]; those of the edge itself are here. [`form`]
//! makes answers of them.

mod batch;
mod form;
mod mmcp;
mod row;
mod session;
mod world;

use std::time::Duration;

use super::head::MAX_HEAD_BYTES;
use super::tokens::TokenError;
use crate::clients::{Exhausted, Role};
use crate::mmcp::Fault;
use crate::service::ServiceError;
use row::{
    FORBIDDEN, FULL, HEADERS, INTERNAL, INVALID, NO_METHOD, NO_ROUTE, NOT_NOW, Row, TOO_LARGE, TOO_LATE,
    Tabled, UNAUTHENTICATED, UNAVAILABLE, UNIMPLEMENTED, WRONG_TYPE,
};
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_engine::EngineError;
use troupe_live::session::SessionError;
use troupe_live::world::WorldError;

pub(super) use form::{CodeLabel, is_grpc};
pub use form::{ErrorBody, ErrorDetail};

/// The domain of this API's errors in `google.rpc.ErrorInfo`.
const DOMAIN: &str = "troupe.v1";

/// When to try again where a place may be free at any time: of a connection, or of what is on its
/// way.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// How a key is sent.
const BEARER: &str = "Bearer and a key";

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// A request that could be read, but was not served.
    #[error("{}", message(.0))]
    Service(Box<ServiceError>),
    /// A value that the edge itself does not accept.
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
    /// Headers over the limit.
    #[error(
        "the headers take {found_bytes} bytes, 32 for each included; allowed: at most {MAX_HEAD_BYTES} bytes"
    )]
    HeadersTooLarge {
        /// How many there are.
        found_bytes: usize,
    },
    /// A client, an address or all clients have too much on their way.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// A body that is not said to be JSON. Pages of other sites may send any other without asking
    /// the server first.
    #[error("Content-Type is {found:?}; allowed: application/json")]
    WrongType {
        /// What it is said to be.
        found: String,
    },
    /// A web page of another site, or a name that is not the server's.
    #[error("{header} {found:?} is not allowed; allowed: {allowed}")]
    NotAllowed {
        /// The header that says so.
        header: &'static str,
        /// Its value.
        found: String,
        /// Which values are allowed.
        allowed: &'static str,
    },
    /// A call without a key.
    #[error("Authorization is missing, and the server asks for a key; allowed: {BEARER}")]
    NoKey,
    /// A key that the server does not know.
    #[error("Authorization has a key that the server does not know; allowed: {BEARER}")]
    UnknownKey,
    /// A token that does not count.
    #[error("Authorization has a token that does not count: {0}")]
    Token(TokenError),
    /// A ticket that is used up, late or made up.
    #[error(
        "ticket is not one that is open; allowed: one of POST /v1/tickets that is not used yet and younger than 30 s"
    )]
    UnknownTicket,
    /// A client with too many tickets.
    #[error("{whose} has no room for another ticket; allowed at a time: {most} that are not used yet")]
    TooManyTickets {
        /// Whose limit it is.
        whose: &'static str,
        /// The limit.
        most: usize,
    },
    /// A ticket where none is needed.
    #[error("the server asks for no keys, so a stream needs no ticket")]
    NoTickets,
    /// A key that allows less.
    #[error("the key's role is {}; allowed: {}", role.name(), needed.and_above())]
    RoleTooLow {
        /// What it is.
        role: Role,
        /// What the call needs.
        needed: Role,
    },
    /// A connection beyond the limit.
    #[error("the server has no room for another connection; try again in a moment")]
    NoConnection,
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
    /// The edge's own fault.
    #[error("{0}")]
    Internal(String),
}

impl ApiError {
    /// What it is to a caller.
    pub(super) fn row(&self) -> Row<'_> {
        match self {
            Self::Service(error) => error.row(),
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
            Self::HeadersTooLarge { .. } => HEADERS
                .because("HEADERS_TOO_LARGE")
                .field("headers")
                .allowed(format!("at most {MAX_HEAD_BYTES} bytes")),
            Self::Exhausted(error) => {
                let row = FULL.because("CLIENT_LIMIT").allowed(error.allowed.as_str());
                match error.never {
                    true => row,
                    false => row.retry_after(RETRY_AFTER),
                }
            }
            Self::WrongType { .. } => WRONG_TYPE
                .because("UNSUPPORTED_MEDIA_TYPE")
                .field("Content-Type")
                .allowed("application/json"),
            Self::NotAllowed { header, allowed, .. } => {
                FORBIDDEN.because("NOT_ALLOWED").field(header).allowed(*allowed)
            }
            Self::NoKey | Self::UnknownKey => {
                let reason = match self {
                    Self::NoKey => "KEY_MISSING",
                    _ => "KEY_UNKNOWN",
                };
                UNAUTHENTICATED
                    .because(reason)
                    .field("Authorization")
                    .allowed(BEARER)
            }
            Self::Token(_) => UNAUTHENTICATED
                .because("TOKEN_INVALID")
                .field("Authorization")
                .allowed(BEARER),
            Self::UnknownTicket => UNAUTHENTICATED
                .because("TICKET_UNKNOWN")
                .field("ticket")
                .allowed("a ticket of POST /v1/tickets, once and within 30 s"),
            Self::TooManyTickets { most, .. } => FULL
                .because("TOO_MANY_TICKETS")
                .allowed(format!("{most} that are not used yet"))
                .retry_after(RETRY_AFTER),
            Self::NoTickets => NOT_NOW.because("NO_KEYS"),
            Self::RoleTooLow { needed, .. } => FORBIDDEN
                .because("ROLE_TOO_LOW")
                .field("Authorization")
                .allowed(needed.and_above()),
            Self::NoConnection => UNAVAILABLE
                .because("TOO_MANY_CONNECTIONS")
                .retry_after(RETRY_AFTER),
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

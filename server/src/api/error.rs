//! Every error of the API, and the one place that maps it to gRPC code and details, HTTP status and
//! body, MMCP code and metric label.
//!
//! The layers below have errors of their own. Their rows of the table ([`row`]) are in a file for
//! each domain: [`batch`], [`world`], [`session`]. The rows of the edge itself are here. [`form`]
//! makes answers from them, and [`mmcp`] the answers of that protocol.

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

/// When to try again if room for a connection, a request or a ticket may be free at any time.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Form of the Authorization header.
const BEARER: &str = "Bearer and a key";

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// A request was read, but not served.
    #[error("{}", message(.0))]
    Service(Box<ServiceError>),
    /// The edge itself does not accept a value.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A request of the Motion Model Context Protocol is not accepted.
    #[error(transparent)]
    Mmcp(Box<Fault>),
    /// A body is not a request: no protobuf, no JSON, or a field has the wrong form.
    #[error("the request cannot be read: {message}")]
    Malformed {
        /// The parser's text.
        message: String,
        /// Path of the field, if it is known.
        field: Option<String>,
    },
    /// A body ends before its message does.
    #[error("the body is truncated: {problem}; allowed: a whole one, at most {limit_bytes} bytes")]
    Truncated {
        /// The parser's text.
        problem: String,
        /// Most bytes of a whole body.
        limit_bytes: usize,
    },
    /// A body is over the limit.
    #[error("the request is too large; allowed: at most {limit_bytes} bytes")]
    TooLarge {
        /// Most bytes of a body.
        limit_bytes: usize,
    },
    /// Headers are over the limit.
    #[error(
        "the headers take {found_bytes} bytes, 32 for each included; allowed: at most {MAX_HEAD_BYTES} bytes"
    )]
    HeadersTooLarge {
        /// Bytes of the headers, and 32 for each.
        found_bytes: usize,
    },
    /// A client, an address or all clients have too many bytes or streams.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// The Content-Type is not JSON. Web pages of other sites can send such bodies without a
    /// preflight request.
    #[error("Content-Type is {found:?}; allowed: application/json")]
    WrongType {
        /// The Content-Type, cut.
        found: String,
    },
    /// The request comes from a web page of another site, or is for another host.
    #[error("{header} {found:?} is not allowed; allowed: {allowed}")]
    NotAllowed {
        /// Name of the header.
        header: &'static str,
        /// The header's value.
        found: String,
        /// The values that the server accepts.
        allowed: &'static str,
    },
    /// A call has no key.
    #[error("Authorization is missing, and the server asks for a key; allowed: {BEARER}")]
    NoKey,
    /// The server does not know the key.
    #[error("Authorization has a key that the server does not know; allowed: {BEARER}")]
    UnknownKey,
    /// The token is not valid.
    #[error("Authorization has a token that is not valid: {0}")]
    Token(TokenError),
    /// The ticket is used, too old or unknown.
    #[error(
        "the ticket is unknown, used or too old; allowed: a ticket of POST /v1/tickets, once and within 30 s"
    )]
    UnknownTicket,
    /// A client has too many tickets.
    #[error("{whose} has no room for another ticket; allowed: {most} unused ones")]
    TooManyTickets {
        /// The client or all clients.
        whose: &'static str,
        /// Most unused tickets.
        most: usize,
    },
    /// A ticket was requested from a server without keys.
    #[error("the server asks for no keys, so a stream needs no ticket")]
    NoTickets,
    /// The key's role does not allow the call.
    #[error("the key's role is {}; allowed: {}", role.name(), needed.and_above())]
    RoleTooLow {
        /// Role of the key.
        role: Role,
        /// Lowest role for the call.
        needed: Role,
    },
    /// The connection is beyond the limit.
    #[error("the server has no room for another connection; try again in a moment")]
    NoConnection,
    /// There is no such path or gRPC method.
    #[error("there is no {0}")]
    UnknownRoute(String),
    /// The path has another HTTP method.
    #[error("this path does not answer {0}")]
    WrongMethod(String),
    /// The request was not served in time, in the queue or at the edge.
    #[error("the request was not served {}", in_time(.0))]
    DeadlineExceeded(Duration),
    /// The server does not support a feature of gRPC, such as a compression.
    #[error("{0}")]
    Unimplemented(String),
    /// The edge itself failed.
    #[error("{0}")]
    Internal(String),
}

impl ApiError {
    /// The error's row of the table.
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
                .allowed(format!("a whole one, at most {limit_bytes} bytes")),
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
                .allowed(format!("{most} unused ones"))
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
            Self::Space(error) => error.row(),
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

/// The error's text. A stopped engine concerns the whole server.
fn message(error: &ServiceError) -> String {
    match error {
        ServiceError::Batch(SubmitError::Engine(EngineError::Stopped)) => {
            "the server is broken: an engine has stopped".to_owned()
        }
        error => error.to_string(),
    }
}

impl From<ServiceError> for ApiError {
    /// A deadline is one error, whether the queue or the edge noticed it.
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

/// A time limit in words. Without a number if it is unknown or below a millisecond.
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

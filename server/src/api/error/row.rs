//! Rows of the error table.

use std::time::Duration;

use http::StatusCode;
use tonic::Code;
use troupe_character::FieldError;

/// gRPC code, HTTP status, and the code's name in JSON and metrics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::api) struct Codes {
    pub(in crate::api) grpc: Code,
    pub(in crate::api) http: StatusCode,
    pub(in crate::api) label: &'static str,
}

const fn codes(grpc: Code, http: StatusCode, label: &'static str) -> Codes {
    Codes { grpc, http, label }
}

pub(super) const INVALID: Codes = codes(Code::InvalidArgument, StatusCode::BAD_REQUEST, "INVALID_ARGUMENT");
pub(super) const NOT_FOUND: Codes = codes(Code::NotFound, StatusCode::NOT_FOUND, "NOT_FOUND");
pub(super) const GONE: Codes = codes(Code::NotFound, StatusCode::GONE, "NOT_FOUND");
pub(super) const EXISTS: Codes = codes(Code::AlreadyExists, StatusCode::CONFLICT, "ALREADY_EXISTS");
/// The current state does not allow the request.
pub(super) const NOT_NOW: Codes = codes(
    Code::FailedPrecondition,
    StatusCode::CONFLICT,
    "FAILED_PRECONDITION",
);
/// Another server serves what the request is about.
pub(super) const MISDIRECTED: Codes = codes(
    Code::FailedPrecondition,
    StatusCode::MISDIRECTED_REQUEST,
    "FAILED_PRECONDITION",
);
pub(super) const FULL: Codes = codes(
    Code::ResourceExhausted,
    StatusCode::TOO_MANY_REQUESTS,
    "RESOURCE_EXHAUSTED",
);
pub(super) const TOO_LARGE: Codes = codes(
    Code::ResourceExhausted,
    StatusCode::PAYLOAD_TOO_LARGE,
    "RESOURCE_EXHAUSTED",
);
pub(super) const HEADERS: Codes = codes(
    Code::ResourceExhausted,
    StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
    "RESOURCE_EXHAUSTED",
);
pub(super) const WRONG_TYPE: Codes = codes(
    Code::InvalidArgument,
    StatusCode::UNSUPPORTED_MEDIA_TYPE,
    "INVALID_ARGUMENT",
);
pub(super) const FORBIDDEN: Codes = codes(Code::PermissionDenied, StatusCode::FORBIDDEN, "PERMISSION_DENIED");
pub(super) const UNAUTHENTICATED: Codes =
    codes(Code::Unauthenticated, StatusCode::UNAUTHORIZED, "UNAUTHENTICATED");
pub(super) const ABORTED: Codes = codes(Code::Aborted, StatusCode::CONFLICT, "ABORTED");
pub(super) const TOO_LATE: Codes = codes(
    Code::DeadlineExceeded,
    StatusCode::GATEWAY_TIMEOUT,
    "DEADLINE_EXCEEDED",
);
pub(super) const UNAVAILABLE: Codes =
    codes(Code::Unavailable, StatusCode::SERVICE_UNAVAILABLE, "UNAVAILABLE");
pub(super) const INTERNAL: Codes = codes(Code::Internal, StatusCode::INTERNAL_SERVER_ERROR, "INTERNAL");
pub(super) const NO_ROUTE: Codes = codes(Code::Unimplemented, StatusCode::NOT_FOUND, "NOT_FOUND");
pub(super) const NO_METHOD: Codes = codes(
    Code::Unimplemented,
    StatusCode::METHOD_NOT_ALLOWED,
    "METHOD_NOT_ALLOWED",
);
pub(super) const UNIMPLEMENTED: Codes =
    codes(Code::Unimplemented, StatusCode::NOT_IMPLEMENTED, "UNIMPLEMENTED");

/// How an error looks to the caller.
#[derive(Debug)]
pub(in crate::api) struct Row<'a> {
    pub(in crate::api) codes: Codes,
    /// Kind of the error, finer than its code: the reason in `google.rpc.ErrorInfo`.
    pub(in crate::api) reason: &'static str,
    /// Path of the field, if one is at fault.
    pub(in crate::api) field: Option<&'a str>,
    /// Allowed values or sizes, if a field or size is at fault.
    pub(in crate::api) allowed: Option<String>,
    /// What is wrong with the field. None: the error's own text.
    pub(in crate::api) description: Option<String>,
    /// Line and column in a document, both from 1.
    pub(in crate::api) place: Option<(usize, usize)>,
    /// Time after which a new attempt may succeed.
    pub(in crate::api) retry_after: Option<Duration>,
}

/// An error with a row in the table.
pub(super) trait Tabled {
    /// The row, with the error's own field and values.
    fn row(&self) -> Row<'_>;
}

impl Codes {
    /// A row with these codes, a reason and nothing else.
    pub(super) fn because<'a>(self, reason: &'static str) -> Row<'a> {
        Row {
            codes: self,
            reason,
            field: None,
            allowed: None,
            description: None,
            place: None,
            retry_after: None,
        }
    }
}

impl<'a> Row<'a> {
    pub(super) fn field(self, field: &'a str) -> Self {
        Self {
            field: Some(field),
            ..self
        }
    }

    pub(super) fn allowed(self, allowed: impl Into<String>) -> Self {
        Self {
            allowed: Some(allowed.into()),
            ..self
        }
    }

    pub(super) fn retry_after(self, after: Duration) -> Self {
        Self {
            retry_after: Some(after),
            ..self
        }
    }
}

impl Tabled for FieldError {
    fn row(&self) -> Row<'_> {
        Row {
            description: Some(format!("{}; allowed: {}", self.message, self.allowed)),
            ..INVALID
                .because("INVALID_FIELD")
                .field(&self.field)
                .allowed(self.allowed.as_str())
        }
    }
}

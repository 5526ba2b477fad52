//! Errors of the Motion Model Context Protocol. This is the only place that maps our table to the
//! protocol's closed list of codes.

use axum::Json;
use axum::response::{IntoResponse as _, Response};
use http::{HeaderValue, StatusCode, header};
use serde_json::{Value, json};
use tonic::Code as Grpc;

use super::row::{INVALID, NOT_FOUND, Row, TOO_LARGE, Tabled};
use super::{ApiError, ErrorDetail};
use crate::mmcp::{Code, Failure, Fault};

impl Tabled for Fault {
    fn row(&self) -> Row<'_> {
        let row = match self.code {
            Code::UnknownModel => NOT_FOUND.because("UNKNOWN_PACK"),
            Code::PayloadTooLarge => TOO_LARGE.because("REQUEST_TOO_LARGE"),
            Code::UnsupportedConstraint | Code::UnsupportedSegment | Code::RetargetingUnsupported => {
                INVALID.because("PACK_CANNOT")
            }
            _ => INVALID.because("INVALID_FIELD"),
        };
        row.field(&self.place.field).allowed(self.place.allowed.as_str())
    }
}

impl From<Failure> for ApiError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Fault(fault) => Self::Mmcp(Box::new(fault)),
            Failure::Service(error) => Self::Service(error),
        }
    }
}

impl ApiError {
    /// The protocol's code for the error.
    fn mmcp_code(&self) -> Code {
        if let Self::Mmcp(fault) = self {
            return fault.code;
        }
        let Row { codes, reason, .. } = self.row();
        match (codes.grpc, reason) {
            (_, "UNKNOWN_PACK" | "UNKNOWN_BODY") => Code::UnknownModel,
            (_, "REQUEST_TOO_LARGE" | "HEADERS_TOO_LARGE") => Code::PayloadTooLarge,
            (_, "QUEUE_FULL" | "TOO_MANY_TENANTS") => Code::ResourceExhausted,
            (_, "PACK_CANNOT" | "WRONG_METHOD" | "UNKNOWN_ROUTE") => Code::InvalidRequest,
            (Grpc::InvalidArgument, _) => Code::SchemaValidation,
            (Grpc::Unauthenticated, _) => Code::Unauthorized,
            (Grpc::PermissionDenied, _) => Code::Forbidden,
            (Grpc::ResourceExhausted, _) => Code::RateLimited,
            (Grpc::Unavailable, _) => Code::ModelUnavailable,
            (Grpc::DeadlineExceeded, _) => Code::Timeout,
            (Grpc::Aborted, _) => Code::ResourceExhausted,
            (Grpc::NotFound | Grpc::FailedPrecondition | Grpc::AlreadyExists, _) => Code::InvalidRequest,
            _ => Code::InternalError,
        }
    }

    /// The error in the protocol's envelope, and its code.
    pub(in crate::api) fn envelope(&self) -> (Code, Value) {
        let code = self.mmcp_code();
        let ErrorDetail {
            message,
            field,
            allowed,
            retry_after_ms,
            request_id,
            ..
        } = self.body().error;
        let mut details = match self {
            Self::Mmcp(fault) => fault.details.clone(),
            _ => serde_json::Map::new(),
        };
        let more = [
            ("field", field.map(Value::from)),
            ("allowed", allowed.map(Value::from)),
            ("retry_after_ms", retry_after_ms.map(Value::from)),
            ("request_id", request_id.map(Value::from)),
        ];
        for (name, value) in more {
            details.extend(value.map(|value| (name.to_owned(), value)));
        }
        let envelope = json!({"error": {"code": code.name(), "message": message, "details": details}});
        (code, envelope)
    }

    /// Replaces the body of `answer` by this error in the protocol's form. Its other headers stay.
    pub(in crate::api) fn in_envelope(&self, answer: Response) -> Response {
        let (code, envelope) = self.envelope();
        let (mut parts, _) = answer.into_parts();
        parts.status = StatusCode::from_u16(code.status()).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        parts.headers.remove(header::CONTENT_LENGTH);
        let json = HeaderValue::from_static("application/json");
        parts.headers.insert(header::CONTENT_TYPE, json);
        let body = Json(envelope).into_response().into_body();
        Response::from_parts(parts, body)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use troupe_batch::SubmitError;
    use troupe_edge::EdgeError;
    use troupe_edge::clients::Role;
    use troupe_engine::EngineError;
    use troupe_service::ServiceError;

    #[test]
    fn every_error_is_one_of_the_list() {
        let full = SubmitError::QueueFull {
            pending_characters: 1,
            retry_after: Duration::from_millis(20),
        };
        let field = troupe_character::FieldError {
            field: "a".to_owned(),
            message: "is 1".to_owned(),
            allowed: "2".to_owned(),
        };
        let panicked = SubmitError::Engine(EngineError::Panicked("oh".to_owned()));
        for (error, code) in [
            (ApiError::Field(field), Code::SchemaValidation),
            (ApiError::TooLarge { limit_bytes: 1 }, Code::PayloadTooLarge),
            (
                ApiError::WrongType {
                    found: String::new(),
                    allowed: "application/json",
                },
                Code::SchemaValidation,
            ),
            (ApiError::WrongMethod("PUT".to_owned()), Code::InvalidRequest),
            (EdgeError::NoKey.into(), Code::Unauthorized),
            (
                EdgeError::RoleTooLow {
                    role: Role::Metrics,
                    needed: Role::Drive,
                }
                .into(),
                Code::Forbidden,
            ),
            (ApiError::DeadlineExceeded(Duration::ZERO), Code::Timeout),
            (ServiceError::Starting.into(), Code::ModelUnavailable),
            (ServiceError::from(full).into(), Code::ResourceExhausted),
            (ServiceError::from(panicked).into(), Code::InternalError),
            (ApiError::Internal(String::new()), Code::InternalError),
        ] {
            let (found, envelope) = error.envelope();
            assert_eq!(found, code, "{error}");
            assert_eq!(envelope["error"]["code"], code.name());
            assert!(envelope["error"]["details"].is_object());
        }
    }

    #[test]
    fn a_fault_keeps_its_code_and_details() {
        let fault = Fault::option("options.num_samples", "is 17", "1 to 16").with("most", 16);
        let error = ApiError::from(Failure::from(fault));
        let answer = error.in_envelope(error.clone().into_response());
        assert_eq!(answer.status(), 400);
        let (code, envelope) = error.envelope();
        assert_eq!(code, Code::InvalidOptions);
        let details = &envelope["error"]["details"];
        assert_eq!(
            (&details["field"], &details["most"]),
            (&"options.num_samples".into(), &16.into())
        );
    }
}

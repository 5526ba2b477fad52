//! Forms of an error: JSON, part of an answer, gRPC status.

use std::time::Duration;

use axum::Json;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use http::{HeaderMap, HeaderValue, StatusCode, header};
use serde::{Deserialize, Serialize};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};
use troupe_proto::v1;
use utoipa::ToSchema;

use super::row::Row;
use super::{ApiError, DOMAIN};
use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_base::telemetry::RequestContext;
use troupe_edge::is_grpc;

impl ApiError {
    /// Code name for metrics.
    pub(in crate::api) fn label(&self) -> &'static str {
        self.row().codes.label
    }

    /// The error as JSON.
    pub fn body(&self) -> ErrorBody {
        let Row {
            codes,
            reason,
            field,
            allowed,
            place,
            retry_after,
            ..
        } = self.row();
        ErrorBody {
            error: ErrorDetail {
                code: codes.label.to_owned(),
                reason: reason.to_owned(),
                message: self.to_string(),
                field: field.map(str::to_owned),
                allowed,
                line: place.map(|(line, _)| line as u32),
                column: place.map(|(_, column)| column as u32),
                retry_after_ms: retry_after.map(|after| after.as_millis() as u64),
                request_id: RequestContext::current().map(|request| request.id.to_string()),
            },
        }
    }

    /// The error as one part of an answer that also holds results.
    pub(in crate::api) fn problem(&self) -> v1::Problem {
        let Row {
            reason,
            field,
            allowed,
            ..
        } = self.row();
        v1::Problem {
            reason: reason.to_owned(),
            message: self.to_string(),
            field: field.unwrap_or_default().to_owned(),
            allowed: allowed.unwrap_or_default(),
        }
    }

    /// The error as a gRPC status with `google.rpc` details.
    pub fn status(&self) -> Status {
        let Row {
            codes,
            reason,
            field,
            allowed,
            description,
            place,
            retry_after,
        } = self.row();
        let mut details = ErrorDetails::new();
        let mut metadata = std::collections::HashMap::new();
        metadata.extend(field.map(|field| ("field".to_owned(), field.to_owned())));
        metadata.extend(allowed.map(|allowed| ("allowed".to_owned(), allowed)));
        if let Some((line, column)) = place {
            metadata.insert("line".to_owned(), line.to_string());
            metadata.insert("column".to_owned(), column.to_string());
        }
        details.set_error_info(reason, DOMAIN, metadata);
        if let (Code::InvalidArgument, Some(field)) = (codes.grpc, field) {
            let description = description.unwrap_or_else(|| self.to_string());
            details.add_bad_request_violation(field, description);
        }
        if retry_after.is_some() {
            details.set_retry_info(retry_after);
        }
        if let Some(request) = RequestContext::current() {
            details.set_request_info(request.id.as_str(), "");
        }
        let mut status = Status::with_error_details(codes.grpc, self.to_string(), details);
        status.set_source(std::sync::Arc::new(self.clone()));
        status
    }

    /// The answer in the protocol of the request with the headers `asked`.
    pub(in crate::api) fn in_kind(&self, asked: &HeaderMap) -> Response {
        self.in_protocol(is_grpc(asked))
    }

    /// The answer over gRPC if `grpc`, otherwise over HTTP.
    pub(in crate::api) fn in_protocol(&self, grpc: bool) -> Response {
        match grpc {
            true => self.status().into_http::<Body>(),
            false => self.clone().into_response(),
        }
    }

    /// The error behind a gRPC status. The status comes from us or from the gRPC library, which
    /// makes one for requests that it cannot read.
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
            // The library reports requests that it cannot read as internal errors.
            _ if message.contains("EOF") => Self::Truncated {
                problem: "its message is not whole".to_owned(),
                limit_bytes,
            },
            _ => Self::Malformed { message, field: None },
        }
    }
}

/// Code label of an answer, for metrics.
#[derive(Debug, Clone, Copy)]
pub(in crate::api) struct CodeLabel(pub(in crate::api) &'static str);

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let Row {
            codes, retry_after, ..
        } = self.row();
        let mut response = (codes.http, Json(self.body())).into_response();
        if let Some(after) = retry_after {
            // The header holds whole seconds, the body milliseconds.
            let seconds = after.as_millis().div_ceil(1000).max(1) as u64;
            response
                .headers_mut()
                .insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if codes.http == StatusCode::UNAUTHORIZED {
            let challenge = HeaderValue::from_static("Bearer");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, challenge);
        }
        response.extensions_mut().insert(CodeLabel(codes.label));
        // Routes with another form of errors read it from here.
        response.extensions_mut().insert(self);
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
    /// Name of the gRPC code, such as `INVALID_ARGUMENT`.
    pub code: String,
    /// A word for the kind of error, finer than its code, such as `SESSION_EXPIRED`.
    #[serde(default)]
    pub reason: String,
    /// What went wrong, for people.
    pub message: String,
    /// Path of the field, such as `characters[0].context[2].pose.rotations[8]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Allowed values of the field, such as `12 to 64`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub allowed: Option<String>,
    /// Line of a document, from 1, if the error is in one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<u32>,
    /// Column in that line, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<u32>,
    /// Time after which a new attempt may succeed, in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_ms: Option<u64>,
    /// The request's id, as in the header `x-request-id`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request_id: Option<String>,
}

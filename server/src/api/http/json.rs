//! Messages as JSON.

use std::sync::Arc;
use std::time::Instant;

use axum::body::{Bytes, HttpBody as _};
use axum::extract::{FromRequest, Request};
use axum::response::{IntoResponse as _, Response};
use http::{HeaderMap, StatusCode, header};
use serde::Serialize;
use troupe_proto::rpc::{self, JsonError};

use crate::api::error::ApiError;
use crate::api::shape::Shapes;
use troupe_base::echo::{MAX_MESSAGE, MAX_PATH, cut};
use troupe_base::offload::WorkerStopped;
use troupe_base::telemetry::RequestContext;
use troupe_character::document::plain;
use troupe_service::ServiceError;

/// Field name in errors about the whole body.
const BODY: &str = "body";

/// Limits of a body. `DefaultBodyLimit` enforces `bytes`, and errors state the limits.
#[derive(Clone)]
pub(in crate::api) struct BodyLimits {
    pub(in crate::api) bytes: usize,
    pub(in crate::api) shapes: Arc<Shapes>,
}

/// Reads a message. Errors name the field by its path.
pub(in crate::api) fn read<T: rpc::Request>(bytes: &[u8], limits: &BodyLimits) -> Result<T, ApiError> {
    check_start(bytes)?;
    if let Some(shape) = limits.shapes.of(T::RPC) {
        shape.check_json(bytes)?;
    }
    T::from_json(bytes).map_err(|error| match error {
        JsonError::Truncated(cause) => ApiError::Truncated {
            problem: cause.to_string(),
            limit_bytes: limits.bytes,
        },
        JsonError::Field { path, cause } => ApiError::Malformed {
            message: cut(&plain(&cause.to_string()), MAX_MESSAGE),
            field: Some(cut(&field_at_fault(&path, &cause.to_string()), MAX_PATH)),
        },
        JsonError::Trailing(cause) => not_json(format!("{cause}; allowed: one JSON object")),
    })
}

fn not_json(message: String) -> ApiError {
    ApiError::Malformed {
        message,
        field: Some(BODY.to_owned()),
    }
}

/// Rejects a body that starts with a byte order mark, a gzip header or an array.
fn check_start(bytes: &[u8]) -> Result<(), ApiError> {
    let wrong = match bytes {
        [0xef, 0xbb, 0xbf, ..] => "it begins with a byte order mark; allowed: UTF-8 without one",
        [0x1f, 0x8b, ..] => "it is compressed (gzip); allowed: JSON as it is",
        _ if bytes.trim_ascii_start().first() == Some(&b'[') => "it is an array; allowed: a JSON object",
        _ => return Ok(()),
    };
    Err(not_json(wrong.to_owned()))
}

/// Path of the field at fault. The path includes an unknown, duplicate or missing field. Without a
/// path the error is about the body.
fn field_at_fault(path: &str, message: &str) -> String {
    let kinds = ["unknown field `", "duplicate field `", "missing field `"];
    let rest = kinds.iter().find_map(|kind| message.strip_prefix(kind));
    // An empty name adds nothing to the path.
    let name = rest.and_then(|rest| rest.split('`').next());
    let name = name.filter(|name| !name.is_empty());
    let place = if path == "." { "" } else { path };
    match name {
        // Some paths include the name already.
        Some(name) if place.is_empty() => name.to_owned(),
        Some(name) if place == name || place.ends_with(&format!(".{name}")) => place.to_owned(),
        Some(name) => format!("{place}.{name}"),
        None if place.is_empty() => BODY.to_owned(),
        None => place.to_owned(),
    }
}

/// Writes an answer as JSON on the pool for blocking work: a large one may take a second.
pub(in crate::api) async fn written<T: Serialize>(
    answer: impl FnOnce() -> T + Send + 'static,
) -> Result<Response, ApiError> {
    let begun = Instant::now();
    let written = tokio::task::spawn_blocking(move || serde_json::to_vec(&answer())).await;
    RequestContext::part("encode", begun, Vec::new);
    let json = written
        .map_err(|_| ServiceError::from(WorkerStopped))?
        .map_err(|error| ApiError::Internal(error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, "application/json")], json).into_response())
}

/// The Content-Type of a body, if it is not JSON.
fn wrong_type(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_TYPE);
    let text = value.map_or_else(Default::default, |value| {
        String::from_utf8_lossy(value.as_bytes())
    });
    let name = text
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase();
    let kind = name.strip_prefix("application/");
    let json = kind.is_some_and(|kind| kind == "json" || kind.ends_with("+json"));
    (!json).then(|| cut(&text, MAX_PATH))
}

/// The bytes of a body that must be JSON.
pub(in crate::api) async fn body<S: Send + Sync>(
    request: Request,
    state: &S,
    limits: &BodyLimits,
) -> Result<Bytes, ApiError> {
    let wrong = wrong_type(request.headers());
    if let Some(found) = wrong.filter(|_| !request.body().is_end_stream()) {
        let allowed = "application/json";
        return Err(ApiError::WrongType { found, allowed });
    }
    bytes(request, state, limits).await
}

/// The bytes of a body of any kind.
pub(in crate::api) async fn bytes<S: Send + Sync>(
    request: Request,
    state: &S,
    limits: &BodyLimits,
) -> Result<Bytes, ApiError> {
    let too_large = ApiError::TooLarge {
        limit_bytes: limits.bytes,
    };
    let bytes = Bytes::from_request(request, state).await.map_err(|rejection| {
        match rejection.into_response().status() {
            StatusCode::PAYLOAD_TOO_LARGE => too_large.clone(),
            _ => ApiError::Truncated {
                problem: "it is shorter than announced".to_owned(),
                limit_bytes: limits.bytes,
            },
        }
    })?;
    match bytes.len() <= limits.bytes {
        true => Ok(bytes),
        false => Err(too_large),
    }
}

/// A body that must be JSON.
pub(in crate::api) struct JsonBody<T>(pub(in crate::api) T);

impl<S: Send + Sync, T: rpc::Request> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let limits = request.extensions().get::<BodyLimits>().cloned();
        let limits = limits.ok_or_else(|| ApiError::Internal("no limits are set".to_owned()))?;
        let bytes = body(request, state, &limits).await?;
        read(&bytes, &limits).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_at_fault_has_a_name() {
        let unknown = |name: &str| format!("unknown field `{name}`, expected `pack`");
        for (path, name, field) in [
            (".", "x", "x"),
            ("a[1]", "x", "a[1].x"),
            ("a.x", "x", "a.x"),
            (".", "", "body"),
            ("a[1]", "", "a[1]"),
        ] {
            assert_eq!(field_at_fault(path, &unknown(name)), field, "{path} {name}");
        }
        assert_eq!(field_at_fault(".", "expected value"), "body");
    }
}

//! Messages as JSON. Errors name the field.

use std::sync::Arc;

use axum::body::{Bytes, HttpBody as _};
use axum::extract::{FromRequest, Request};
use axum::response::IntoResponse as _;
use http::{HeaderMap, StatusCode, header};
use serde::de::DeserializeOwned;
use troupe_proto::rpc;

use crate::api::error::ApiError;
use crate::api::shape::Shapes;
use crate::wire::{MAX_MESSAGE, MAX_PATH, cut};
use troupe_character::document::plain;

/// Limits of a body. `DefaultBodyLimit` enforces the bytes; here they are named in errors.
#[derive(Clone)]
pub(in crate::api) struct BodyLimits {
    pub(in crate::api) bytes: usize,
    pub(in crate::api) shapes: Arc<Shapes>,
}

/// Reads a message.
pub(in crate::api) fn read<T: rpc::Request + DeserializeOwned>(
    bytes: &[u8],
    limits: &BodyLimits,
) -> Result<T, ApiError> {
    if let Some(shape) = limits.shapes.of(T::RPC) {
        shape.check_json(bytes)?;
    }
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let (path, inner) = (error.path().to_string(), error.inner());
        if inner.is_eof() {
            return ApiError::Truncated {
                problem: inner.to_string(),
                limit_bytes: limits.bytes,
            };
        }
        ApiError::Malformed {
            message: cut(&plain(&inner.to_string()), MAX_MESSAGE),
            field: (path != ".").then(|| cut(&path, MAX_PATH)),
        }
    })?;
    json.end().map_err(|error| ApiError::Malformed {
        message: error.to_string(),
        field: None,
    })?;
    Ok(value)
}

/// What a body is said to be, where that is not JSON.
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

/// A JSON body, whose content type says so.
pub(in crate::api) struct JsonBody<T>(pub(in crate::api) T);

impl<S: Send + Sync, T: rpc::Request + DeserializeOwned> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let limits = request.extensions().get::<BodyLimits>().cloned();
        let limits = limits.ok_or_else(|| ApiError::Internal("no limits are set".to_owned()))?;
        let wrong = wrong_type(request.headers());
        if let Some(found) = wrong.filter(|_| !request.body().is_end_stream()) {
            return Err(ApiError::WrongType { found });
        }
        let bytes = Bytes::from_request(request, state).await.map_err(|rejection| {
            match rejection.into_response().status() {
                StatusCode::PAYLOAD_TOO_LARGE => ApiError::TooLarge {
                    limit_bytes: limits.bytes,
                },
                _ => ApiError::Truncated {
                    problem: "it is shorter than announced".to_owned(),
                    limit_bytes: limits.bytes,
                },
            }
        })?;
        read(&bytes, &limits).map(Self)
    }
}

//! `POST /v1/generate` and `POST /v1/describe`: the parts of an answer as lines of JSON.

use std::convert::Infallible;
use std::sync::Arc;

use axum::Extension;
use axum::body::Body;
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use http::header;
use serde::Serialize;
use troupe_proto::v1;

use super::json::JsonBody;
use crate::api::early;
use crate::api::error::ApiError;
use crate::api::ours::Ours;
use troupe_edge::clients::Client;
use troupe_service::{ServiceError, Streamed};

/// Content type of the answer: one JSON value per line.
pub(super) const LINES: &str = "application/x-ndjson";

/// Act out words, or follow a path
///
/// The server sends the parts of the answer while it makes them, one JSON object per line. The last
/// one has `is_last`. An error after the first part is a separate line with the member `error`, and
/// ends the answer. The `capabilities` of a pack list what it can do.
#[utoipa::path(
    post,
    path = "/v1/generate",
    operation_id = "Generate",
    tag = "motion",
    request_body = v1::GenerateRequest,
    responses(
        (status = 200, description = "The parts, one per line", body = v1::GenerateResponse, content_type = "application/x-ndjson"),
        (status = 400, description = "A value that is not accepted, a pack that cannot do it, or a body that is no request"),
        (status = 404, description = "No such pack"),
        (status = 429, description = "The queue is full, or too slow; see the Retry-After header"),
    )
)]
pub(crate) async fn generate(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::GenerateRequest>,
) -> Result<Response, ApiError> {
    let pack = request.pack.clone();
    let answer = service.generate(request).await;
    early::note(Some(&client), &pack, answer.as_ref().err());
    lines(answer?).await
}

/// Describe a motion in words, or as audio that goes with it
///
/// The server sends the parts of the answer while it makes them, one JSON object per line. The last
/// one has `is_last`. An error after the first part is a separate line with the member `error`, and
/// ends the answer. The `capabilities` of a pack list what it can do.
#[utoipa::path(
    post,
    path = "/v1/describe",
    operation_id = "Describe",
    tag = "motion",
    request_body = v1::DescribeRequest,
    responses(
        (status = 200, description = "The parts, one per line", body = v1::DescribeResponse, content_type = "application/x-ndjson"),
        (status = 400, description = "A value that is not accepted, a pack that cannot do it, or a body that is no request"),
        (status = 404, description = "No such pack"),
        (status = 429, description = "The queue is full, or too slow; see the Retry-After header"),
    )
)]
pub(crate) async fn describe(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::DescribeRequest>,
) -> Result<Response, ApiError> {
    let answer = service.describe(&request);
    early::note(Some(&client), &request.pack, answer.as_ref().err());
    lines(answer?).await
}

/// An answer with one part per line.
pub(super) async fn lines<A: Streamed>(mut answer: A) -> Result<Response, ApiError> {
    // An error before the first part becomes an answer with its own status.
    let first = match answer.next().await {
        Some(Ok(part)) => Some(part),
        Some(Err(error)) => return Err(error.into()),
        None => None,
    };
    let rest = futures_util::stream::unfold((first, answer), |(first, mut answer)| async {
        let part = match first {
            Some(part) => Ok(part),
            None => answer.next().await?,
        };
        Some((Ok::<_, Infallible>(line(part)), (None, answer)))
    });
    Ok(([(header::CONTENT_TYPE, LINES)], Body::from_stream(rest)).into_response())
}

fn line(part: Result<impl Serialize, ServiceError>) -> Bytes {
    let written = match part {
        Ok(part) => serde_json::to_vec(&part),
        Err(error) => serde_json::to_vec(&ApiError::from(error).body()),
    };
    // This cannot fail: numbers that are not finite were rejected before.
    let mut line = written.unwrap_or_default();
    line.push(b'\n');
    line.into()
}

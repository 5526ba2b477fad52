//! Recordings of sessions over HTTP.

use std::sync::Arc;

use axum::Extension;
use axum::response::{IntoResponse as _, Response};
use http::header;
use troupe_proto::v1;

use super::json::JsonBody;
use super::parts::{LINES, lines};
use super::{Named, named};
use crate::api::error::ApiError;
use crate::api::ours::Ours;
use troupe_edge::clients::Client;

/// The recording of a session, also for an hour after the session's end
///
/// The answer is the file that `troupe replay` plays: one JSON object per line.
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/recording",
    operation_id = "GetRecording",
    tag = "sessions",
    responses(
        (status = 200, description = "The lines so far", body = String, content_type = "application/x-ndjson"),
        (status = 404, description = "No session of this id was recorded"),
    )
)]
pub(in crate::api) async fn get(Ours(service): Ours, id: Named<String>) -> Result<Response, ApiError> {
    let request = v1::GetRecordingRequest {
        session_id: named("session_id", id)?,
    };
    let recording = service.sessions().recording(&request)?;
    Ok(([(header::CONTENT_TYPE, LINES)], recording.lines).into_response())
}

/// Play a recording again and compare its frames
///
/// The server sends parts while it plays, one JSON object per line. The last one has `is_last` and
/// the result. An error after the first part is a separate line with the member `error`, and ends
/// the answer.
#[utoipa::path(
    post,
    path = "/v1/replay",
    operation_id = "Replay",
    tag = "sessions",
    request_body = v1::ReplayRequest,
    responses(
        (status = 200, description = "The parts, one per line", body = v1::ReplayResponse, content_type = "application/x-ndjson"),
        (status = 400, description = "A body that is no recording, or one of a newer server"),
        (status = 404, description = "No such pack"),
        (status = 409, description = "The recording was made with another server, pack, engine, style or skeleton"),
        (status = 429, description = "As many recordings are played as may be at the same time"),
        (status = 503, description = "Not ready yet"),
    )
)]
pub(in crate::api) async fn replay(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::ReplayRequest>,
) -> Result<Response, ApiError> {
    lines(service.replay(request, client.turns())?).await
}

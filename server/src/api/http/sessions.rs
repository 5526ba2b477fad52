//! Sessions, commands, steps and styles over HTTP.

use std::sync::Arc;

use axum::response::Response;
use axum::{Extension, Json};
use serde::Deserialize;
use troupe_proto::v1;

use super::json::{self, JsonBody};
use super::{Asked, Named, asked, named};
use crate::api::answers;
use crate::api::error::ApiError;
use crate::api::opening;
use crate::api::ours::Ours;
use troupe_base::echo::cut;
use troupe_character::FieldError;
use troupe_edge::clients::Client;
use troupe_edge::traffic;

/// Open sessions, all or none
#[utoipa::path(
    post,
    path = "/v1/sessions",
    operation_id = "CreateSessions",
    tag = "sessions",
    request_body = v1::CreateSessionsRequest,
    responses(
        (status = 200, description = "The opened sessions", body = v1::CreateSessionsResponse),
        (status = 400, description = "A value that is not accepted, or a style that the pack does not have"),
        (status = 404, description = "No such pack"),
        (status = 409, description = "A session of that id is open"),
        (status = 429, description = "No room for that many sessions"),
        (status = 503, description = "Not ready yet"),
    )
)]
pub(in crate::api) async fn create(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::CreateSessionsRequest>,
) -> Result<Json<v1::CreateSessionsResponse>, ApiError> {
    Ok(Json(
        opening::create_sessions(&service, Some(&client), request).await?,
    ))
}

/// Resume sessions after a broken connection or a restart of the server
#[utoipa::path(
    post,
    path = "/v1/sessions/resume",
    operation_id = "ResumeSessions",
    tag = "sessions",
    request_body = v1::ResumeSessionsRequest,
    responses(
        (status = 200, description = "The state of the sessions, and which of them are gone", body = v1::ResumeSessionsResponse),
        (status = 400, description = "A list that is empty or too long"),
    )
)]
pub(in crate::api) async fn resume(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::ResumeSessionsRequest>,
) -> Result<Json<v1::ResumeSessionsResponse>, ApiError> {
    Ok(Json(answers::resumed(
        service.resume_sessions(request, client.turns()).await?,
    )))
}

/// The page of the list.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct Page {
    /// Most sessions to return: 1 to 1000. 0: 100.
    page_size: u32,
    /// next_page_token of the page before. Empty: the first page.
    page_token: String,
}

/// List open sessions by id
#[utoipa::path(
    get,
    path = "/v1/sessions",
    operation_id = "ListSessions",
    tag = "sessions",
    params(Page),
    responses((status = 200, description = "A page of sessions", body = v1::ListSessionsResponse))
)]
pub(in crate::api) async fn list(
    Ours(service): Ours,
    page: Asked<Page>,
) -> Result<Json<v1::ListSessionsResponse>, ApiError> {
    let Page {
        page_size,
        page_token,
    } = asked(page)?;
    let request = v1::ListSessionsRequest {
        page_size,
        page_token,
    };
    Ok(Json(service.sessions().list(&request)?))
}

/// Describe a session
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}",
    operation_id = "GetSession",
    tag = "sessions",
    responses(
        (status = 200, description = "The session", body = v1::Session),
        (status = 404, description = "No such session"),
        (status = 410, description = "The session has expired"),
    )
)]
pub(in crate::api) async fn get(
    Ours(service): Ours,
    id: Named<String>,
) -> Result<Json<v1::Session>, ApiError> {
    let (sessions, id) = (service.sessions(), named("id", id)?);
    sessions.bring([&id]).await;
    Ok(Json(sessions.get(&id)?))
}

/// Close a session, or do nothing if it is gone
#[utoipa::path(
    delete,
    path = "/v1/sessions/{id}",
    operation_id = "CloseSessions",
    tag = "sessions",
    responses(
        (status = 200, description = "How many were closed: 1 or 0", body = v1::CloseSessionsResponse),
        (status = 421, description = "Another server has the session"),
    )
)]
pub(in crate::api) async fn close(
    Ours(service): Ours,
    id: Named<String>,
) -> Result<Json<v1::CloseSessionsResponse>, ApiError> {
    let request = v1::CloseSessionsRequest {
        ids: vec![named("id", id)?],
    };
    let sessions = service.sessions();
    sessions.bring(&request.ids).await;
    Ok(Json(answers::closed(sessions.close(&request)?)))
}

/// How much of the future to return.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct Future {
    /// Most frames to return: 1 to 64. 0: all.
    frames: u32,
}

/// Look at a session's buffered future and the plan behind it
#[utoipa::path(
    get,
    path = "/v1/sessions/{id}/peek",
    operation_id = "Peek",
    tag = "sessions",
    params(Future),
    responses(
        (status = 200, description = "The future", body = v1::PeekResponse),
        (status = 404, description = "No such session"),
        (status = 410, description = "The session has expired"),
    )
)]
pub(in crate::api) async fn peek(
    Ours(service): Ours,
    id: Named<String>,
    future: Asked<Future>,
) -> Result<Json<v1::PeekResponse>, ApiError> {
    let request = v1::PeekRequest {
        session_id: named("id", id)?,
        frames: asked(future)?.frames,
    };
    let sessions = service.sessions();
    sessions.bring([&request.session_id]).await;
    Ok(Json(sessions.peek(&request)?))
}

/// Give commands to sessions
///
/// Each command has its own result. A refused command does not affect the others.
#[utoipa::path(
    post,
    path = "/v1/commands",
    operation_id = "Command",
    tag = "sessions",
    request_body = v1::CommandRequest,
    responses(
        (status = 200, description = "Results of the commands", body = v1::CommandResponse),
        (status = 400, description = "No commands, too many, or a body that is no request"),
    )
)]
pub(in crate::api) async fn command(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::CommandRequest>,
) -> Result<Json<v1::CommandResponse>, ApiError> {
    Ok(Json(answers::commands(
        service.sessions().command(request, client.turns()).await?,
    )))
}

/// Give commands and take the next frames
///
/// Waits for the plans that the frames need. Sessions that cannot be served are listed in
/// `problems`. If none can be served, the answer is the first session's error.
#[utoipa::path(
    post,
    path = "/v1/step",
    operation_id = "Step",
    tag = "sessions",
    request_body = v1::StepRequest,
    responses(
        (status = 200, description = "The next frames", body = v1::StepResponse),
        (status = 404, description = "None of the sessions is open"),
        (status = 409, description = "Other clients drive all of these sessions"),
        (status = 410, description = "The sessions have expired"),
        (status = 421, description = "Another server has the sessions: the one in `allowed`"),
        (status = 500, description = "Inference failed"),
        (status = 504, description = "Not served in time"),
    )
)]
pub(in crate::api) async fn step(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::StepRequest>,
) -> Result<Response, ApiError> {
    let sessions = service.sessions();
    sessions.bring(&request.session_ids).await;
    let plan = sessions.plan_step(&request)?;
    let bytes = plan.answer_bytes() * traffic::COPIES_AS_JSON;
    let reserved = traffic::reserve(Some(&client), bytes)?;
    let stepped = sessions.step(request, plan, client.turns()).await?;
    let mut response = json::written(move || answers::step(stepped)).await?;
    response.extensions_mut().insert(reserved);
    Ok(response)
}

/// The body whose styles are asked for.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct OfBody {
    /// Name of the body, for packs with several bodies. Empty: the default body.
    body: String,
}

/// List the locomotion styles of a pack, without their keyframes
#[utoipa::path(
    get,
    path = "/v1/packs/{name}/styles",
    operation_id = "ListStyles",
    tag = "styles",
    params(OfBody),
    responses(
        (status = 200, description = "All styles, sorted by name", body = v1::ListStylesResponse),
        (status = 404, description = "No such pack"),
    )
)]
pub(in crate::api) async fn list_styles(
    Ours(service): Ours,
    name: Named<String>,
    of: Asked<OfBody>,
) -> Result<Json<v1::ListStylesResponse>, ApiError> {
    let request = v1::ListStylesRequest {
        pack: named("name", name)?,
        body: asked(of)?.body,
    };
    Ok(Json(service.list_styles(&request)?))
}

/// One style with its keyframes
#[utoipa::path(
    get,
    path = "/v1/packs/{name}/styles/{style}",
    operation_id = "GetStyle",
    tag = "styles",
    params(OfBody),
    responses(
        (status = 200, description = "The style", body = v1::Style),
        (status = 400, description = "No such style"),
        (status = 404, description = "No such pack"),
    )
)]
pub(in crate::api) async fn get_style(
    Ours(service): Ours,
    names: Named<(String, String)>,
    of: Asked<OfBody>,
) -> Result<Json<v1::Style>, ApiError> {
    let (pack, style) = named("style", names)?;
    let body = asked(of)?.body;
    let request = v1::GetStyleRequest { pack, style, body };
    Ok(Json(service.get_style(&request)?))
}

/// Add a style to a pack, or replace one that was added
///
/// The name in the body must equal the name in the path, or be left out.
#[utoipa::path(
    put,
    path = "/v1/packs/{name}/styles/{style}",
    operation_id = "PutStyle",
    tag = "styles",
    params(OfBody),
    request_body = v1::Style,
    responses(
        (status = 200, description = "The style as it is now", body = v1::Style),
        (status = 400, description = "A value that is not accepted, or a body that is no style"),
        (status = 404, description = "No such pack"),
        (status = 409, description = "The style is one of the pack's own"),
    )
)]
pub(in crate::api) async fn put_style(
    Ours(service): Ours,
    names: Named<(String, String)>,
    of: Asked<OfBody>,
    JsonBody(style): JsonBody<v1::Style>,
) -> Result<Json<v1::Style>, ApiError> {
    let (pack, name) = named("style", names)?;
    if !style.name.is_empty() && style.name != name {
        return Err(FieldError {
            field: "style.name".to_owned(),
            message: format!(
                "is {:?}, but the path names {:?}",
                cut(&style.name, 64),
                cut(&name, 64)
            ),
            allowed: "the name in the path, or none".to_owned(),
        }
        .into());
    }
    let request = v1::PutStyleRequest {
        pack,
        style: Some(v1::Style { name, ..style }),
        body: asked(of)?.body,
    };
    Ok(Json(service.put_style(request).await?))
}

//! HTTP: the same messages as JSON, and what operators need.

pub(super) mod generate;
pub(super) mod json;
pub(super) mod scenes;
pub(super) mod sessions;

use std::sync::Arc;

use axum::body::Body;
use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use axum::{Json, Router, middleware};
use http::{HeaderMap, header};
use serde::de::DeserializeOwned;
use troupe_proto::v1;
use utoipa_swagger_ui::SwaggerUi;

use self::json::{BodyLimits, JsonBody};
use super::ApiLimits;
use super::error::{ApiError, ErrorBody};
use super::shape::Shapes;
use super::track::{self, Tracker};
use super::ws;
use crate::service::Service;
use crate::wire::{MAX_MESSAGE, cut};
use troupe_character::FieldError;

/// The HTTP routes.
pub(super) fn router(service: &Arc<Service>, limits: &ApiLimits) -> Router {
    let tracker = Arc::new(Tracker::new(service, limits));
    let body = BodyLimits {
        bytes: limits.message_bytes,
        shapes: Arc::new(Shapes::new(limits)),
    };
    let style = get(sessions::get_style).put(sessions::put_style);
    let scene = get(scenes::get).put(scenes::put).delete(scenes::delete);
    let object = get(scenes::get_object)
        .put(scenes::put_object)
        .delete(scenes::delete_object);
    let api = Router::new()
        .route("/v1/inbetween", post(in_between))
        .route("/v1/generate", post(generate::generate))
        .route("/v1/packs", get(list_packs))
        .route("/v1/packs/{name}", get(get_pack))
        .route("/v1/packs/{name}/styles", get(sessions::list_styles))
        .route("/v1/packs/{name}/styles/{style}", style)
        .route("/v1/sessions", post(sessions::create).get(sessions::list))
        .route("/v1/sessions/{id}", get(sessions::get).delete(sessions::close))
        .route("/v1/sessions/{id}/peek", get(sessions::peek))
        .route("/v1/commands", post(sessions::command))
        .route("/v1/step", post(sessions::step))
        .route("/v1/drive", get(ws::drive))
        .route("/v1/scenes", get(scenes::list))
        .route("/v1/scenes/{name}", scene)
        .route("/v1/scenes/{name}/add", post(scenes::add))
        .route("/v1/scenes/{name}/move", post(scenes::move_objects))
        .route("/v1/scenes/{name}/remove", post(scenes::remove))
        .route("/v1/objects", get(scenes::list_objects))
        .route("/v1/objects/{name}", object)
        .route("/v1/detect", post(scenes::detect))
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state(tracker, track::http))
        .layer(DefaultBodyLimit::max(limits.message_bytes))
        .layer(axum::Extension(body))
        .with_state(service.clone());
    let operations = Router::new()
        .route("/healthz", get(healthz))
        .route("/readyz", get(readyz))
        .route("/metrics", get(metrics))
        .route("/", get(|| async { Redirect::temporary("/docs/") }))
        .method_not_allowed_fallback(wrong_method)
        .with_state(service.clone());
    let docs = SwaggerUi::new("/docs")
        .url("/openapi.json", super::openapi::document())
        // The page must not ask anybody else: by default it has a public validator draw a badge.
        .config(utoipa_swagger_ui::Config::from("/openapi.json").validator_url("none"));
    api.merge(operations).merge(docs)
}

/// Fill the gap between context frames and target keyframes
///
/// One request may carry many characters; they are served together with those of other callers.
#[utoipa::path(
    post,
    path = "/v1/inbetween",
    tag = "motion",
    request_body = v1::InBetweenRequest,
    responses(
        (status = 200, description = "The generated motion", body = v1::InBetweenResponse),
        (status = 400, description = "A value that is not accepted, or a body that is no request", body = ErrorBody),
        (status = 404, description = "No such pack", body = ErrorBody),
        (status = 413, description = "The body is too large", body = ErrorBody),
        (status = 429, description = "The queue is full, or too slow; see the Retry-After header", body = ErrorBody),
        (status = 500, description = "Inference failed", body = ErrorBody),
        (status = 503, description = "Not ready yet", body = ErrorBody),
        (status = 504, description = "Not served in time", body = ErrorBody),
    )
)]
pub(super) async fn in_between(
    State(service): State<Arc<Service>>,
    JsonBody(request): JsonBody<v1::InBetweenRequest>,
) -> Result<Json<v1::InBetweenResponse>, ApiError> {
    Ok(Json(service.in_between(request).await?))
}

/// List the model packs that this server has loaded
#[utoipa::path(
    get,
    path = "/v1/packs",
    tag = "motion",
    responses(
        (status = 200, description = "All packs, sorted by name", body = v1::ListPacksResponse),
        (status = 503, description = "Not ready yet", body = ErrorBody),
    )
)]
pub(super) async fn list_packs(
    State(service): State<Arc<Service>>,
) -> Result<Json<v1::ListPacksResponse>, ApiError> {
    Ok(Json(service.list_packs()?))
}

/// Describe one pack: skeleton, limits, licence, training and evaluation figures
#[utoipa::path(
    get,
    path = "/v1/packs/{name}",
    tag = "motion",
    params(("name" = String, Path, description = "The pack's name")),
    responses(
        (status = 200, description = "The pack", body = v1::Pack),
        (status = 400, description = "The name is no text", body = ErrorBody),
        (status = 404, description = "No such pack", body = ErrorBody),
        (status = 503, description = "Not ready yet", body = ErrorBody),
    )
)]
pub(super) async fn get_pack(
    State(service): State<Arc<Service>>,
    name: Result<Path<String>, PathRejection>,
) -> Result<Json<v1::Pack>, ApiError> {
    Ok(Json(service.get_pack(&named("name", name)?)?))
}

type Named<T> = Result<Path<T>, PathRejection>;
type Asked<T> = Result<Query<T>, QueryRejection>;

/// The parameters after a path's question mark.
fn asked<T: DeserializeOwned>(query: Asked<T>) -> Result<T, FieldError> {
    let Query(asked) = query.map_err(|rejection| FieldError {
        field: "query".to_owned(),
        message: cut(&rejection.body_text(), MAX_MESSAGE),
        allowed: "the parameters of this path".to_owned(),
    })?;
    Ok(asked)
}

/// The part of a path that names something.
fn named<T>(field: &str, name: Result<Path<T>, PathRejection>) -> Result<T, FieldError> {
    let Path(name) = name.map_err(|rejection| FieldError {
        field: field.to_owned(),
        message: cut(&rejection.body_text(), MAX_MESSAGE),
        allowed: "a name, percent-encoded UTF-8".to_owned(),
    })?;
    Ok(name)
}

/// Whether the process lives
#[utoipa::path(get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It does", body = String, content_type = "text/plain")))]
pub(super) async fn healthz() -> &'static str {
    "ok\n"
}

/// Whether the server is ready for requests: its packs are loaded and warm
#[utoipa::path(
    get,
    path = "/readyz",
    tag = "operations",
    responses(
        (status = 200, description = "Ready", body = String, content_type = "text/plain"),
        (status = 503, description = "Starting, draining, or an engine has stopped", body = ErrorBody),
    )
)]
pub(super) async fn readyz(State(service): State<Arc<Service>>) -> Result<&'static str, ApiError> {
    service.ready()?;
    Ok("ready\n")
}

/// Metrics in Prometheus' text format
#[utoipa::path(get, path = "/metrics", tag = "operations",
    responses((status = 200, description = "Metrics", body = String, content_type = "text/plain")))]
pub(super) async fn metrics(State(service): State<Arc<Service>>) -> impl IntoResponse {
    (
        [(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")],
        service.telemetry().render(),
    )
}

async fn wrong_method(request: Request) -> ApiError {
    ApiError::WrongMethod(request.method().to_string())
}

/// Answers what no route does, in the caller's protocol.
pub(super) async fn unknown_route(headers: HeaderMap, request: Request) -> Response {
    let path: String = request.uri().path().chars().take(200).collect();
    let grpc = headers
        .get(header::CONTENT_TYPE)
        .is_some_and(|ty| ty.as_bytes().starts_with(b"application/grpc"));
    match grpc {
        true => ApiError::Unimplemented(format!("there is no service at {path}"))
            .status()
            .into_http::<Body>(),
        false => ApiError::UnknownRoute(path).into_response(),
    }
}

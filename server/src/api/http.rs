//! HTTP: the gRPC messages as JSON, and pages for operators.

mod files;
pub(super) mod json;
pub(super) mod mmcp;
mod packs;
pub(super) mod parts;
mod recordings;
pub(super) mod scenes;
pub(super) mod sessions;
mod site;
mod skeletons;
mod tickets;
mod viewer;

use std::sync::Arc;

use axum::extract::rejection::{PathRejection, QueryRejection};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json, Router, middleware};
use http::{HeaderMap, header};
use serde::de::DeserializeOwned;
use troupe_proto::v1;
use utoipa::openapi::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

pub(super) use self::viewer::ASSETS;

use self::json::{BodyLimits, JsonBody};
use super::error::ApiError;
use super::ours::Ours;
use super::shape::Shapes;
use super::track::{self, HttpRpcs, Tracker};
use super::{ApiLimits, early, openapi, ws};
use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_character::FieldError;
use troupe_edge::clients::Client;
use troupe_service::Service;

/// The routes of remote procedures, with their documentation.
fn rpcs() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::with_openapi(openapi::frame())
        .routes(routes!(in_between))
        .routes(routes!(parts::generate))
        .routes(routes!(parts::describe))
        .routes(routes!(list_packs))
        .routes(routes!(get_pack))
        .routes(routes!(packs::load))
        .routes(routes!(packs::unload))
        .routes(routes!(packs::swap))
        .routes(routes!(sessions::list_styles))
        .routes(routes!(sessions::get_style, sessions::put_style))
        .routes(routes!(sessions::create, sessions::list))
        .routes(routes!(sessions::resume))
        .routes(routes!(sessions::get, sessions::close))
        .routes(routes!(sessions::peek))
        .routes(routes!(recordings::get))
        .routes(routes!(recordings::replay))
        .routes(routes!(sessions::command))
        .routes(routes!(sessions::step))
        .routes(routes!(ws::drive))
        .routes(routes!(scenes::list))
        .routes(routes!(scenes::get, scenes::put, scenes::delete))
        .routes(routes!(scenes::add))
        .routes(routes!(scenes::move_objects))
        .routes(routes!(scenes::remove))
        .routes(routes!(scenes::list_objects))
        .routes(routes!(
            scenes::get_object,
            scenes::put_object,
            scenes::delete_object
        ))
        .routes(routes!(scenes::detect))
        .routes(routes!(skeletons::list))
        .routes(routes!(skeletons::get, skeletons::put, skeletons::delete))
        .routes(routes!(mmcp::capabilities))
        .routes(routes!(mmcp::generate))
}

/// Routes that are not remote procedures, with their documentation.
fn operations() -> OpenApiRouter<Arc<Service>> {
    OpenApiRouter::new()
        .routes(routes!(healthz))
        .routes(routes!(readyz))
        .routes(routes!(metrics))
        .routes(routes!(tickets::create))
}

/// The routes of health checks alone.
pub(super) fn health(service: &Arc<Service>) -> Router {
    let routes = OpenApiRouter::new()
        .routes(routes!(healthz))
        .routes(routes!(readyz));
    Router::from(routes)
        .method_not_allowed_fallback(wrong_method)
        .with_state(service.clone())
}

/// The OpenAPI document.
pub fn document() -> OpenApi {
    let mut document = rpcs().merge(operations()).into_openapi();
    openapi::complete(&mut document);
    document
}

/// The HTTP routes. `site` is the folder of the documentation.
pub(super) fn router(service: &Arc<Service>, limits: &ApiLimits, site: &std::path::Path) -> Router {
    let body = BodyLimits {
        bytes: limits.message_bytes,
        shapes: Arc::new(Shapes::new(limits)),
    };
    let (rpcs, documented) = rpcs().split_for_parts();
    let tracker = Arc::new(Tracker::new(service, limits));
    let routes = Arc::new(HttpRpcs::new(documented));
    let api = rpcs
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state((tracker, routes), track::http))
        .layer(DefaultBodyLimit::max(limits.message_bytes))
        .layer(Extension(body))
        .with_state(service.clone());
    let operations = Router::from(operations())
        .method_not_allowed_fallback(wrong_method)
        .with_state(service.clone());
    let docs = SwaggerUi::new(site::SWAGGER)
        .url("/openapi.json", document())
        // Without this the page would ask a public validator for a badge.
        .config(utoipa_swagger_ui::Config::from("/openapi.json").validator_url("none"));
    api.merge(operations)
        .merge(docs)
        .merge(site::router(site))
        .merge(viewer::router())
}

/// Fill the gap between context frames and target keyframes
///
/// One request may carry many characters; they are served together with those of other callers.
#[utoipa::path(
    post,
    path = "/v1/inbetween",
    operation_id = "InBetween",
    tag = "motion",
    request_body = v1::InBetweenRequest,
    responses(
        (status = 200, description = "The generated motion", body = v1::InBetweenResponse),
        (status = 404, description = "No such pack"),
        (status = 429, description = "The queue is full, or too slow; see the Retry-After header"),
        (status = 500, description = "Inference failed"),
        (status = 504, description = "Not served in time"),
    )
)]
pub(super) async fn in_between(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    JsonBody(request): JsonBody<v1::InBetweenRequest>,
) -> Result<Response, ApiError> {
    let pack = request.pack.clone();
    let answer = service.in_between(request).await;
    early::note(Some(&client), &pack, answer.as_ref().err());
    let answer = answer?;
    json::written(move || answer).await
}

/// List the model packs that this server has loaded
#[utoipa::path(
    get,
    path = "/v1/packs",
    operation_id = "ListPacks",
    tag = "motion",
    responses((status = 200, description = "All packs, sorted by name", body = v1::ListPacksResponse))
)]
pub(super) async fn list_packs(Ours(service): Ours) -> Result<Json<v1::ListPacksResponse>, ApiError> {
    Ok(Json(service.list_packs()?))
}

/// Describe one pack: skeleton, limits, licence, training and evaluation figures
#[utoipa::path(
    get,
    path = "/v1/packs/{name}",
    operation_id = "GetPack",
    tag = "motion",
    responses(
        (status = 200, description = "The pack", body = v1::Pack),
        (status = 404, description = "No such pack"),
    )
)]
pub(super) async fn get_pack(
    Ours(service): Ours,
    name: Result<Path<String>, PathRejection>,
) -> Result<Json<v1::Pack>, ApiError> {
    Ok(Json(service.get_pack(&named("name", name)?)?))
}

type Named<T> = Result<Path<T>, PathRejection>;
type Asked<T> = Result<Query<T>, QueryRejection>;

/// The query parameters of a path.
fn asked<T: DeserializeOwned>(query: Asked<T>) -> Result<T, FieldError> {
    let Query(asked) = query.map_err(|rejection| FieldError {
        field: "query".to_owned(),
        message: cut(&rejection.body_text(), MAX_MESSAGE),
        allowed: "the parameters of this path".to_owned(),
    })?;
    Ok(asked)
}

/// The name in a path.
fn named<T>(field: &str, name: Result<Path<T>, PathRejection>) -> Result<T, FieldError> {
    let Path(name) = name.map_err(|rejection| FieldError {
        field: field.to_owned(),
        message: cut(&rejection.body_text(), MAX_MESSAGE),
        allowed: "a name, percent-encoded UTF-8".to_owned(),
    })?;
    Ok(name)
}

/// Whether the process is alive
#[utoipa::path(get, path = "/healthz", tag = "operations",
    responses((status = 200, description = "It is", body = String, content_type = "text/plain")))]
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
        (status = 503, description = "Starting, draining, an engine has stopped, or the store is behind"),
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
    service.look();
    (
        [(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")],
        service.telemetry().render(),
    )
}

async fn wrong_method(request: Request) -> ApiError {
    ApiError::WrongMethod(request.method().to_string())
}

/// Answers requests without a route, in the caller's protocol.
pub(super) async fn unknown_route(headers: HeaderMap, request: Request) -> Response {
    let path: String = request.uri().path().chars().take(200).collect();
    ApiError::UnknownRoute(path).in_kind(&headers)
}

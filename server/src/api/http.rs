//! HTTP: the same messages as JSON, and what operators need.

use std::sync::Arc;

use axum::body::{Body, Bytes};
use axum::extract::rejection::PathRejection;
use axum::extract::{DefaultBodyLimit, FromRequest, Path, Request, State};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use axum::{Json, Router, middleware};
use http::{HeaderMap, StatusCode, header};
use serde::de::DeserializeOwned;
use troupe_proto::v1;
use utoipa_swagger_ui::SwaggerUi;

use super::error::{ApiError, ErrorBody, MAX_MESSAGE, MAX_PATH, cut};
use super::shape;
use super::track::{self, Tracker};
use crate::config::Config;
use crate::inbetween::FieldError;
use crate::service::Service;

/// The HTTP routes.
pub(super) fn router(service: &Arc<Service>, config: &Config) -> Router {
    let tracker = Arc::new(Tracker::new(service, config));
    let limits = BodyLimits {
        bytes: config.max_message_bytes,
        characters: config.max_characters_per_request,
    };
    let api = Router::new()
        .route("/v1/inbetween", post(in_between))
        .route("/v1/packs", get(list_packs))
        .route("/v1/packs/{name}", get(get_pack))
        .method_not_allowed_fallback(wrong_method)
        .layer(middleware::from_fn_with_state(tracker, track::http))
        .layer(DefaultBodyLimit::max(config.max_message_bytes))
        .layer(axum::Extension(limits))
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

/// Limits of a body. [`DefaultBodyLimit`] enforces the bytes; here they are named in errors.
#[derive(Clone, Copy)]
struct BodyLimits {
    bytes: usize,
    characters: usize,
}

/// A JSON body. Errors name the field; the content type does not matter.
pub(super) struct JsonBody<T>(T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let limits = request.extensions().get::<BodyLimits>().copied();
        let limits = limits.ok_or_else(|| ApiError::Internal("no limits are set".to_owned()))?;
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
        shape::check_json(&bytes, limits.characters)?;
        let mut json = serde_json::Deserializer::from_slice(&bytes);
        let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let (path, inner) = (error.path().to_string(), error.inner());
            if inner.is_eof() {
                return ApiError::Truncated {
                    problem: inner.to_string(),
                    limit_bytes: limits.bytes,
                };
            }
            ApiError::Malformed {
                message: cut(&inner.to_string(), MAX_MESSAGE),
                field: (path != ".").then(|| cut(&path, MAX_PATH)),
            }
        })?;
        json.end().map_err(|error| ApiError::Malformed {
            message: error.to_string(),
            field: None,
        })?;
        Ok(Self(value))
    }
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
        (status = 429, description = "The queue is full; see the Retry-After header", body = ErrorBody),
        (status = 500, description = "Inference failed", body = ErrorBody),
        (status = 503, description = "Not ready yet", body = ErrorBody),
        (status = 504, description = "Not served in time", body = ErrorBody),
    )
)]
pub(super) async fn in_between(
    State(service): State<Arc<Service>>,
    JsonBody(request): JsonBody<v1::InBetweenRequest>,
) -> Result<Json<v1::InBetweenResponse>, ApiError> {
    service.in_between(request).await.map(Json)
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
    service.list_packs().map(Json)
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
    let Path(name) = name.map_err(|rejection| FieldError {
        field: "name".to_owned(),
        message: cut(&rejection.body_text(), MAX_MESSAGE),
        allowed: "a pack's name, percent-encoded UTF-8".to_owned(),
    })?;
    service.get_pack(&name).map(Json)
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
    service.ready().map(|()| "ready\n")
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

//! Packs that operators load, unload and swap, over HTTP.

use axum::Json;
use axum::extract::State;
use std::sync::Arc;
use troupe_proto::v1;
use troupe_service::Service;

use super::Named;
use super::json::JsonBody;
use super::scenes::agreed;
use crate::api::error::ApiError;

/// Load a pack from the server's folder of packs
///
/// If it is loaded already, this changes nothing. A name in the body must equal the name in the
/// path, or be left out. Where the server asks for keys, this needs the role admin.
#[utoipa::path(
    post,
    path = "/v1/packs/{name}/load",
    operation_id = "LoadPack",
    tag = "operations",
    request_body = v1::LoadPackRequest,
    responses(
        (status = 200, description = "The pack serves", body = v1::PackChange),
        (status = 404, description = "No such pack in the folder"),
        (status = 409, description = "Another version is loaded, or the pack cannot serve"),
        (status = 429, description = "There is no memory for it, or too many changes wait"),
    )
)]
pub(in crate::api) async fn load(
    State(service): State<Arc<Service>>,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::LoadPackRequest>,
) -> Result<Json<v1::PackChange>, ApiError> {
    request.name = agreed("name", &request.name, name)?;
    Ok(Json(service.load_pack(request).await?))
}

/// Have new requests find a pack no more
///
/// Calls under way and live sessions go on with it until they end. A name in the body must equal
/// the name in the path, or be left out. Where the server asks for keys, this needs the role admin.
#[utoipa::path(
    post,
    path = "/v1/packs/{name}/unload",
    operation_id = "UnloadPack",
    tag = "operations",
    request_body = v1::UnloadPackRequest,
    responses(
        (status = 200, description = "The pack serves no more", body = v1::PackChange),
        (status = 404, description = "No such pack"),
        (status = 409, description = "It is the default pack, or another version is loaded"),
    )
)]
pub(in crate::api) async fn unload(
    State(service): State<Arc<Service>>,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::UnloadPackRequest>,
) -> Result<Json<v1::PackChange>, ApiError> {
    request.name = agreed("name", &request.name, name)?;
    Ok(Json(service.unload_pack(request).await?))
}

/// Put another version of a loaded pack in its place
///
/// New requests and the next plans of live sessions get the new version. If it cannot serve, the
/// version before serves on. A name in the body must equal the name in the path, or be left out.
/// Where the server asks for keys, this needs the role admin.
#[utoipa::path(
    post,
    path = "/v1/packs/{name}/swap",
    operation_id = "SwapPack",
    tag = "operations",
    request_body = v1::SwapPackRequest,
    responses(
        (status = 200, description = "The new version serves", body = v1::PackChange),
        (status = 404, description = "No such pack in the folder"),
        (status = 409, description = "The pack is not loaded, or the new version cannot serve"),
        (status = 429, description = "There is no memory for it, or too many changes wait"),
    )
)]
pub(in crate::api) async fn swap(
    State(service): State<Arc<Service>>,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::SwapPackRequest>,
) -> Result<Json<v1::PackChange>, ApiError> {
    request.name = agreed("name", &request.name, name)?;
    Ok(Json(service.swap_pack(request).await?))
}

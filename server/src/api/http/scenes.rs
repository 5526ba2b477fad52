//! Scenes and object definitions over HTTP.

use axum::Json;
use serde::Deserialize;
use troupe_proto::v1;

use super::json::JsonBody;
use super::{Asked, Named, asked, named};
use crate::api::answers;
use crate::api::error::ApiError;
use crate::api::ours::Ours;
use troupe_base::echo::cut;
use troupe_character::FieldError;

/// Checks that the body repeats the name in the path or has none.
fn same_name(field: &str, body: &str, path: &str) -> Result<(), FieldError> {
    match body.is_empty() || body == path {
        true => Ok(()),
        false => Err(FieldError {
            field: field.to_owned(),
            message: format!("is {:?}, but the path names {:?}", cut(body, 64), cut(path, 64)),
            allowed: "the name in the path, or none".to_owned(),
        }),
    }
}

/// The name in the path. If the body has one too, it must be the same.
pub(super) fn agreed(field: &str, body: &str, path: Named<String>) -> Result<String, ApiError> {
    let name = named("name", path)?;
    same_name(field, body, &name)?;
    Ok(name)
}

/// List scenes
#[utoipa::path(
    get,
    path = "/v1/scenes",
    operation_id = "ListScenes",
    tag = "scenes",
    responses((status = 200, description = "All scenes, sorted by name", body = v1::ListScenesResponse))
)]
pub(in crate::api) async fn list(Ours(service): Ours) -> Result<Json<v1::ListScenesResponse>, ApiError> {
    Ok(Json(service.list_scenes()?))
}

/// Create a scene, or replace one as a whole
///
/// Either `scene` or `document`. Names in the body must equal the name in the path, or be left out.
#[utoipa::path(
    put,
    path = "/v1/scenes/{name}",
    operation_id = "PutScene",
    tag = "scenes",
    request_body = v1::PutSceneRequest,
    responses(
        (status = 200, description = "The scene as it is now", body = v1::SceneSummary),
        (status = 429, description = "There are as many scenes as allowed"),
    )
)]
pub(in crate::api) async fn put(
    Ours(service): Ours,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::PutSceneRequest>,
) -> Result<Json<v1::SceneSummary>, ApiError> {
    request.name = agreed("name", &request.name, name)?;
    if let Some(scene) = &mut request.scene {
        same_name("scene.name", &scene.name, &request.name)?;
        scene.name.clone_from(&request.name);
    }
    Ok(Json(service.put_scene(request).await?))
}

/// Form of the scene in the answer.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct SceneForm {
    /// Convention of the answer, such as `unreal` or `CONVENTION_UNREAL`. Left out: `native`.
    #[param(value_type = String)]
    convention: v1::Convention,
    /// Leave the colliders out.
    without_colliders: bool,
}

/// A scene as it is now
#[utoipa::path(
    get,
    path = "/v1/scenes/{name}",
    operation_id = "GetScene",
    tag = "scenes",
    params(SceneForm),
    responses(
        (status = 200, description = "The scene", body = v1::Scene),
        (status = 404, description = "No such scene"),
        (status = 421, description = "Another server has the scene"),
    )
)]
pub(in crate::api) async fn get(
    Ours(service): Ours,
    name: Named<String>,
    form: Asked<SceneForm>,
) -> Result<Json<v1::Scene>, ApiError> {
    let SceneForm {
        convention,
        without_colliders,
    } = asked(form)?;
    let request = v1::GetSceneRequest {
        name: named("name", name)?,
        convention: convention.into(),
        without_colliders,
    };
    Ok(Json(service.get_scene(request).await?))
}

/// Delete a scene in which there are no sessions
#[utoipa::path(
    delete,
    path = "/v1/scenes/{name}",
    operation_id = "DeleteScene",
    tag = "scenes",
    responses(
        (status = 200, description = "The scene is gone", body = v1::DeleteSceneResponse),
        (status = 404, description = "No such scene"),
        (status = 409, description = "Sessions are in it"),
    )
)]
pub(in crate::api) async fn delete(
    Ours(service): Ours,
    name: Named<String>,
) -> Result<Json<v1::DeleteSceneResponse>, ApiError> {
    let request = v1::DeleteSceneRequest {
        name: named("name", name)?,
    };
    Ok(Json(service.delete_scene(request).await?))
}

/// Put objects into a scene
///
/// Each object has its own result. A refused object does not affect the others. `scene` in the body
/// must equal the name in the path, or be left out.
#[utoipa::path(
    post,
    path = "/v1/scenes/{name}/add",
    operation_id = "AddObjects",
    tag = "scenes",
    request_body = v1::AddObjectsRequest,
    responses(
        (status = 200, description = "Results of the objects", body = v1::ObjectsResponse),
        (status = 404, description = "No such scene"),
    )
)]
pub(in crate::api) async fn add(
    Ours(service): Ours,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::AddObjectsRequest>,
) -> Result<Json<v1::ObjectsResponse>, ApiError> {
    request.scene = agreed("scene", &request.scene, name)?;
    Ok(Json(answers::objects(service.add_objects(request).await?)))
}

/// Move objects of a scene
///
/// Each object has its own result. A refused object does not affect the others. `scene` in the body
/// must equal the name in the path, or be left out.
#[utoipa::path(
    post,
    path = "/v1/scenes/{name}/move",
    operation_id = "MoveObjects",
    tag = "scenes",
    request_body = v1::MoveObjectsRequest,
    responses(
        (status = 200, description = "Results of the objects", body = v1::ObjectsResponse),
        (status = 404, description = "No such scene"),
    )
)]
pub(in crate::api) async fn move_objects(
    Ours(service): Ours,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::MoveObjectsRequest>,
) -> Result<Json<v1::ObjectsResponse>, ApiError> {
    request.scene = agreed("scene", &request.scene, name)?;
    Ok(Json(answers::objects(service.move_objects(request).await?)))
}

/// Remove objects from a scene, even if characters use them
///
/// Each object has its own result. A refused object does not affect the others. `scene` in the body
/// must equal the name in the path, or be left out.
#[utoipa::path(
    post,
    path = "/v1/scenes/{name}/remove",
    operation_id = "RemoveObjects",
    tag = "scenes",
    request_body = v1::RemoveObjectsRequest,
    responses(
        (status = 200, description = "Results of the objects", body = v1::ObjectsResponse),
        (status = 404, description = "No such scene"),
    )
)]
pub(in crate::api) async fn remove(
    Ours(service): Ours,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::RemoveObjectsRequest>,
) -> Result<Json<v1::ObjectsResponse>, ApiError> {
    request.scene = agreed("scene", &request.scene, name)?;
    Ok(Json(answers::objects(service.remove_objects(request).await?)))
}

/// List the objects in reach of a character or of a box
#[utoipa::path(
    post,
    path = "/v1/detect",
    operation_id = "Detect",
    tag = "scenes",
    request_body = v1::DetectRequest,
    responses(
        (status = 200, description = "The objects in reach", body = v1::DetectResponse),
        (status = 404, description = "No such session or scene"),
        (status = 409, description = "The session is in no scene"),
        (status = 421, description = "Another server has the session or the scene"),
        (status = 410, description = "The session has expired"),
    )
)]
pub(in crate::api) async fn detect(
    Ours(service): Ours,
    JsonBody(request): JsonBody<v1::DetectRequest>,
) -> Result<Json<v1::DetectResponse>, ApiError> {
    Ok(Json(service.detect(&request).await?))
}

/// List object definitions
#[utoipa::path(
    get,
    path = "/v1/objects",
    operation_id = "ListObjectDefinitions",
    tag = "objects",
    responses((status = 200, description = "All definitions, sorted by name", body = v1::ListObjectDefinitionsResponse))
)]
pub(in crate::api) async fn list_objects(
    Ours(service): Ours,
) -> Result<Json<v1::ListObjectDefinitionsResponse>, ApiError> {
    Ok(Json(service.list_object_definitions().await?))
}

/// Add an object definition, or replace one
///
/// An error in the document names its line, column and field. `name` in the body must equal the
/// name in the path, or be left out.
#[utoipa::path(
    put,
    path = "/v1/objects/{name}",
    operation_id = "PutObjectDefinition",
    tag = "objects",
    request_body = v1::PutObjectDefinitionRequest,
    responses(
        (status = 200, description = "What the upload did", body = v1::PutObjectDefinitionResponse),
        (status = 404, description = "No such pack"),
        (status = 429, description = "There are as many definitions as allowed"),
    )
)]
pub(in crate::api) async fn put_object(
    Ours(service): Ours,
    name: Named<String>,
    JsonBody(mut request): JsonBody<v1::PutObjectDefinitionRequest>,
) -> Result<Json<v1::PutObjectDefinitionResponse>, ApiError> {
    request.name = agreed("name", &request.name, name)?;
    Ok(Json(service.put_object_definition(request).await?))
}

/// Form of the document in the answer.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct ObjectForm {
    /// Format of the document: `toml`, the default, or `json`.
    #[param(value_type = String)]
    format: v1::DocumentFormat,
}

/// One object definition with its document
#[utoipa::path(
    get,
    path = "/v1/objects/{name}",
    operation_id = "GetObjectDefinition",
    tag = "objects",
    params(ObjectForm),
    responses(
        (status = 200, description = "The definition", body = v1::GetObjectDefinitionResponse),
        (status = 404, description = "No such definition"),
    )
)]
pub(in crate::api) async fn get_object(
    Ours(service): Ours,
    name: Named<String>,
    form: Asked<ObjectForm>,
) -> Result<Json<v1::GetObjectDefinitionResponse>, ApiError> {
    let request = v1::GetObjectDefinitionRequest {
        name: named("name", name)?,
        format: asked(form)?.format.into(),
    };
    Ok(Json(service.get_object_definition(request).await?))
}

/// Delete an object definition of which no scene has an object
#[utoipa::path(
    delete,
    path = "/v1/objects/{name}",
    operation_id = "DeleteObjectDefinition",
    tag = "objects",
    responses(
        (status = 200, description = "The definition is gone", body = v1::DeleteObjectDefinitionResponse),
        (status = 404, description = "No such definition"),
        (status = 409, description = "Scenes have objects of it"),
    )
)]
pub(in crate::api) async fn delete_object(
    Ours(service): Ours,
    name: Named<String>,
) -> Result<Json<v1::DeleteObjectDefinitionResponse>, ApiError> {
    let request = v1::DeleteObjectDefinitionRequest {
        name: named("name", name)?,
    };
    Ok(Json(service.delete_object_definition(request).await?))
}

//! Skeletons of users' own characters over HTTP.

use axum::Json;
use axum::extract::{FromRequest, Request};
use http::header;
use serde::Deserialize;
use troupe_character::Path;
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;

use super::json::{BodyLimits, JsonBody, bytes};
use super::scenes::agreed;
use super::{Asked, Named, asked, named};
use crate::api::error::ApiError;
use crate::api::ours::Ours;

/// Content types of a file as it is. Pages of other sites cannot send them without a preflight
/// request.
const FILES: [&str; 3] = ["model/gltf-binary", "application/octet-stream", "application/xml"];
/// All that are read.
const TYPES: &str = "application/json; for a file as it is, model/gltf-binary, application/octet-stream, or \
                     application/xml of a robot";

/// List skeletons
#[utoipa::path(
    get,
    path = "/v1/skeletons",
    operation_id = "ListSkeletons",
    tag = "skeletons",
    responses((status = 200, description = "All skeletons, sorted by name", body = v1::ListSkeletonsResponse))
)]
pub(in crate::api) async fn list(Ours(service): Ours) -> Result<Json<v1::ListSkeletonsResponse>, ApiError> {
    Ok(Json(service.list_skeletons()?))
}

/// What a file as it is cannot say of itself.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct FileForm {
    /// Name of the file, for its ending. Left out: `skeleton.glb`, or `skeleton.urdf` for XML. Only
    /// for a body that is a file.
    file: Option<String>,
    /// As `pack` in a JSON body. Only for a body that is a file.
    pack: Option<String>,
    /// As `body` in a JSON body. Only for a body that is a file.
    body: Option<String>,
    /// As `force` in a JSON body. Only for a body that is a file.
    force: Option<bool>,
}

impl FileForm {
    fn is_empty(&self) -> bool {
        let texts = [&self.file, &self.pack, &self.body];
        texts.iter().all(|text| text.is_none()) && self.force.is_none()
    }
}

/// A skeleton as JSON, or as the file of a character.
pub(in crate::api) enum Sent {
    Json(v1::PutSkeletonRequest),
    /// The usual name of such a file, and its bytes.
    File(String, Vec<u8>),
}

impl<S: Send + Sync> FromRequest<S> for Sent {
    type Rejection = ApiError;

    async fn from_request(request: Request, state: &S) -> Result<Self, ApiError> {
        let sent = request.headers().get(header::CONTENT_TYPE);
        let sent = sent.and_then(|sent| sent.to_str().ok()).unwrap_or_default();
        let kind = sent.split(';').next().unwrap_or_default().trim();
        if !FILES.iter().any(|file| file.eq_ignore_ascii_case(kind)) {
            let read = JsonBody::from_request(request, state).await;
            return read.map(|json| Self::Json(json.0)).map_err(|error| match error {
                ApiError::WrongType { found, .. } => ApiError::WrongType {
                    found,
                    allowed: TYPES,
                },
                error => error,
            });
        }
        let limits = request.extensions().get::<BodyLimits>().cloned();
        let limits = limits.ok_or_else(|| ApiError::Internal("no limits are set".to_owned()))?;
        let usual = if kind.ends_with("xml") {
            "skeleton.urdf"
        } else {
            "skeleton.glb"
        };
        let data = bytes(request, state, &limits).await?;
        Ok(Self::File(usual.to_owned(), data.into()))
    }
}

/// Add a skeleton, or replace one that no session wears
///
/// The body is JSON, or a character's file as it is, with the Content-Type `model/gltf-binary` or
/// `application/octet-stream` (`application/xml` for a robot). A name in the body must equal the
/// name in the path, or be left out.
#[utoipa::path(
    put,
    path = "/v1/skeletons/{name}",
    operation_id = "PutSkeleton",
    tag = "skeletons",
    params(FileForm),
    request_body = v1::PutSkeletonRequest,
    responses(
        (status = 200, description = "The skeleton, and its certificate", body = v1::OwnSkeleton),
        (status = 409, description = "Sessions wear it"),
        (status = 415, description = "The Content-Type is neither application/json nor that of a file: model/gltf-binary, application/octet-stream, application/xml"),
        (status = 429, description = "There are as many skeletons as allowed"),
    )
)]
pub(in crate::api) async fn put(
    Ours(service): Ours,
    name: Named<String>,
    form: Asked<FileForm>,
    sent: Sent,
) -> Result<Json<v1::OwnSkeleton>, ApiError> {
    let form = asked(form)?;
    let mut request = match sent {
        Sent::Json(request) => match form.is_empty() {
            true => request,
            false => {
                let root = Path::root();
                let query = root.field("query");
                let allowed = "these fields in the JSON body";
                return Err(query.error("is for a body that is a file", allowed).into());
            }
        },
        Sent::File(usual_name, data) => v1::PutSkeletonRequest {
            source: Some(Source::File(v1::SkeletonFile {
                name: form.file.unwrap_or(usual_name),
                data,
            })),
            pack: form.pack.unwrap_or_default(),
            body: form.body.unwrap_or_default(),
            force: form.force.unwrap_or_default(),
            ..v1::PutSkeletonRequest::default()
        },
    };
    request.name = agreed("name", &request.name, name)?;
    Ok(Json(service.put_skeleton(request).await?))
}

/// The pack that a skeleton's certificate is about.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(in crate::api) struct FitForm {
    /// Name of the pack for `fit`. Left out: the server's default pack.
    pack: String,
    /// Name of the pack's body, for packs with several. Left out: the default one.
    body: String,
}

/// A skeleton, and its certificate for a pack
#[utoipa::path(
    get,
    path = "/v1/skeletons/{name}",
    operation_id = "GetSkeleton",
    tag = "skeletons",
    params(FitForm),
    responses(
        (status = 200, description = "The skeleton", body = v1::OwnSkeleton),
        (status = 404, description = "No such skeleton"),
    )
)]
pub(in crate::api) async fn get(
    Ours(service): Ours,
    name: Named<String>,
    form: Asked<FitForm>,
) -> Result<Json<v1::OwnSkeleton>, ApiError> {
    let FitForm { pack, body } = asked(form)?;
    let name = named("name", name)?;
    Ok(Json(
        service
            .get_skeleton(v1::GetSkeletonRequest { name, pack, body })
            .await?,
    ))
}

/// Delete a skeleton that no session wears
#[utoipa::path(
    delete,
    path = "/v1/skeletons/{name}",
    operation_id = "DeleteSkeleton",
    tag = "skeletons",
    responses(
        (status = 200, description = "The skeleton is gone", body = v1::DeleteSkeletonResponse),
        (status = 404, description = "No such skeleton"),
        (status = 409, description = "Sessions wear it"),
    )
)]
pub(in crate::api) async fn delete(
    Ours(service): Ours,
    name: Named<String>,
) -> Result<Json<v1::DeleteSkeletonResponse>, ApiError> {
    let name = named("name", name)?;
    Ok(Json(
        service
            .delete_skeleton(v1::DeleteSkeletonRequest { name })
            .await?,
    ))
}

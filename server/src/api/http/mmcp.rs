//! The two routes of the Motion Model Context Protocol. Their answers and errors have the
//! protocol's form.

use std::sync::Arc;

use axum::extract::{FromRequest, Request};
use axum::response::{IntoResponse as _, Response};
use axum::{Extension, Json};
use http::header;
use serde_json::Value;

use super::json::{self, BodyLimits};
use crate::api::early;
use crate::api::error::ApiError;
use crate::api::ours::Ours;
use crate::mmcp::limits::MAX_REQUEST_BYTES;
use crate::mmcp::{Capabilities, Failure, Reply, RequestOrBatch};
use troupe_base::offload::offload;
use troupe_edge::clients::Client;
use troupe_service::{Service, ServiceError};

/// Content type of the answer to a single request.
const GLTF: &str = "model/gltf+json";

/// The body of a call, at most [`MAX_REQUEST_BYTES`] long.
pub(crate) struct Call(RequestOrBatch);

impl FromRequest<Arc<Service>> for Call {
    type Rejection = ApiError;

    async fn from_request(request: Request, service: &Arc<Service>) -> Result<Self, ApiError> {
        let limits = request.extensions().get::<BodyLimits>().cloned();
        let limits = limits.ok_or_else(|| ApiError::Internal("no limits are set".to_owned()))?;
        let limits = BodyLimits {
            bytes: limits.bytes.min(MAX_REQUEST_BYTES),
            ..limits
        };
        let bytes = json::body(request, service, &limits).await?;
        json::read(&bytes, &limits).map(Self)
    }
}

/// What this server's models can do, for tools that speak MMCP
///
/// The Motion Model Context Protocol, version 1.4: a model for each pack, or for each body of a
/// pack.
#[utoipa::path(
    get,
    path = "/capabilities",
    operation_id = "MmcpCapabilities",
    tag = "mmcp",
    responses((status = 200, description = "The models, in the protocol's form", body = Object)),
)]
pub(crate) async fn capabilities(
    Ours(service): Ours,
    limits: Extension<BodyLimits>,
) -> Result<Json<Capabilities>, ApiError> {
    let most = limits.bytes.min(MAX_REQUEST_BYTES);
    Ok(Json(Capabilities::of(&*service.table()?, most)))
}

/// Make motion for a tool that speaks MMCP
///
/// The Motion Model Context Protocol, version 1.4. A batch, `{"protocol_version", "requests":
/// […]}`, answers `{"results": [{"gltf"} or {"error"}, …]}` as application/json.
#[utoipa::path(
    post,
    path = "/generate",
    operation_id = "MmcpGenerate",
    tag = "mmcp",
    request_body(content = Object, description = "A request or a batch, in the protocol's form"),
    responses((
        status = 200,
        description = "glTF 2.0 with the extension MMCP_motion: one animation per sample",
        body = Object,
        content_type = "model/gltf+json",
    )),
)]
pub(crate) async fn generate(
    Ours(service): Ours,
    Extension(client): Extension<Arc<Client>>,
    Call(body): Call,
) -> Result<Response, ApiError> {
    let model = body.0.get("model").and_then(Value::as_str).map(str::to_owned);
    let made = crate::mmcp::generate(&service, body).await;
    if let (Some(model), Err(Failure::Service(error))) = (model, &made) {
        early::note(Some(&client), &model, Some(error));
    }
    match made? {
        Reply::One(document) => Ok(([(header::CONTENT_TYPE, GLTF)], document).into_response()),
        Reply::Many(results) => {
            // The answer may be large. Errors in it name the request.
            let results: Vec<Result<Vec<u8>, Value>> = results
                .into_iter()
                .map(|result| result.map_err(|failure| ApiError::from(failure).envelope().1))
                .collect();
            let joined = offload(results.len(), 0, move || joined(&results)).await;
            let body = joined.map_err(ServiceError::from)?;
            Ok(([(header::CONTENT_TYPE, "application/json")], body).into_response())
        }
    }
}

/// The answer to a batch. The documents are JSON already.
fn joined(results: &[Result<Vec<u8>, Value>]) -> Vec<u8> {
    let mut body = b"{\"results\":[".to_vec();
    for (index, result) in results.iter().enumerate() {
        if index > 0 {
            body.push(b',');
        }
        match result {
            Ok(document) => {
                body.extend_from_slice(b"{\"gltf\":");
                body.extend_from_slice(document);
                body.push(b'}');
            }
            Err(error) => body.extend_from_slice(error.to_string().as_bytes()),
        }
    }
    body.extend_from_slice(b"]}");
    body
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_results_of_a_batch_are_one_document() {
        let results = [
            Ok(b"{\"a\":1}".to_vec()),
            Err(serde_json::json!({"error": {"code": "x"}})),
        ];
        let body: Value = serde_json::from_slice(&joined(&results)).unwrap();
        let expected = serde_json::json!({"results": [{"gltf": {"a": 1}}, {"error": {"code": "x"}}]});
        assert_eq!(body, expected);
    }
}

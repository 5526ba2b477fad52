//! The service of the caller's tenant.

use std::sync::Arc;

use axum::extract::FromRequestParts;
use http::request::Parts;
use tonic::Status;

use super::error::ApiError;
use troupe_edge::clients::Identity;
use troupe_service::Service;

/// Extracts the service of the caller's tenant, in HTTP handlers.
pub(super) struct Ours(pub(super) Arc<Service>);

impl FromRequestParts<Arc<Service>> for Ours {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, ApiError> {
        of(service, &parts.extensions).await.map(Self)
    }
}

async fn of(service: &Arc<Service>, extensions: &http::Extensions) -> Result<Arc<Service>, ApiError> {
    let identity = extensions.get::<Identity>();
    let tenant = identity.and_then(|identity| identity.tenant.clone());
    Ok(service.of(tenant).await?)
}

/// The service of the caller's tenant, in gRPC handlers.
pub(super) async fn ours<T>(
    service: &Arc<Service>,
    request: &tonic::Request<T>,
) -> Result<Arc<Service>, Status> {
    let service = of(service, request.extensions()).await;
    service.map_err(|error| error.status())
}

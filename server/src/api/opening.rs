//! Opening sessions within the quota of a key.

use std::sync::Arc;

use troupe_proto::v1;

use super::error::ApiError;
use troupe_edge::clients::Client;
use troupe_service::Service;

/// Opens sessions for a client, all or none.
pub(super) async fn create_sessions(
    service: &Service,
    client: Option<&Arc<Client>>,
    request: v1::CreateSessionsRequest,
) -> Result<v1::CreateSessionsResponse, ApiError> {
    let is_open = |id: &str| service.sessions().get(id).is_ok();
    let count = request.sessions.len();
    let places = match client {
        Some(client) => client.sessions(count, is_open)?,
        None => None,
    };
    let opened = service.create_sessions(request).await?;
    if let Some(places) = places {
        places.keep(opened.sessions.iter().map(|session| session.id.as_str()));
    }
    Ok(opened)
}

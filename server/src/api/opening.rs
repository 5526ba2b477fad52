//! Opening sessions within the limits of a client.

use std::sync::Arc;

use troupe_proto::v1;

use super::error::ApiError;
use troupe_edge::clients::{Client, Exhausted, SessionPlaces};
use troupe_service::Service;

/// Opens sessions for a client, all or none.
pub(super) async fn create_sessions(
    service: &Service,
    client: Option<&Arc<Client>>,
    request: v1::CreateSessionsRequest,
) -> Result<v1::CreateSessionsResponse, ApiError> {
    let count = request.sessions.len();
    let mut places = match client {
        Some(client) => Some(places(service, client, count)?),
        None => None,
    };
    let opened = service.create_sessions(request).await?;
    for session in &opened.sessions {
        if let Some(place) = places.as_mut().and_then(SessionPlaces::split) {
            service.sessions().hold(&session.id, Box::new(place));
        }
    }
    Ok(opened)
}

/// Places for `count` sessions of a client.
fn places(service: &Service, client: &Arc<Client>, count: usize) -> Result<SessionPlaces, Exhausted> {
    if !client.has_room_for(count) {
        // Sessions whose time is up have their places until the next sweep.
        service.sessions().sweep();
    }
    client.sessions(count)
}

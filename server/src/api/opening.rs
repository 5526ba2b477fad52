//! Opening sessions within the limits of a client.

use std::sync::Arc;

use troupe_proto::v1;

use super::error::ApiError;
use troupe_character::{FieldError, Path};
use troupe_edge::clients::{Client, Exhausted, Recorded, SessionPlaces};
use troupe_service::Service;

/// Opens sessions for a client, all or none.
pub(super) async fn create_sessions(
    service: &Service,
    client: Option<&Arc<Client>>,
    mut request: v1::CreateSessionsRequest,
) -> Result<v1::CreateSessionsResponse, ApiError> {
    if let Some(client) = client {
        record(client.recorded(), &mut request)?;
    }
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

/// Applies which sessions of a client are recorded.
fn record(recorded: Recorded, request: &mut v1::CreateSessionsRequest) -> Result<(), FieldError> {
    let root = Path::root();
    for (index, session) in request.sessions.iter_mut().enumerate() {
        match recorded {
            Recorded::Never if session.record => {
                let path = root.element("sessions", index);
                return Err(path.field("record").error(
                    "is true, but this key may not record",
                    "false, or a key whose entry has record = \"asked\" or \"always\"",
                ));
            }
            // Sessions in a scene cannot be recorded.
            Recorded::Always if session.scene.is_empty() => session.record = true,
            Recorded::Never | Recorded::Asked | Recorded::Always => {}
        }
    }
    Ok(())
}

/// Places for `count` sessions of a client.
fn places(service: &Service, client: &Arc<Client>, count: usize) -> Result<SessionPlaces, Exhausted> {
    if !client.has_room_for(count) {
        // Sessions whose time is up have their places until the next sweep.
        service.sessions().sweep();
    }
    client.sessions(count)
}

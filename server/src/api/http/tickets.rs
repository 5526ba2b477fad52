//! The route for stream tickets.

use std::sync::Arc;

use axum::{Extension, Json};

use crate::api::error::ApiError;
use troupe_edge::credentials::Credentials;
use troupe_edge::{Admitted, EdgeError, TICKET_LIFETIME};

/// A ticket for a stream.
#[derive(Debug, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
pub(in crate::api) struct CreateTicketResponse {
    /// Opens one stream: `/v1/drive?ticket=TICKET`.
    ticket: String,
    /// How long it is valid, in milliseconds.
    expires_in_ms: u64,
}

/// Get a ticket for a stream
///
/// A browser cannot send a key with a WebSocket. A ticket opens one stream as its key would, within
/// 30 seconds: `/v1/drive?ticket=TICKET`.
#[utoipa::path(
    post,
    path = "/v1/tickets",
    operation_id = "CreateTicket",
    tag = "sessions",
    responses(
        (status = 200, description = "The ticket", body = CreateTicketResponse),
        (status = 409, description = "The server asks for no keys, so streams need no tickets"),
        (status = 429, description = "Too many tickets are unused"),
    )
)]
pub(in crate::api) async fn create(
    credentials: Option<Extension<Arc<Credentials>>>,
    holder: Option<Extension<Admitted>>,
) -> Result<Json<CreateTicketResponse>, ApiError> {
    let (Some(Extension(credentials)), Some(Extension(holder))) = (credentials, holder) else {
        return Err(EdgeError::NoTickets.into());
    };
    Ok(Json(CreateTicketResponse {
        ticket: credentials.ticket(holder)?,
        expires_in_ms: TICKET_LIFETIME.as_millis() as u64,
    }))
}

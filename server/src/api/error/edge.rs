//! Errors of the edge: authentication and limits of clients.

use std::time::Duration;

use super::row::{FORBIDDEN, FULL, HEADERS, NOT_NOW, Row, Tabled, UNAUTHENTICATED, UNAVAILABLE};
use troupe_edge::{BEARER, EdgeError, MAX_HEAD_BYTES};

/// Retry hint if a connection or transfer memory may become free at any time.
const RETRY_AFTER: Duration = Duration::from_secs(1);

impl Tabled for EdgeError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::HeadersTooLarge { .. } => HEADERS
                .because("HEADERS_TOO_LARGE")
                .field("headers")
                .allowed(format!("at most {MAX_HEAD_BYTES} bytes")),
            Self::Exhausted(error) => {
                let row = FULL.because("CLIENT_LIMIT").allowed(error.allowed.as_str());
                match error.never {
                    true => row,
                    false => row.retry_after(RETRY_AFTER),
                }
            }
            Self::NotAllowed { header, allowed, .. } => {
                FORBIDDEN.because("NOT_ALLOWED").field(header).allowed(*allowed)
            }
            Self::NoKey | Self::UnknownKey => {
                let reason = match self {
                    Self::NoKey => "KEY_MISSING",
                    _ => "KEY_UNKNOWN",
                };
                UNAUTHENTICATED
                    .because(reason)
                    .field("Authorization")
                    .allowed(BEARER)
            }
            Self::Token(_) => UNAUTHENTICATED
                .because("TOKEN_INVALID")
                .field("Authorization")
                .allowed(BEARER),
            Self::KeyRemoved => UNAUTHENTICATED.because("KEY_REMOVED"),
            Self::TokenExpired => UNAUTHENTICATED.because("TOKEN_EXPIRED"),
            Self::OfTenant { needed } => FORBIDDEN
                .because("ROLE_TOO_LOW")
                .field("Authorization")
                .allowed(needed.of_all()),
            Self::UnknownTicket => UNAUTHENTICATED
                .because("TICKET_UNKNOWN")
                .field("ticket")
                .allowed("a ticket of POST /v1/tickets, once and within 30 s"),
            Self::TooManyTickets { most, .. } => FULL
                .because("TOO_MANY_TICKETS")
                .allowed(format!("{most} that are not used yet"))
                .retry_after(RETRY_AFTER),
            Self::NoTickets => NOT_NOW.because("NO_KEYS"),
            Self::RoleTooLow { needed, .. } => FORBIDDEN
                .because("ROLE_TOO_LOW")
                .field("Authorization")
                .allowed(needed.and_above()),
            Self::NoConnection => UNAVAILABLE
                .because("TOO_MANY_CONNECTIONS")
                .retry_after(RETRY_AFTER),
        }
    }
}

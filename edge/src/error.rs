//! Errors with which the edge refuses requests.

use super::clients::{Exhausted, Role};
use super::tokens::TokenError;

/// Form of the header `Authorization`, for messages.
pub const BEARER: &str = "Bearer and a key";

/// Most bytes of a request's headers and path, with 32 bytes added for each header.
pub const MAX_HEAD_BYTES: usize = 16 << 10;

/// Keys that may read metrics.
pub const METRICS_KEYS: &str = "a key of the role metrics, or of the role admin without a tenant";

/// Why the edge refuses a request.
#[derive(Debug, Clone, thiserror::Error)]
pub enum EdgeError {
    /// Headers over the limit.
    #[error(
        "the headers take {found_bytes} bytes, including 32 for each; allowed: at most {MAX_HEAD_BYTES} bytes"
    )]
    HeadersTooLarge {
        /// Size of the request's headers, counted as in [`MAX_HEAD_BYTES`].
        found_bytes: usize,
    },
    /// A client, an address or all clients together are at their limit.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// A web page of another site, or a name that is not the server's.
    #[error("{header} {found:?} is not allowed; allowed: {allowed}")]
    NotAllowed {
        /// `Origin` or `Host`.
        header: &'static str,
        /// The header's value, shortened.
        found: String,
        /// Which values are allowed.
        allowed: &'static str,
    },
    /// A call without a key.
    #[error("Authorization is missing, and the server asks for a key; allowed: {BEARER}")]
    NoKey,
    /// A key that the server does not know.
    #[error("Authorization has a key that the server does not know; allowed: {BEARER}")]
    UnknownKey,
    /// A token that is not accepted.
    #[error("Authorization has a token that is not accepted: {0}")]
    Token(TokenError),
    /// The key of an open stream, or of a ticket, was removed or has another role now.
    #[error("the key was removed or changed, so its streams end")]
    KeyRemoved,
    /// The token of an open stream, or of a ticket, has expired.
    #[error("the token has expired, so its streams end")]
    TokenExpired,
    /// A tenant's key that would read the metrics of all tenants, or change their packs.
    #[error(
        "the key is of a tenant, and {} are of all tenants; allowed: {}",
        if *needed == Role::Metrics { "metrics" } else { "packs" }, needed.of_all()
    )]
    OfTenant {
        /// The role that the call needs.
        needed: Role,
    },
    /// A ticket that is unknown, used or expired.
    #[error(
        "ticket is unknown, used or expired; allowed: an unused one from POST /v1/tickets, at most 30 s old"
    )]
    UnknownTicket,
    /// A client with too many tickets.
    #[error("{whose} has no room for another ticket; allowed at a time: {most} unused ones")]
    TooManyTickets {
        /// The limit's owner, for the message: a key or all clients.
        whose: &'static str,
        /// Most unused tickets of this owner.
        most: usize,
    },
    /// A request for a ticket although the server asks for no keys.
    #[error("the server asks for no keys, so a stream needs no ticket")]
    NoTickets,
    /// A key whose role does not allow the call.
    #[error("the key's role is {}; allowed: {}", role.name(), needed.and_above())]
    RoleTooLow {
        /// The role of the key or token.
        role: Role,
        /// The role that the call needs.
        needed: Role,
    },
    /// A connection beyond the limit.
    #[error("the server has no room for another connection; try again in a moment")]
    NoConnection,
}

//! What the edge turns away, and why.

use super::clients::{Exhausted, Role};
use super::tokens::TokenError;

/// How a key is sent.
pub const BEARER: &str = "Bearer and a key";

/// Most bytes of a request's headers and path.
pub const MAX_HEAD_BYTES: usize = 16 << 10;

/// Why the edge turns a request away.
#[derive(Debug, Clone, thiserror::Error)]
pub enum EdgeError {
    /// Headers over the limit.
    #[error(
        "the headers take {found_bytes} bytes, 32 for each included; allowed: at most {MAX_HEAD_BYTES} bytes"
    )]
    HeadersTooLarge {
        /// How many there are.
        found_bytes: usize,
    },
    /// A client, an address or all clients have too much on their way.
    #[error(transparent)]
    Exhausted(#[from] Exhausted),
    /// A web page of another site, or a name that is not the server's.
    #[error("{header} {found:?} is not allowed; allowed: {allowed}")]
    NotAllowed {
        /// The header that says so.
        header: &'static str,
        /// Its value.
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
    /// A token that does not count.
    #[error("Authorization has a token that does not count: {0}")]
    Token(TokenError),
    /// A ticket that is used up, late or made up.
    #[error(
        "ticket is not one that is open; allowed: one of POST /v1/tickets that is not used yet and younger than 30 s"
    )]
    UnknownTicket,
    /// A client with too many tickets.
    #[error("{whose} has no room for another ticket; allowed at a time: {most} that are not used yet")]
    TooManyTickets {
        /// Whose limit it is.
        whose: &'static str,
        /// The limit.
        most: usize,
    },
    /// A ticket where none is needed.
    #[error("the server asks for no keys, so a stream needs no ticket")]
    NoTickets,
    /// A key that allows less.
    #[error("the key's role is {}; allowed: {}", role.name(), needed.and_above())]
    RoleTooLow {
        /// What it is.
        role: Role,
        /// What the call needs.
        needed: Role,
    },
    /// A connection beyond the limit.
    #[error("the server has no room for another connection; try again in a moment")]
    NoConnection,
}

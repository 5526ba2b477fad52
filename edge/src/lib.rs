//! The edge: everything between a socket and the routes of a server.
//!
//! It does not depend on packs, sessions or messages. The server describes its routes to the edge
//! in a [`Front`].
//!
//! | module | holds |
//! |---|---|
//! | [`port`] | connections: their number and lifetime, TLS, HTTP/1.1 and HTTP/2 on one port |
//! | [`clients`] | the identity of callers, and limits on their memory, streams and sessions |
//! | [`keys`], [`tokens`], [`credentials`] | API keys, tokens (JWT), and the check of both |
//! | [`access`], [`Lease`] | checks that a caller's role allows a call, and ends streams with their credential |
//! | [`guard`] | checks the headers `Origin` and `Host` against web pages of other sites |
//! | [`head`], [`traffic`], [`reserve`] | limits of headers and bodies; answers beyond the limit of connections |
//! | [`observe`] | ids and traces of requests, counts of refused requests |
//! | [`reload`] | reads files again when they change |

pub mod access;
mod admitted;
pub mod clients;
pub mod credentials;
mod error;
mod front;
pub mod guard;
pub mod head;
pub mod keys;
mod lease;
pub mod observe;
pub mod port;
mod refusals;
pub mod reload;
pub mod reserve;
mod tickets;
pub mod tokens;
pub mod traffic;
mod verify;

pub use admitted::Admitted;
pub use error::{BEARER, EdgeError, MAX_HEAD_BYTES, METRICS_KEYS};
pub use front::{Front, is_grpc};
pub use lease::Lease;
pub use tickets::TICKET_LIFETIME;

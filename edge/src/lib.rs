//! The edge: everything between a socket and the routes of a server.
//!
//! It knows no pack, no session and no message. What it has to know of the routes is in [`Front`],
//! which the server gives it.
//!
//! | module | holds |
//! |---|---|
//! | [`port`] | connections: how many, how long, TLS, HTTP/1.1 and HTTP/2 on one port |
//! | [`clients`] | who asks, and what each client may have at a time |
//! | [`keys`], [`tokens`], [`credentials`] | what lets a caller in |
//! | [`access`] | which call needs which role |
//! | [`guard`] | which web pages may use the server, and under which names |
//! | [`head`], [`traffic`], [`reserve`] | limits of headers, of memory on its way, of connections |
//! | [`observe`] | ids and traces of requests, counts of what is turned away |
//! | [`reload`] | files that are read again |

pub mod access;
mod admitted;
pub mod clients;
pub mod credentials;
mod error;
mod front;
pub mod guard;
pub mod head;
pub mod keys;
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
pub use error::{BEARER, EdgeError, MAX_HEAD_BYTES};
pub use front::{Front, is_grpc};
pub use tickets::TICKET_LIFETIME;

//! Why a server does not start.

use std::net::SocketAddr;

use crate::traces::TracesError;
use troupe_character::document::DocumentError;
use troupe_character::style::StyleError;
use troupe_edge::keys::KeysError;
use troupe_edge::port::{TlsError, TooFewFiles};
use troupe_edge::tokens::TokensError;
use troupe_engine::EngineError;
use troupe_engine::pack::PackError;
use troupe_live::records::RecordsError;
use troupe_live::world::LoadError;

/// Why a server did not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// A pack that cannot be used.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// Two packs of one name, or a default that is not loaded.
    #[error("{0}")]
    Packs(String),
    /// A style that cannot be used.
    #[error(transparent)]
    Style(#[from] StyleError),
    /// A skill that cannot be used.
    #[error(transparent)]
    Skill(#[from] Box<DocumentError>),
    /// A scene or an object definition that cannot be used.
    #[error(transparent)]
    World(#[from] LoadError),
    /// The library of the engines does not load.
    #[error(transparent)]
    Library(EngineError),
    /// An engine that does not start.
    #[error("pack {pack}: {error}")]
    Engine {
        /// The pack's name.
        pack: String,
        /// What went wrong.
        error: EngineError,
    },
    /// A file of keys that cannot be used.
    #[error(transparent)]
    Keys(#[from] KeysError),
    /// A file of a provider's keys that cannot be used.
    #[error(transparent)]
    Tokens(#[from] TokensError),
    /// Certificates that cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Others could use the server, and no option allows it.
    #[error(
        "listen is {0}, which other machines may reach, and there are no keys; allowed: a loopback address, or one of \
         keys, jwks and without_keys = one-time-key or anyone"
    )]
    Anonymous(SocketAddr),
    /// More connections than the system gives files for.
    #[error(transparent)]
    Files(#[from] TooFewFiles),
    /// The state of sessions cannot be kept, and was asked to be.
    #[error(transparent)]
    Records(#[from] RecordsError),
    /// A collector of traces that cannot be used.
    #[error(transparent)]
    Traces(#[from] TracesError),
    /// The server may take more memory than it is allowed to.
    #[error("{0}")]
    Memory(String),
    /// The port cannot be used.
    #[error("cannot listen: {0}")]
    Listen(std::io::Error),
    /// A part of the server that does not come up; a bug.
    #[error("internal: {0}")]
    Internal(String),
}

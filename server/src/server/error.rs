//! Reasons why a server does not start.

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
    /// A pack is unusable.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// Two packs have one name, or the default pack is not loaded.
    #[error("{0}")]
    Packs(String),
    /// A style is unusable.
    #[error(transparent)]
    Style(#[from] StyleError),
    /// A skill is unusable.
    #[error(transparent)]
    Skill(#[from] Box<DocumentError>),
    /// A scene or an object definition is unusable.
    #[error(transparent)]
    World(#[from] LoadError),
    /// The engines' library does not load.
    #[error(transparent)]
    Library(EngineError),
    /// An engine does not start.
    #[error("pack {pack}: {error}")]
    Engine {
        /// The pack's name.
        pack: String,
        /// What went wrong.
        error: EngineError,
    },
    /// A file of keys is unusable.
    #[error(transparent)]
    Keys(#[from] KeysError),
    /// A file with an identity provider's keys is unusable.
    #[error(transparent)]
    Tokens(#[from] TokensError),
    /// Certificates are unusable.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Other machines could use the server without a key, and no option allows it.
    #[error(
        "listen is {0}, which other machines may reach, and there are no keys; allowed: a loopback address, or one of \
         keys, jwks and without_keys = one-time-key or anyone"
    )]
    Anonymous(SocketAddr),
    /// The system allows fewer open files than the connections need.
    #[error(transparent)]
    Files(#[from] TooFewFiles),
    /// The requested store of sessions cannot be used.
    #[error(transparent)]
    Records(#[from] RecordsError),
    /// The collector of traces cannot be used.
    #[error(transparent)]
    Traces(#[from] TracesError),
    /// The server may take more memory than its limit.
    #[error("{0}")]
    Memory(String),
    /// The port cannot be used.
    #[error("cannot listen: {0}")]
    Listen(std::io::Error),
    /// The port for health checks cannot be used.
    #[error("health_listen: cannot listen on {address}: {error}")]
    HealthListen {
        /// The option's address.
        address: SocketAddr,
        /// What went wrong.
        error: std::io::Error,
    },
    /// A part of the server failed to start: a bug.
    #[error("internal: {0}")]
    Internal(String),
}

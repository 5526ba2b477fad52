//! What can be wrong with a call that is about sessions and styles.

use crate::packs::{CannotDo, UnknownBody, UnknownPack};
use crate::world::WorldError;
use troupe_base::offload::WorkerStopped;
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_character::live::CommandError;

/// Why a call about sessions or styles was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SessionError {
    /// A value that is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A pack that is not loaded.
    #[error(transparent)]
    UnknownPack(#[from] UnknownPack),
    /// A skeleton that its pack does not have.
    #[error(transparent)]
    UnknownBody(#[from] UnknownBody),
    /// A pack that cannot do what is asked of it.
    #[error(transparent)]
    CannotDo(#[from] CannotDo),
    /// What is wrong with a session's scene, or with the upload of a style.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A session that ran out of its time to live.
    #[error("session {id:?} has expired: no command, step or stream within its ttl_ms")]
    Expired {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session that is not open.
    #[error("no session has the id {id:?}")]
    Unknown {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session of that id is open already.
    #[error("a session with the id {id:?} exists already")]
    Exists {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// Somebody else advances the session.
    #[error("session {id:?} is being advanced by {owner}")]
    Busy {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
        /// Who advances it.
        owner: &'static str,
    },
    /// No room for another session, on the server or on a stream.
    #[error("{open} sessions are open{place}; allowed: at most {limit}")]
    TooMany {
        /// How many there are.
        open: usize,
        /// How many there may be.
        limit: usize,
        /// Where: nothing for the server, or ` on this stream`.
        place: &'static str,
    },
    /// No room for another stream.
    #[error("{limit} streams are open, and there is no room for more")]
    TooManyStreams {
        /// How many there may be.
        limit: usize,
    },
    /// The server takes no new streams any more.
    #[error("the server is shutting down")]
    ShuttingDown,
    /// What a character is asked to do and could not.
    #[error("{refusal}")]
    Refused {
        /// Why.
        refusal: CommandError,
        /// The field of the request that asked for it.
        field: String,
    },
    /// A style that the pack does not have.
    #[error("{field}: there is no style {name:?}; allowed: {}", there_are.join(", "))]
    UnknownStyle {
        /// The name that was asked for.
        name: String,
        /// The field of the request that named it.
        field: String,
        /// The names that there are.
        there_are: Vec<String>,
    },
    /// A style that came with its pack cannot be replaced.
    #[error("{field}: the style {name:?} is one of the pack's own")]
    StyleIsBuiltIn {
        /// Its name.
        name: String,
        /// The field of the request that named it.
        field: String,
    },
    /// The plans of a character fail.
    #[error(transparent)]
    Plan(#[from] SubmitError),
    /// The work of a call did not come to its end.
    #[error(transparent)]
    Stopped(#[from] WorkerStopped),
}

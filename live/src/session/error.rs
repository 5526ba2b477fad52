//! Errors of calls about sessions and styles.

use super::recording::RecordingError;
use crate::packs::{CannotDo, UnknownBody, UnknownPack};
use crate::skeleton::SkeletonError;
use crate::world::WorldError;
use troupe_base::offload::WorkerStopped;
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_character::live::CommandError;

/// Why a call about sessions or styles was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SessionError {
    /// A value of the request is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The requested pack is not loaded.
    #[error(transparent)]
    UnknownPack(#[from] UnknownPack),
    /// The pack has no body of the requested name.
    #[error(transparent)]
    UnknownBody(#[from] UnknownBody),
    /// The pack lacks the capability that the request needs.
    #[error(transparent)]
    CannotDo(#[from] CannotDo),
    /// The skeleton that a session names is unknown or does not fit.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// An error of a session's scene or of a style's upload.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The session's time to live is over.
    #[error("session {id:?} has expired: no command, step or stream within its ttl_ms")]
    Expired {
        /// The session's id, or the start of what the request gave as one.
        id: String,
        /// The field of the request that has the id.
        field: String,
    },
    /// The session was closed to make room for a new one.
    #[error(
        "session {id:?} has made room: no call had used it for a while, and the server had no room for a new session"
    )]
    MadeRoom {
        /// The session's id, or the start of what the request gave as one.
        id: String,
        /// The field of the request that has the id.
        field: String,
    },
    /// A session that is not open.
    #[error("no session has the id {id:?}")]
    Unknown {
        /// The session's id, or the start of what the request gave as one.
        id: String,
        /// The field of the request that has the id.
        field: String,
    },
    /// An open session has this id.
    #[error("a session with the id {id:?} exists already")]
    Exists {
        /// The session's id, or the start of what the request gave as one.
        id: String,
        /// The field of the request that has the id.
        field: String,
    },
    /// Another server has the session, or the scene that it is in.
    #[error("{what} {name:?} is on the server {owner}, whose lease ends in {ends_in_ms} ms")]
    Elsewhere {
        /// `session` or `scene`.
        what: &'static str,
        /// Id of the session or name of the scene.
        name: String,
        /// Address of the server that has it.
        owner: String,
        /// Time until its lease ends, unless the server renews it.
        ends_in_ms: u64,
        /// The field of the request that has the name.
        field: String,
    },
    /// Another server has taken the session over.
    #[error("session {id:?} has moved to another server; resume it there")]
    Moved {
        /// The session's id.
        id: String,
        /// The field of the request that has the id.
        field: String,
    },
    /// The store that servers share does not answer, so it is unknown which server has a session.
    #[error("the store of sessions does not answer: {reason}")]
    NoStore {
        /// The store's address, and the system's reason.
        reason: String,
        /// The field of the request that has the session.
        field: String,
    },
    /// Another call advances the session.
    #[error("session {id:?} is being advanced by {owner}")]
    Busy {
        /// The session's id, or the start of what the request gave as one.
        id: String,
        /// The field of the request that has the id.
        field: String,
        /// `a step` or `a stream`.
        owner: &'static str,
    },
    /// There is no room for another session, on the server or on a stream.
    #[error("{open} sessions are open{place}; allowed: at most {limit}")]
    TooMany {
        /// Number of open sessions.
        open: usize,
        /// Maximum number of open sessions.
        limit: usize,
        /// Empty for the server, or ` on this stream`.
        place: &'static str,
    },
    /// There is no room for another stream.
    #[error("{limit} streams are open, and there is no room for more")]
    TooManyStreams {
        /// Maximum number of open streams.
        limit: usize,
    },
    /// The server shuts down and takes no new streams.
    #[error("the server is shutting down")]
    ShuttingDown,
    /// The character refused a command.
    #[error("{refusal}")]
    Refused {
        /// The character's reason.
        refusal: CommandError,
        /// The field of the request that caused it.
        field: String,
    },
    /// The pack has no style of the requested name.
    #[error("{field}: there is no style {name:?}; allowed: {}", there_are.join(", "))]
    UnknownStyle {
        /// The requested name, cut to 64 characters.
        name: String,
        /// The field of the request that has the name.
        field: String,
        /// Names of the pack's styles, at most 32.
        there_are: Vec<String>,
    },
    /// An upload has the name of a built-in style, which cannot be replaced.
    #[error("{field}: the style {name:?} is one of the pack's own")]
    StyleIsBuiltIn {
        /// Name of the built-in style.
        name: String,
        /// The field of the request that has the name.
        field: String,
    },
    /// There is no recording of a session of this id.
    #[error("there is no recording of a session {id:?}")]
    NotRecorded {
        /// The id, cut to 64 characters.
        id: String,
    },
    /// The recording cannot be played.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// As many recordings are played as may be at the same time.
    #[error("{limit} recordings are being played; allowed: at most {limit}")]
    TooManyReplays {
        /// Maximum number.
        limit: usize,
    },
    /// The plans of a character fail.
    #[error(transparent)]
    Plan(#[from] SubmitError),
    /// The call's work was stopped before its end.
    #[error(transparent)]
    Stopped(#[from] WorkerStopped),
}

impl SessionError {
    /// Whether the session that a call names may be open on another server.
    pub(super) fn may_be_elsewhere(&self) -> bool {
        matches!(
            self,
            Self::Elsewhere { .. } | Self::Moved { .. } | Self::NoStore { .. } | Self::TooMany { .. }
        )
    }
}

//! Every error of the API, and the one place that says how it looks: gRPC code and details, HTTP status and body,
//! metric label.

mod form;
mod table;

use std::time::Duration;

use crate::batch::SubmitError;
use troupe_character::FieldError;
use troupe_character::document::DocumentError;
use troupe_character::live::Refusal;
use troupe_character::object::DefinitionsError;
use troupe_character::post::NonFinite;
use troupe_character::scene::{SceneError, TableError};
use troupe_engine::EngineError;
use troupe_motion::model::Capability;

pub(super) use form::CodeLabel;
pub use form::{ErrorBody, ErrorDetail};

/// The domain of this API's errors in `google.rpc.ErrorInfo`.
const DOMAIN: &str = "troupe.v1";
/// Most characters of a message that may echo the request.
pub(super) const MAX_MESSAGE: usize = 512;
/// Most characters of a field's path that may echo the request.
pub(super) const MAX_PATH: usize = 256;

/// An error that a caller sees.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ApiError {
    /// A value that the server does not accept.
    #[error("{0}")]
    Field(#[from] FieldError),
    /// A body that is not a request: truncated, no protobuf, no JSON, or with a field of the wrong form.
    #[error("the request cannot be read: {message}")]
    Malformed {
        /// What is wrong with it.
        message: String,
        /// The field, where it is known.
        field: Option<String>,
    },
    /// A body that ends before its message does.
    #[error("the body ends early: {problem}; allowed: a whole message of at most {limit_bytes} bytes")]
    Truncated {
        /// How that was noticed.
        problem: String,
        /// The limit of a whole one.
        limit_bytes: usize,
    },
    /// A body over the limit.
    #[error("the request is too large; allowed: at most {limit_bytes} bytes")]
    TooLarge {
        /// The limit.
        limit_bytes: usize,
    },
    /// A pack that is not loaded.
    #[error("there is no pack {name:?}; loaded: {}", loaded.join(", "))]
    UnknownPack {
        /// The name that was asked for.
        name: String,
        /// The field of the request that named it.
        field: String,
        /// The names that there are.
        loaded: Vec<String>,
    },
    /// A pack that cannot do what is asked of it.
    #[error(
        "the pack {pack} cannot do this: it has no capability {wanted}; it has: {}",
        names_of(can)
    )]
    CannotDo {
        /// The pack's name.
        pack: String,
        /// What it would need.
        wanted: Capability,
        /// The field of the request that named it.
        field: String,
        /// What it can do.
        can: Vec<Capability>,
    },
    /// A session that ran out of its time to live.
    #[error("the session {id:?} has expired: nobody commanded, stepped or streamed it within its ttl_ms")]
    SessionExpired {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session that is not open.
    #[error("there is no session {id:?}")]
    UnknownSession {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// A session of that id is open already.
    #[error("there is a session {id:?} already")]
    SessionExists {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
    },
    /// Somebody else advances the session.
    #[error("the session {id:?} is in the hands of {owner}")]
    SessionBusy {
        /// Its id.
        id: String,
        /// The field of the request that named it.
        field: String,
        /// Who advances it.
        owner: &'static str,
    },
    /// No room for another session, on the server or on a stream.
    #[error("{open} sessions are open{place}; allowed: at most {limit}")]
    TooManySessions {
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
    /// A scene or an object definition that is written wrongly.
    #[error("{0}")]
    Document(Box<DocumentError>),
    /// A scene that is not there, cannot be there, or cannot go.
    #[error("{error}")]
    Scenes {
        /// Why.
        error: TableError,
        /// The field of the request that named it.
        field: String,
    },
    /// An object of a scene that is not there, or cannot be changed so.
    #[error("{error}")]
    Objects {
        /// Why.
        error: SceneError,
        /// The field of the request that named it.
        field: String,
    },
    /// An object definition that is not there, cannot be there, or cannot go.
    #[error("{error}")]
    Definitions {
        /// Why.
        error: DefinitionsError,
        /// The field of the request that named it.
        field: String,
    },
    /// What a character is asked to do and could not.
    #[error("{refusal}")]
    Refused {
        /// Why.
        refusal: Refusal,
        /// The field of the request that asked for it.
        field: String,
    },
    /// No such route or method.
    #[error("there is no {0}")]
    UnknownRoute(String),
    /// A route that exists, under another HTTP method.
    #[error("this path does not answer {0}")]
    WrongMethod(String),
    /// The queue has no room.
    #[error("the server is busy: {pending_characters} characters are waiting")]
    QueueFull {
        /// Characters already waiting.
        pending_characters: usize,
        /// When it is worth to try again.
        retry_after: Duration,
    },
    /// A newer plan of the same character took the place of this one.
    #[error("a newer plan of the same character took the place of this one")]
    Superseded,
    /// The request waited for so long that nobody wants its answer any more.
    #[error("the request was given up after {} ms in the queue", waited.as_millis())]
    WaitedTooLong {
        /// How long it waited.
        waited: Duration,
    },
    /// The parts of an answer were not read in time.
    #[error("the answer was given up: its parts were not read in time")]
    ReaderSlow,
    /// The server is not ready yet, or no longer.
    #[error("the server is {0}")]
    Unavailable(&'static str),
    /// The time for the request ran out.
    #[error("the request was not served {}", in_time(.0))]
    DeadlineExceeded(Duration),
    /// A feature of gRPC that the server does not speak, such as a compression.
    #[error("{0}")]
    Unimplemented(String),
    /// The server's own fault.
    #[error("{0}")]
    Internal(String),
}

impl From<SubmitError> for ApiError {
    fn from(error: SubmitError) -> Self {
        match error {
            SubmitError::QueueFull {
                pending_characters,
                retry_after,
            } => Self::QueueFull {
                pending_characters,
                retry_after,
            },
            SubmitError::Superseded => Self::Superseded,
            SubmitError::DeadlinePassed { waited } => Self::WaitedTooLong { waited },
            SubmitError::ReaderSlow => Self::ReaderSlow,
            SubmitError::Engine(EngineError::Stopped) => Self::Unavailable("broken: an engine has stopped"),
            SubmitError::Engine(error) => Self::Internal(error.to_string()),
        }
    }
}

/// Capabilities in words.
pub(super) fn names_of(capabilities: &[Capability]) -> String {
    let names: Vec<&str> = capabilities.iter().map(|able| able.name()).collect();
    names.join(", ")
}

/// A time limit in words; one below a millisecond, or that is not known, has no number.
fn in_time(limit: &Duration) -> String {
    match limit.as_millis() {
        0 => "in time".to_owned(),
        limit => format!("within {limit} ms"),
    }
}

/// What an error echoes of a request: at most `limit` characters of it, and an ellipsis where there is more.
pub(super) fn cut(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

impl From<DocumentError> for ApiError {
    /// What is echoed of the document is cut.
    fn from(error: DocumentError) -> Self {
        Self::Document(Box::new(DocumentError {
            field: cut(&error.field, MAX_PATH),
            message: cut(&error.message, MAX_MESSAGE),
            ..error
        }))
    }
}

impl From<NonFinite> for ApiError {
    fn from(error: NonFinite) -> Self {
        Self::Internal(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use axum::response::IntoResponse as _;
    use http::StatusCode;
    use tonic::Code;

    use super::*;

    #[test]
    fn what_is_echoed_is_cut_between_characters() {
        assert_eq!(cut("naïve", 3), "naï…");
        assert_eq!(cut("naïve", 5), "naïve");
        assert_eq!(cut("", 0), "");
    }

    #[test]
    fn documents_name_their_place_and_echo_little() {
        let error = ApiError::from(DocumentError {
            source: troupe_character::document::Source::Text("scene"),
            place: Some((7, 3)),
            field: "x".repeat(1000),
            message: "y".repeat(1000),
            allowed: "0 to 1".to_owned(),
        });
        let detail = error.body().error;
        assert_eq!((detail.line, detail.column), (Some(7), Some(3)));
        assert_eq!(
            (detail.code.as_str(), detail.reason.as_str()),
            ("INVALID_ARGUMENT", "INVALID_DOCUMENT")
        );
        assert!(
            detail.message.starts_with("scene: line 7, column 3: xxx"),
            "{}",
            detail.message
        );
        assert!(detail.message.len() < 1000 && detail.field.unwrap().chars().count() == MAX_PATH + 1);
        assert_eq!(detail.allowed.as_deref(), Some("0 to 1"));
    }

    #[test]
    fn an_engine_that_has_stopped_is_unavailable_and_one_that_failed_an_internal_error() {
        let stopped = ApiError::from(SubmitError::Engine(EngineError::Stopped));
        assert_eq!(stopped.status().code(), Code::Unavailable);
        assert_eq!(stopped.into_response().status(), StatusCode::SERVICE_UNAVAILABLE);
        let failed = ApiError::from(SubmitError::Engine(EngineError::Panicked("oh".into())));
        assert_eq!(failed.status().code(), Code::Internal);
    }

    #[test]
    fn what_the_queue_drops_says_why() {
        let shown = |error: SubmitError| {
            let error = ApiError::from(error);
            let (code, status, label) = error.codes();
            (code, status.as_u16(), label, error.reason())
        };
        assert_eq!(
            shown(SubmitError::Superseded),
            (Code::Aborted, 409, "ABORTED", "SUPERSEDED")
        );
        let late = SubmitError::DeadlinePassed {
            waited: Duration::from_millis(1500),
        };
        assert_eq!(
            ApiError::from(late.clone()).to_string(),
            "the request was given up after 1500 ms in the queue"
        );
        assert_eq!(
            shown(late),
            (
                Code::DeadlineExceeded,
                504,
                "DEADLINE_EXCEEDED",
                "DEADLINE_EXCEEDED"
            )
        );
    }

    #[test]
    fn a_time_limit_that_is_not_known_has_no_number() {
        let text = |limit| ApiError::DeadlineExceeded(limit).to_string();
        assert_eq!(text(Duration::ZERO), "the request was not served in time");
        assert_eq!(
            text(Duration::from_millis(20)),
            "the request was not served within 20 ms"
        );
    }
}

//! The table: what each error is over gRPC and HTTP, in metrics, and in the details of an answer.

use std::time::Duration;

use http::StatusCode;
use tonic::Code;

use super::ApiError;
use troupe_character::document::check::listed;
use troupe_character::live::{MAX_WAITING_COMMANDS, Refusal};
use troupe_character::object::{DefinitionsError, MAX_DEFINITIONS};
use troupe_character::scene::{MAX_ID_BYTES, MAX_SCENES, SceneError, TableError};

/// When to try again where a place is free as soon as somebody leaves, which nobody foresees.
const WHEN_SOMEBODY_LEAVES: Duration = Duration::from_secs(1);

/// gRPC code, HTTP status, and the code's name in JSON and metrics.
type Codes = (Code, StatusCode, &'static str);

const INVALID: Codes = (Code::InvalidArgument, StatusCode::BAD_REQUEST, "INVALID_ARGUMENT");
const NOT_FOUND: Codes = (Code::NotFound, StatusCode::NOT_FOUND, "NOT_FOUND");
const EXISTS: Codes = (Code::AlreadyExists, StatusCode::CONFLICT, "ALREADY_EXISTS");
/// It makes sense, but not as things are.
const NOT_NOW: Codes = (
    Code::FailedPrecondition,
    StatusCode::CONFLICT,
    "FAILED_PRECONDITION",
);
const FULL: Codes = (
    Code::ResourceExhausted,
    StatusCode::TOO_MANY_REQUESTS,
    "RESOURCE_EXHAUSTED",
);

impl ApiError {
    /// The table: gRPC code, HTTP status, and the code's name in JSON and metrics.
    pub(super) fn codes(&self) -> Codes {
        match self {
            Self::Field(_) | Self::Malformed { .. } | Self::Truncated { .. } | Self::Document(_) => INVALID,
            Self::TooLarge { .. } => (
                Code::ResourceExhausted,
                StatusCode::PAYLOAD_TOO_LARGE,
                "RESOURCE_EXHAUSTED",
            ),
            Self::QueueFull { .. } | Self::ReaderSlow => FULL,
            Self::UnknownPack { .. } | Self::UnknownSession { .. } => NOT_FOUND,
            Self::SessionExpired { .. } => (Code::NotFound, StatusCode::GONE, "NOT_FOUND"),
            Self::SessionExists { .. } => EXISTS,
            Self::SessionBusy { .. } | Self::StyleIsBuiltIn { .. } => NOT_NOW,
            Self::TooManySessions { .. } | Self::TooManyStreams { .. } => FULL,
            Self::UnknownStyle { .. } | Self::CannotDo { .. } => INVALID,
            Self::Scenes { error, .. } => match error {
                TableError::Unknown { .. } => NOT_FOUND,
                TableError::Exists(_) => EXISTS,
                TableError::InUse { .. } => NOT_NOW,
                TableError::Full => FULL,
                TableError::Name(_) => INVALID,
            },
            Self::Objects { error, .. } => match error {
                SceneError::Unknown { .. } => NOT_FOUND,
                SceneError::Exists { .. } => EXISTS,
                SceneError::Taken { .. } | SceneError::NotHeld { .. } | SceneError::MoveHeld { .. } => {
                    NOT_NOW
                }
                SceneError::Full { .. } => FULL,
                SceneError::Value { .. } | SceneError::Shape { .. } => INVALID,
            },
            Self::Definitions { error, .. } => match error {
                DefinitionsError::Unknown { .. } => NOT_FOUND,
                DefinitionsError::InUse { .. } => NOT_NOW,
                DefinitionsError::Full => FULL,
            },
            Self::Refused { refusal, .. } => match refusal {
                Refusal::UnknownObject { .. } => NOT_FOUND,
                Refusal::TooManyCommands => FULL,
                Refusal::UnknownVariant { .. } | Refusal::UnknownApproach { .. } => INVALID,
                _ => NOT_NOW,
            },
            Self::UnknownRoute(_) => (Code::Unimplemented, StatusCode::NOT_FOUND, "NOT_FOUND"),
            Self::WrongMethod(_) => (
                Code::Unimplemented,
                StatusCode::METHOD_NOT_ALLOWED,
                "METHOD_NOT_ALLOWED",
            ),
            Self::Unavailable(_) => (Code::Unavailable, StatusCode::SERVICE_UNAVAILABLE, "UNAVAILABLE"),
            Self::Superseded => (Code::Aborted, StatusCode::CONFLICT, "ABORTED"),
            Self::DeadlineExceeded(_) | Self::WaitedTooLong { .. } => (
                Code::DeadlineExceeded,
                StatusCode::GATEWAY_TIMEOUT,
                "DEADLINE_EXCEEDED",
            ),
            Self::Unimplemented(_) => (Code::Unimplemented, StatusCode::NOT_IMPLEMENTED, "UNIMPLEMENTED"),
            Self::Internal(_) => (Code::Internal, StatusCode::INTERNAL_SERVER_ERROR, "INTERNAL"),
        }
    }

    /// A word for the kind of error, finer than its code: the reason in `google.rpc.ErrorInfo`.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::Field(_) => "INVALID_FIELD",
            Self::Malformed { .. } | Self::Truncated { .. } => "MALFORMED_REQUEST",
            Self::TooLarge { .. } => "REQUEST_TOO_LARGE",
            Self::UnknownPack { .. } => "UNKNOWN_PACK",
            Self::CannotDo { .. } => "PACK_CANNOT",
            Self::SessionExpired { .. } => "SESSION_EXPIRED",
            Self::UnknownSession { .. } => "UNKNOWN_SESSION",
            Self::SessionExists { .. } => "SESSION_EXISTS",
            Self::SessionBusy { .. } => "SESSION_BUSY",
            Self::TooManySessions { .. } => "TOO_MANY_SESSIONS",
            Self::TooManyStreams { .. } => "TOO_MANY_STREAMS",
            Self::UnknownStyle { .. } => "UNKNOWN_STYLE",
            Self::StyleIsBuiltIn { .. } => "STYLE_IS_BUILT_IN",
            Self::Document(_) => "INVALID_DOCUMENT",
            Self::Scenes { error, .. } => match error {
                TableError::Unknown { .. } => "UNKNOWN_SCENE",
                TableError::Exists(_) => "SCENE_EXISTS",
                TableError::InUse { .. } => "SCENE_IN_USE",
                TableError::Full => "TOO_MANY_SCENES",
                TableError::Name(_) => "INVALID_FIELD",
            },
            Self::Objects { error, .. } => match error {
                SceneError::Unknown { .. } => "UNKNOWN_OBJECT",
                SceneError::Exists { .. } => "OBJECT_EXISTS",
                SceneError::Taken { .. } | SceneError::NotHeld { .. } | SceneError::MoveHeld { .. } => {
                    "OBJECT_TAKEN"
                }
                SceneError::Full { .. } => "TOO_MANY_OBJECTS",
                SceneError::Value { .. } | SceneError::Shape { .. } => "INVALID_FIELD",
            },
            Self::Definitions { error, .. } => match error {
                DefinitionsError::Unknown { .. } => "UNKNOWN_OBJECT_DEFINITION",
                DefinitionsError::InUse { .. } => "OBJECT_DEFINITION_IN_USE",
                DefinitionsError::Full => "TOO_MANY_OBJECT_DEFINITIONS",
            },
            Self::Refused { refusal, .. } => match refusal {
                Refusal::NoScene => "NO_SCENE",
                Refusal::UnknownObject { .. } => "UNKNOWN_OBJECT",
                Refusal::WrongPack { .. } => "WRONG_PACK",
                Refusal::UnknownVariant { .. } => "UNKNOWN_VARIANT",
                Refusal::UnknownApproach { .. } => "UNKNOWN_APPROACH",
                Refusal::Taken { .. } => "OBJECT_TAKEN",
                Refusal::Blocked { .. } => "BLOCKED",
                Refusal::HandFull { .. } => "HAND_FULL",
                Refusal::TooManyCommands => "TOO_MANY_COMMANDS",
            },
            Self::UnknownRoute(_) => "UNKNOWN_ROUTE",
            Self::WrongMethod(_) => "WRONG_METHOD",
            Self::QueueFull { .. } => "QUEUE_FULL",
            Self::ReaderSlow => "READER_SLOW",
            Self::Unavailable(_) => "NOT_READY",
            Self::Superseded => "SUPERSEDED",
            Self::DeadlineExceeded(_) | Self::WaitedTooLong { .. } => "DEADLINE_EXCEEDED",
            Self::Unimplemented(_) => "UNIMPLEMENTED",
            Self::Internal(_) => "INTERNAL",
        }
    }

    /// The code's name, for metrics.
    pub fn label(&self) -> &'static str {
        self.codes().2
    }

    /// The field that is wrong, where the error is about one.
    pub(super) fn field(&self) -> Option<&str> {
        match self {
            Self::Field(error) => Some(&error.field),
            Self::Malformed { field, .. } => field.as_deref(),
            Self::TooLarge { .. } | Self::Truncated { .. } => Some("body"),
            Self::UnknownPack { field, .. } | Self::CannotDo { field, .. } => Some(field),
            Self::SessionExpired { field, .. }
            | Self::UnknownSession { field, .. }
            | Self::SessionExists { field, .. }
            | Self::SessionBusy { field, .. }
            | Self::UnknownStyle { field, .. }
            | Self::StyleIsBuiltIn { field, .. }
            | Self::Scenes { field, .. }
            | Self::Objects { field, .. }
            | Self::Definitions { field, .. }
            | Self::Refused { field, .. } => Some(field),
            Self::Document(error) if !error.field.is_empty() => Some(&error.field),
            Self::Document(_) => Some("document"),
            _ => None,
        }
    }

    /// What would be allowed, where the error is about a value or a size.
    pub(super) fn allowed(&self) -> Option<String> {
        match self {
            Self::Field(error) => Some(error.allowed.clone()),
            Self::TooLarge { limit_bytes } => Some(format!("at most {limit_bytes} bytes")),
            Self::Truncated { limit_bytes, .. } => {
                Some(format!("a whole message of at most {limit_bytes} bytes"))
            }
            Self::UnknownPack { loaded, .. } => Some(loaded.join(", ")),
            Self::CannotDo { wanted, .. } => Some(format!("a pack with the capability {wanted}")),
            Self::TooManySessions { limit, .. } | Self::TooManyStreams { limit } => {
                Some(format!("at most {limit}"))
            }
            Self::UnknownStyle { there_are, .. } => Some(there_are.join(", ")),
            Self::Refused {
                refusal:
                    Refusal::UnknownVariant { there_are, .. } | Refusal::UnknownApproach { there_are, .. },
                ..
            } => Some(there_are.join(", ")),
            Self::Refused {
                refusal: Refusal::TooManyCommands,
                ..
            } => Some(format!("at most {MAX_WAITING_COMMANDS} that wait")),
            Self::Document(error) => Some(error.allowed.clone()).filter(|allowed| !allowed.is_empty()),
            Self::Scenes { error, .. } => match error {
                TableError::Unknown { known, .. } => Some(names(known)),
                TableError::InUse { .. } => Some("a scene without sessions".to_owned()),
                TableError::Full => Some(format!("at most {MAX_SCENES}")),
                TableError::Name(_) => Some(format!("1 to {MAX_ID_BYTES} bytes")),
                TableError::Exists(_) => None,
            },
            Self::Objects { error, .. } => match error {
                SceneError::Value { allowed, .. } => Some(allowed.clone()),
                SceneError::Full { limit, .. } => Some(format!("at most {limit}")),
                _ => None,
            },
            Self::Definitions { error, .. } => match error {
                DefinitionsError::Unknown { known, .. } => Some(names(known)),
                DefinitionsError::InUse { .. } => Some("one of which no scene has an object".to_owned()),
                DefinitionsError::Full => Some(format!("at most {MAX_DEFINITIONS}")),
            },
            Self::StyleIsBuiltIn { .. } => Some("a name that none of the pack's own styles has".to_owned()),
            Self::SessionExists { .. } => Some("an id that is free, or none".to_owned()),
            _ => None,
        }
    }

    /// What is wrong with the field, range included.
    pub(super) fn description(&self) -> String {
        match self {
            Self::Field(error) => format!("{}; allowed: {}", error.message, error.allowed),
            Self::Malformed { message, .. } => message.clone(),
            other => other.to_string(),
        }
    }

    /// Line and column of what is wrong in a document, from 1.
    pub(super) fn place(&self) -> Option<(usize, usize)> {
        match self {
            Self::Document(error) => error.place,
            _ => None,
        }
    }

    /// When it is worth to try again.
    pub(super) fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::QueueFull { retry_after, .. } => Some(*retry_after),
            Self::TooManySessions { .. } | Self::TooManyStreams { .. } => Some(WHEN_SOMEBODY_LEAVES),
            _ => None,
        }
    }
}

/// Names as an error lists them.
fn names(names: &[String]) -> String {
    listed(names.iter().map(String::as_str))
}

//! The content of a stream's control messages. The server's API layer turns it into messages.

use std::time::Duration;

use troupe_proto::v1;

use crate::session::owner::End;
use crate::session::results::{CommandResult, SessionProblem};
use troupe_character::FieldError;

/// The content of a control message: everything that a stream sends apart from frames.
#[derive(Debug)]
pub enum Said {
    /// The answer to `attach`.
    Attached(Attached),
    /// Sessions that left the stream.
    Left(Vec<Departure>),
    /// Commands that were not simply accepted.
    Commands(Vec<CommandResult>),
    /// Events of characters.
    Events(Vec<v1::SessionEvents>),
    /// The stream ends. This is its last message.
    Closing(Closing),
}

/// The answer to `attach`.
#[derive(Debug, Default)]
pub struct Attached {
    /// Sessions that joined the stream.
    pub sessions: Vec<v1::Attached>,
    /// Sessions that could not join.
    pub problems: Vec<SessionProblem>,
}

/// A session that left a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Departure {
    /// The session's number on the stream, which is not used again.
    pub slot: u32,
    /// The session's id.
    pub session_id: String,
    /// How the session ended. `None`: it was only taken off the stream and stays open.
    pub end: Option<End>,
}

/// Why a stream ends.
#[derive(Debug)]
pub enum Closing {
    /// The client ended its half of the stream.
    ClientDone,
    /// The client disconnected, so no closing message can reach it.
    Gone,
    /// The server shuts down.
    Draining,
    /// The stream that was watched has ended.
    WatchedEnded,
    /// The client read nothing for this long.
    SlowReader(Duration),
    /// A message of the client could not be decoded.
    Unreadable(v1::Problem),
    /// A message of the client has a value that is not accepted.
    Invalid(FieldError),
}

impl From<FieldError> for Closing {
    fn from(error: FieldError) -> Self {
        Self::Invalid(error)
    }
}

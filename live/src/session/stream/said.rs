//! What a stream says besides frames. How it looks to a client is the edge's affair.

use std::time::Duration;

use troupe_proto::v1;

use crate::session::owner::End;
use crate::session::results::{CommandResult, SessionProblem};
use troupe_character::FieldError;

/// What a stream says, apart from frames.
#[derive(Debug)]
pub enum Said {
    /// Result of sessions that were to join.
    Attached(Attached),
    /// Sessions that left.
    Left(Vec<Departure>),
    /// Commands that were not simply accepted.
    Commands(Vec<CommandResult>),
    /// What happened to characters.
    Events(Vec<v1::SessionEvents>),
    /// The stream ends. Nothing comes after it.
    Closing(Closing),
}

/// Result of sessions that were to join a stream.
#[derive(Debug, Default)]
pub struct Attached {
    /// Those that joined.
    pub sessions: Vec<v1::Attached>,
    /// Those that could not.
    pub problems: Vec<SessionProblem>,
}

/// A session that left a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Departure {
    /// Its slot.
    pub slot: u32,
    /// Its id.
    pub session_id: String,
    /// How it ended; it goes on where it was only taken off the stream.
    pub end: Option<End>,
}

/// Why a stream ends.
#[derive(Debug)]
pub enum Closing {
    /// The client says that it is done.
    ClientDone,
    /// The client has gone: nobody is left to tell.
    Gone,
    /// The server shuts down.
    Draining,
    /// The stream that was watched is over.
    WatchedEnded,
    /// Nobody read for this long.
    SlowReader(Duration),
    /// The client said something that cannot be read.
    Unreadable(v1::Problem),
    /// The client said something that makes no sense.
    Invalid(FieldError),
}

impl From<FieldError> for Closing {
    fn from(error: FieldError) -> Self {
        Self::Invalid(error)
    }
}

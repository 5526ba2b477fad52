//! Results of single sessions and commands in an answer for many.

use troupe_character::live::CommandOutcome;

use super::SessionError;
use super::id::MAX_ID_CHARS;

/// Result of a command.
#[derive(Debug)]
pub struct CommandResult {
    /// Id of the session, or the start of what the command gave as one.
    pub session_id: String,
    /// The number that the client gave the command.
    pub sequence: u64,
    /// Whether the session took the command, or why not.
    pub outcome: Result<CommandOutcome, SessionError>,
}

/// A session that a call for many sessions could not serve.
#[derive(Debug, Clone)]
pub struct SessionProblem {
    /// Index of the session in the request.
    pub slot: u32,
    /// Id of the session, or the start of what the request gave as one.
    pub session_id: String,
    /// The reason.
    pub error: SessionError,
}

/// The answer to a call that closes sessions.
#[derive(Debug, Default)]
pub struct Closed {
    /// Number of sessions that were open.
    pub closed: u32,
    /// Sessions that may be open on other servers.
    pub problems: Vec<SessionProblem>,
}

impl SessionProblem {
    pub(super) fn new(slot: usize, id: &str, error: SessionError) -> Self {
        Self {
            slot: slot as u32,
            session_id: id.chars().take(MAX_ID_CHARS).collect(),
            error,
        }
    }
}

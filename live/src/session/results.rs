//! What an answer for many sessions says of each.

use troupe_character::live::CommandOutcome;

use super::SessionError;
use super::id::MAX_ID_CHARS;

/// Result of a command.
#[derive(Debug)]
pub struct CommandResult {
    /// Its session's id, or the start of what the command gave as one.
    pub session_id: String,
    /// Its number.
    pub sequence: u64,
    /// Result of it.
    pub outcome: Result<CommandOutcome, SessionError>,
}

/// A session that a call for many could not serve.
#[derive(Debug, Clone)]
pub struct SessionProblem {
    /// Its place in the request.
    pub slot: u32,
    /// Its id, or the start of what the request gave as one.
    pub session_id: String,
    /// Why.
    pub error: SessionError,
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

//! Notes for the caller about a motion.

use serde::Serialize;

/// How important a note is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The motion is as requested.
    Info,
    /// The motion differs from the request.
    Warning,
}

/// A note about a motion.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// A word for programs, such as `root_moved`.
    pub code: &'static str,
    /// How important the note is.
    pub severity: Severity,
    /// A sentence for people.
    pub message: String,
}

impl Note {
    /// A note about a motion that is as requested.
    pub fn info(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Info,
            message: message.into(),
        }
    }

    /// A note about a motion that differs from the request.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::info(code, message)
        }
    }
}

//! What is wrong with what is asked for.

/// What cannot be made into a definition.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{option}: {message}; allowed: {allowed}")]
pub(super) struct Wrong {
    option: &'static str,
    message: String,
    allowed: String,
}

impl Wrong {
    pub(super) fn new(option: &'static str, message: impl Into<String>, allowed: impl Into<String>) -> Self {
        let (message, allowed) = (message.into(), allowed.into());
        Self {
            option,
            message,
            allowed,
        }
    }
}

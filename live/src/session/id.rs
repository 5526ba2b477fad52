//! Ids of sessions.

use std::sync::Arc;

use crate::wire::units::{MAX_NAME_CHARS, is_name};
use troupe_character::{FieldError, Path};

/// Maximum length of a session's id, characters.
pub const MAX_ID_CHARS: usize = MAX_NAME_CHARS;

/// Checks the id that a client chose for a session. An empty one gets a random id.
pub(super) fn wanted(path: &Path<'_>, wanted: &str) -> Result<Arc<str>, FieldError> {
    if wanted.is_empty() {
        return Ok(new_id());
    }
    match is_name(wanted) {
        true => Ok(Arc::from(wanted)),
        false => {
            let start: String = wanted.chars().take(MAX_ID_CHARS).collect();
            Err(path.error(
                format!("is {start:?}"),
                format!("1 to {MAX_ID_CHARS} letters, digits, '-', '_' or '.', or empty"),
            ))
        }
    }
}

/// A random id that other clients cannot guess.
fn new_id() -> Arc<str> {
    let number: u128 = rand::random();
    Arc::from(format!("{:024x}", number >> 32))
}

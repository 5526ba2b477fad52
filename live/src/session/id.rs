//! Ids of sessions.

use std::sync::Arc;

use troupe_character::{FieldError, Path};

/// Most characters of a session's id.
pub const MAX_ID_CHARS: usize = 64;

/// The id that a session is to have; a new one where it is empty.
pub(super) fn wanted(path: &Path<'_>, wanted: &str) -> Result<Arc<str>, FieldError> {
    if wanted.is_empty() {
        return Ok(new_id());
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match wanted.len() <= MAX_ID_CHARS && wanted.chars().all(fits) {
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

/// An id that nobody can guess.
fn new_id() -> Arc<str> {
    let number: u128 = rand::random();
    Arc::from(format!("{:024x}", number >> 32))
}

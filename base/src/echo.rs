//! How much of a request an error may repeat.

/// Most characters of a message that may echo the request.
pub const MAX_MESSAGE: usize = 512;
/// Most characters of a field's path that may echo the request.
pub const MAX_PATH: usize = 256;

/// The first `limit` characters of `text`, with an ellipsis if some were cut off.
pub fn cut(text: &str, limit: usize) -> String {
    match text.char_indices().nth(limit) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_echo_is_cut_between_characters() {
        assert_eq!(cut("naïve", 3), "naï…");
        assert_eq!(cut("naïve", 5), "naïve");
        assert_eq!(cut("", 0), "");
    }
}

//! Rewrites the parsers' messages for people who do not program.

/// Types as the parsers name them, and in plain words.
const TYPES: [(&str, &str); 4] = [
    ("expected f32", "expected a number"),
    ("expected u32", "expected a whole number of 0 or more"),
    ("expected u64", "expected a whole number of 0 or more"),
    ("expected a sequence", "expected a list"),
];

/// Most characters that a message repeats of a wrong value. What was expected comes after it and
/// must stay in view.
const MAX_FOUND: usize = 100;

/// The message with types in plain words. The parsers call everything with named fields a `struct`,
/// followed by its Rust name.
pub fn plain(message: &str) -> String {
    // The value comes first, and may contain any words.
    let Some(at) = message.rfind(", expected ") else {
        return message.to_owned();
    };
    let (found, expected) = message.split_at(at);
    let mut expected = replaced(expected);
    if let Some((before, name)) = expected.split_once("expected struct ") {
        let rest = name.trim_start_matches(char::is_alphanumeric);
        expected = format!("{before}expected named fields{rest}");
    }
    let found = found
        .strip_suffix(" as i128")
        .or(found.strip_suffix(" as u128"))
        .unwrap_or(found);
    match found.char_indices().nth(MAX_FOUND) {
        Some((cut, _)) => format!("{}…{expected}", &found[..cut]),
        None => format!("{found}{expected}"),
    }
}

fn replaced(expected: &str) -> String {
    (TYPES.iter()).fold(expected.to_owned(), |text, (theirs, ours)| {
        text.replace(theirs, ours)
    })
}

/// The name of the field that the message calls missing.
pub(super) fn missing(message: &str) -> Option<&str> {
    message.strip_prefix("missing field `")?.strip_suffix('`')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_types_in_plain_words() {
        let cases = [
            (
                "invalid type: string \"far\", expected f32",
                "invalid type: string \"far\", expected a number",
            ),
            (
                "invalid value: integer `-1`, expected u32",
                "invalid value: integer `-1`, expected a whole number of 0 or more",
            ),
            (
                "invalid type: integer `99999999999999999999` as i128, expected u32",
                "invalid type: integer `99999999999999999999`, expected a whole number of 0 or more",
            ),
            (
                "invalid type: integer `5`, expected struct ObjectDoc",
                "invalid type: integer `5`, expected named fields",
            ),
            (
                "invalid type: string \"expected f32\", expected a boolean",
                "invalid type: string \"expected f32\", expected a boolean",
            ),
            (
                "unknown field `x`, expected `reach_m` or `shape`",
                "unknown field `x`, expected `reach_m` or `shape`",
            ),
            ("duplicate key", "duplicate key"),
        ];
        for (theirs, ours) in cases {
            assert_eq!(plain(theirs), ours);
        }
        let long = format!(
            "invalid type: string \"{}\", expected struct Document at line 1",
            "é".repeat(5000)
        );
        let said = plain(&long);
        assert!(
            said.ends_with("…, expected named fields at line 1") && said.len() < 300,
            "{said}"
        );
    }

    #[test]
    fn a_missing_field_is_named() {
        assert_eq!(missing("missing field `format`"), Some("format"));
        assert_eq!(missing("unknown field `format`"), None);
    }
}

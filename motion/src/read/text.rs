//! Bytes of a text in any encoding that programs write.

/// A text, and how it was encoded if that is not UTF-8 without a mark.
pub(super) struct Text {
    pub(super) text: String,
    /// The end of a sentence about the file.
    pub(super) note: Option<String>,
}

/// Decodes UTF-8 and UTF-16 with or without a byte order mark, and Windows' Latin letters, in which
/// every byte is a letter.
pub(super) fn decode(bytes: &[u8]) -> Text {
    let noted = |text: String, note: &str| Text {
        text,
        note: Some(note.to_owned()),
    };
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => match str::from_utf8(rest) {
            Ok(text) => noted(text.to_owned(), "it begins with a byte order mark (UTF-8)"),
            Err(_) => noted(
                latin(rest),
                "it is marked as UTF-8, but is Latin 1 (Windows-1252)",
            ),
        },
        [0xff, 0xfe, rest @ ..] => noted(utf16(rest, u16::from_le_bytes), "it is UTF-16 (little-endian)"),
        [0xfe, 0xff, rest @ ..] => noted(utf16(rest, u16::from_be_bytes), "it is UTF-16 (big-endian)"),
        // ASCII as UTF-16 without a mark.
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => {
            noted(utf16(bytes, u16::from_le_bytes), "it is UTF-16 (little-endian)")
        }
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => {
            noted(utf16(bytes, u16::from_be_bytes), "it is UTF-16 (big-endian)")
        }
        _ => match str::from_utf8(bytes) {
            Ok(text) => Text {
                text: text.to_owned(),
                note: None,
            },
            Err(at) => {
                let line = 1 + bytes[..at.valid_up_to()].iter().filter(|&&b| b == b'\n').count();
                let note = format!("line {line} is no UTF-8: the file is read as Latin 1 (Windows-1252)");
                noted(latin(bytes), &note)
            }
        },
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units)
        .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}

/// Latin 1; the letters that Windows-1252 adds to it stand in no joint's name.
fn latin(bytes: &[u8]) -> String {
    bytes.iter().map(|&byte| char::from(byte)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "ROOT Hüfte\r\n";
        let units: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let with = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for (bytes, note) in [
            (text.as_bytes().to_vec(), None),
            (with(b"\xef\xbb\xbf", text.as_bytes()), Some("byte order mark")),
            (with(b"\xff\xfe", &little), Some("UTF-16 (little-endian)")),
            (with(b"\xfe\xff", &big), Some("UTF-16 (big-endian)")),
            (little, Some("UTF-16 (little-endian)")),
            (big, Some("UTF-16 (big-endian)")),
            (latin.clone(), Some("line 1 is no UTF-8")),
            (with(b"\xef\xbb\xbf", &latin), Some("marked as UTF-8, but")),
        ] {
            let found = decode(&bytes);
            assert_eq!(found.text, text);
            assert_eq!(found.note.is_some(), note.is_some());
            assert!(found.note.unwrap_or_default().contains(note.unwrap_or_default()));
        }
        assert_eq!(decode(b"").text, "");
        assert_eq!(decode(b"\xff\xfe1").text, "");
    }
}

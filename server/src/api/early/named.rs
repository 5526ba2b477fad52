//! Finds the pack that a call names in the beginning of its body.

use std::borrow::Cow;

use prost::Message as _;
use serde::Deserialize;

/// Bytes in front of a message over gRPC: whether it is compressed, and its length.
const GRPC_PREFIX: usize = 5;
/// Tag of a text in the first field of a message.
const FIRST_TEXT: u8 = 1 << 3 | 2;

/// The fields that name a pack. All others are skipped.
#[derive(Clone, PartialEq, prost::Message)]
struct Named {
    #[prost(string, tag = "1")]
    pack: String,
}

/// The pack in a message over gRPC whose first field it is. Empty: the default pack. None: the
/// beginning does not say.
pub(super) fn in_grpc(begin: &[u8]) -> Option<Cow<'_, str>> {
    let (prefix, message) = begin.split_at_checked(GRPC_PREFIX)?;
    let [0, length @ ..] = prefix else {
        return None;
    };
    if let [FIRST_TEXT, bytes, rest @ ..] = message
        && *bytes < 0x80
        && let Some(name) = rest.get(..usize::from(*bytes))
    {
        return std::str::from_utf8(name).ok().map(Cow::Borrowed);
    }
    let whole = u32::from_be_bytes(length.try_into().ok()?) as usize;
    let message = message.get(..whole)?;
    Named::decode(message).ok().map(|named| named.pack.into())
}

/// The pack in a JSON body, named by `key`. Empty: the default pack. None: the beginning does not
/// say.
pub(super) fn in_json<'a>(begin: &'a [u8], key: &str) -> Option<Cow<'a, str>> {
    if let Some(first) = first_in_json(begin, key) {
        return Some(first.into());
    }
    // A whole body that names the pack later, or not at all.
    #[derive(Deserialize)]
    struct Named<'a> {
        #[serde(borrow, default)]
        pack: Cow<'a, str>,
        #[serde(borrow)]
        model: Option<Cow<'a, str>>,
    }
    let named: Named<'a> = serde_json::from_slice(begin).ok()?;
    match key {
        "model" => named.model,
        _ => Some(named.pack),
    }
}

/// The text of the first member of an object if it has this key.
fn first_in_json<'a>(begin: &'a [u8], key: &str) -> Option<&'a str> {
    let text = |bytes: &'a [u8]| -> Option<(&'a str, &'a [u8])> {
        let inner = bytes.trim_ascii_start().strip_prefix(b"\"")?;
        let end = inner.iter().position(|byte| matches!(byte, b'"' | b'\\'))?;
        let rest = inner[end..].strip_prefix(b"\"")?;
        Some((std::str::from_utf8(&inner[..end]).ok()?, rest))
    };
    let (found, rest) = text(begin.trim_ascii_start().strip_prefix(b"{")?)?;
    let (name, _) = text(rest.trim_ascii_start().strip_prefix(b":")?)?;
    (found == key).then_some(name)
}

#[cfg(test)]
mod tests {
    use troupe_proto::v1;

    use super::*;

    fn framed(request: &v1::GenerateRequest) -> Vec<u8> {
        let message = request.encode_to_vec();
        let mut framed = vec![0];
        framed.extend((message.len() as u32).to_be_bytes());
        framed.extend(message);
        framed
    }

    #[test]
    fn the_pack_of_a_message_is_found_in_its_beginning() {
        let request = v1::GenerateRequest {
            pack: "human".to_owned(),
            seed: 7,
            ..Default::default()
        };
        let whole = framed(&request);
        assert_eq!(in_grpc(&whole).unwrap(), "human");
        assert_eq!(in_grpc(&whole[..12]).unwrap(), "human");
        assert_eq!(in_grpc(&whole[..11]), None);
        let compressed: Vec<u8> = [1].into_iter().chain(whole[1..].iter().copied()).collect();
        assert_eq!(in_grpc(&compressed), None);
        let of_default = framed(&v1::GenerateRequest {
            pack: String::new(),
            ..request
        });
        assert_eq!(in_grpc(&of_default).unwrap(), "");
        assert_eq!(in_grpc(&of_default[..of_default.len() - 1]), None);
        assert_eq!(in_grpc(b""), None);
    }

    #[test]
    fn the_pack_of_json_is_found_in_its_beginning_or_in_the_whole() {
        for (begin, key, found) in [
            (r#" { "pack" : "human" , "seed": 1"#, "pack", Some("human")),
            (r#"{"seed": 1, "pack": "human"}"#, "pack", Some("human")),
            (r#"{"seed": 1, "pack": "hum"#, "pack", None),
            (r#"{"seed": 1}"#, "pack", Some("")),
            (r#"{"pack": "h\u0075man"}"#, "pack", Some("human")),
            (r#"{"pack": 3}"#, "pack", None),
            (
                r#"{"protocol_version": "1.4", "model": "human"}"#,
                "model",
                Some("human"),
            ),
            (r#"{"requests": []}"#, "model", None),
            ("", "pack", None),
            ("[1]", "pack", None),
        ] {
            assert_eq!(in_json(begin.as_bytes(), key).as_deref(), found, "{begin}");
        }
    }

    proptest::proptest! {
        #[test]
        fn any_beginning_is_read(begin: Vec<u8>) {
            in_grpc(&begin);
            in_json(&begin, "pack");
        }
    }
}

//! A look at the shape of a request before it is decoded. An empty message takes two bytes on the wire and a hundred
//! times as much in memory, so a body within the size limit could still take gigabytes. Counting its parts is cheap.

use bytes::Bytes;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};

use super::ApiError;
use crate::inbetween::{FieldError, Path};

/// Most keyframes of a character that are decoded; the pack's own, smaller limit is checked later.
const MAX_KEYFRAMES: usize = 256;
/// Most objects and arrays of a character in JSON. A full one has some sixty; its id may hold more of their signs.
const MAX_JSON_PARTS: usize = 1024;

/// Field numbers of `InBetweenRequest.characters`, `Character.context` and `Character.targets`.
const CHARACTERS: u32 = 2;
const CONTEXT: u32 = 2;
const TARGETS: u32 = 3;

/// Checks an `InBetweenRequest` in gRPC framing. What is not whole, compressed or no protobuf passes: decoding says more.
pub(super) fn check_grpc(frame: &Bytes, max_characters: usize) -> Result<(), ApiError> {
    match frame.split_first_chunk::<5>() {
        Some(([0, ..], message)) => check_protobuf(message, max_characters),
        _ => Ok(()),
    }
}

fn check_protobuf(message: &[u8], max_characters: usize) -> Result<(), ApiError> {
    let root = Path::root();
    let characters = Parts(message).filter(|part| part.0 == CHARACTERS);
    for (index, (_, character)) in characters.enumerate() {
        if index >= max_characters {
            return Err(too_many(&root.field("characters"), "characters", max_characters));
        }
        for (field, name) in [(CONTEXT, "context"), (TARGETS, "targets")] {
            if Parts(character)
                .filter(|part| part.0 == field)
                .nth(MAX_KEYFRAMES)
                .is_some()
            {
                let character = root.element("characters", index);
                return Err(too_many(&character.field(name), "keyframes", MAX_KEYFRAMES));
            }
        }
    }
    Ok(())
}

/// Checks an `InBetweenRequest` as JSON.
pub(super) fn check_json(body: &[u8], max_characters: usize) -> Result<(), ApiError> {
    let parts = body.iter().filter(|&&byte| byte == b'{' || byte == b'[').count();
    match parts <= MAX_JSON_PARTS.saturating_mul(max_characters) {
        true => Ok(()),
        false => Err(too_many(
            &Path::root().field("characters"),
            "characters or keyframes",
            max_characters,
        )),
    }
}

fn too_many(path: &Path<'_>, what: &str, limit: usize) -> ApiError {
    let error: FieldError = path.error(format!("has more than {limit} {what}"), format!("1 to {limit}"));
    error.into()
}

/// The length-delimited fields of a message, by number. Ends where the message ends or makes no sense.
struct Parts<'a>(&'a [u8]);

impl<'a> Iterator for Parts<'a> {
    type Item = (u32, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        while !self.0.is_empty() {
            let (number, wire_type) = decode_key(&mut self.0).ok()?;
            if wire_type == WireType::LengthDelimited {
                let length = usize::try_from(decode_varint(&mut self.0).ok()?).ok()?;
                let (part, rest) = self.0.split_at_checked(length)?;
                self.0 = rest;
                return Some((number, part));
            }
            skip_field(wire_type, number, &mut self.0, DecodeContext::default()).ok()?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use prost::Message as _;
    use troupe_proto::v1;

    use super::*;

    fn framed(message: Vec<u8>) -> Bytes {
        let length = u32::try_from(message.len()).unwrap();
        [&[0], length.to_be_bytes().as_slice(), &message].concat().into()
    }

    fn request(characters: usize, targets: usize) -> v1::InBetweenRequest {
        let character = v1::Character {
            id: "{[".repeat(64),
            seed: 7,
            frame_count: Some(64),
            temperature: 1.0,
            context: vec![v1::Keyframe::default(); 4],
            targets: vec![v1::Keyframe::default(); targets],
            ..v1::Character::default()
        };
        v1::InBetweenRequest {
            pack: "human".into(),
            characters: vec![character; characters],
        }
    }

    #[test]
    fn protobuf_parts_are_counted() {
        let field = |request: v1::InBetweenRequest| match check_grpc(&framed(request.encode_to_vec()), 3) {
            Ok(()) => None,
            Err(ApiError::Field(error)) => Some((error.field, error.allowed)),
            Err(other) => panic!("{other}"),
        };
        assert_eq!(field(request(3, 256)), None);
        assert_eq!(field(request(4, 1)), Some(("characters".into(), "1 to 3".into())));
        assert_eq!(
            field(request(1, 257)),
            Some(("characters[0].targets".into(), "1 to 256".into()))
        );
    }

    #[test]
    fn json_parts_are_counted() {
        let full = serde_json::to_vec(&request(3, 4)).unwrap();
        check_json(&full, 3).unwrap();
        for (start, part) in [("{\"characters\":[", "{},"), ("[", "[],")] {
            let body = format!("{start}{}", part.repeat(3 * MAX_JSON_PARTS));
            assert!(check_json(body.as_bytes(), 3).is_err());
        }
    }

    #[test]
    fn what_makes_no_sense_is_left_to_the_decoder() {
        let good = framed(request(1, 1).encode_to_vec());
        for cut in 0..good.len() {
            check_grpc(&good.slice(..cut), 3).unwrap();
        }
        check_grpc(&framed(vec![0xff; 40]), 3).unwrap();
        check_grpc(&Bytes::from_static(&[1, 0, 0, 0, 0]), 3).unwrap();
    }
}

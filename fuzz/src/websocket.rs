//! A stream over WebSocket, for the messages of one client in order.

use axum::extract::ws::Message;
use prost::Message as _;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use crate::home::Local;
use crate::planted;

/// The byte between two messages of an input: JSON text cannot contain it.
pub const SEPARATOR: u8 = 0x1e;
/// The first byte of a binary message.
const BINARY: u8 = 0;
/// The most messages that the target reads from an input.
const MAX_MESSAGES: usize = 16;

fn message(piece: &[u8]) -> Message {
    let binary = |bytes: &[u8]| Message::Binary(bytes.to_vec().into());
    match (piece, std::str::from_utf8(piece)) {
        ([BINARY, rest @ ..], _) => binary(rest),
        (_, Ok(text)) => Message::Text(text.into()),
        (_, Err(_)) => binary(piece),
    }
}

/// A stream's messages, text and binary. The server says why the stream ends, in the form of the
/// first message, and closes it.
pub fn websocket(bytes: &[u8]) {
    let pieces = bytes.split(|byte| *byte == SEPARATOR).take(MAX_MESSAGES);
    let messages: Vec<Message> = pieces.map(message).collect();
    let text = matches!(messages.first(), Some(Message::Text(_)) | None);
    let binary = messages
        .iter()
        .any(|message| matches!(message, Message::Binary(_)));
    Local::with(|local| {
        let said = local.run(async {
            let said = local.reader.websocket(local.service(), messages).await;
            local.reset_sessions().await;
            said.expect("a free stream")
        });
        let (close, said) = said.split_last().expect("an end");
        assert!(matches!(close, Message::Close(Some(_))), "{close:?}");
        let said: Vec<Say> = said.iter().map(|message| read(message, text)).collect();
        let (last, rest) = said.split_last().expect("a reason");
        let Say::Closing(closing) = last else {
            panic!("{last:?}")
        };
        let reason = closing.reason.as_ref().expect("a reason");
        assert!(!reason.message.is_empty());
        match reason.reason.as_str() {
            "CLIENT_DONE" => {}
            // If protobuf cannot be decoded, the field is unknown.
            "INVALID_REQUEST" => assert!(!reason.field.is_empty() || binary, "{reason:?}"),
            other => panic!("{other}: {reason:?}"),
        }
        planted(|| {
            let attached =
                |say: &Say| matches!(say, Say::Attached(attached) if !attached.sessions.is_empty());
            let left = |say: &Say| matches!(say, Say::Left(_));
            let refused = |say: &Say| matches!(say, Say::Commands(_));
            [
                rest.iter().any(attached),
                rest.iter().any(left),
                rest.iter().any(refused),
            ]
        });
    });
}

fn read(message: &Message, text: bool) -> Say {
    let said: v1::DriveResponse = match message {
        Message::Text(json) if text => serde_json::from_str(json).expect("an answer is JSON"),
        Message::Binary(bytes) if !text => v1::DriveResponse::decode(bytes.as_ref()).expect("an answer"),
        other => panic!("{other:?} is in another form than the first message"),
    };
    said.message.expect("an answer says something")
}

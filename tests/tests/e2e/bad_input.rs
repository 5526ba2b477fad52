//! Bad input: for each kind, over gRPC and HTTP, the error has the right code and names the field
//! and its allowed values.

use bytes::{Buf as _, BufMut as _};
use prost::Message as _;
use serde_json::Value;
use tonic::Code;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use troupe_client::{ClientError, InBetween, SegmentLength};
use troupe_proto::v1;

use crate::motion::{character, request, walk};
use crate::server::{ErrorAnswer, shared};

/// One kind of bad input: its name, a change that spoils a good request, and the field and the
/// allowed values that the error must name.
struct Case {
    what: &'static str,
    spoil: fn(&mut v1::InBetweenRequest),
    field: &'static str,
    allowed: &'static str,
}

fn first(request: &mut v1::InBetweenRequest) -> &mut v1::Character {
    &mut request.characters[0]
}

fn rotations(key: &mut v1::Keyframe) -> &mut Vec<f32> {
    &mut key.pose.as_mut().unwrap().rotations
}

fn root(frame: u32, x: f32) -> v1::RootKey {
    v1::RootKey {
        frame,
        x: Some(x),
        z: Some(0.0),
        ..v1::RootKey::default()
    }
}

const CASES: [Case; 28] = [
    Case {
        what: "a joint too few in the context",
        spoil: |r| rotations(&mut first(r).context[2]).truncate(80),
        field: "characters[0].context[2].pose.rotations",
        allowed: "exactly 84",
    },
    Case {
        what: "a joint too many in the target",
        spoil: |r| rotations(&mut first(r).targets[0]).extend([1.0, 0.0, 0.0, 0.0]),
        field: "characters[0].targets[0].pose.rotations",
        allowed: "exactly 84",
    },
    Case {
        what: "an infinite position",
        spoil: |r| {
            first(r).context[3]
                .root
                .as_mut()
                .unwrap()
                .position
                .as_mut()
                .unwrap()
                .x = f32::INFINITY
        },
        field: "characters[0].context[3].root.position.x",
        allowed: "finite",
    },
    Case {
        what: "a position that is not a number",
        spoil: |r| {
            first(r).context[0]
                .root
                .as_mut()
                .unwrap()
                .position
                .as_mut()
                .unwrap()
                .y = f32::NAN
        },
        field: "characters[0].context[0].root.position.y",
        allowed: "finite",
    },
    Case {
        what: "a rotation that is not a number",
        spoil: |r| rotations(&mut first(r).targets[0])[83] = f32::NAN,
        field: "characters[0].targets[0].pose.rotations[83]",
        allowed: "finite",
    },
    Case {
        what: "an infinite rotation",
        spoil: |r| rotations(&mut first(r).context[0])[5] = f32::NEG_INFINITY,
        field: "characters[0].context[0].pose.rotations[5]",
        allowed: "finite",
    },
    Case {
        what: "an infinite heading",
        spoil: |r| first(r).targets[0].root.as_mut().unwrap().heading = Some(f32::INFINITY),
        field: "characters[0].targets[0].root.heading",
        allowed: "finite",
    },
    Case {
        what: "a rotation twice as long as it may be",
        spoil: |r| {
            rotations(&mut first(r).targets[0])[4..8]
                .iter_mut()
                .for_each(|v| *v *= 2.0)
        },
        field: "characters[0].targets[0].pose.rotations[4]",
        allowed: "0.999 to 1.001",
    },
    Case {
        what: "a rotation of zeros",
        spoil: |r| rotations(&mut first(r).context[1])[80..].fill(0.0),
        field: "characters[0].context[1].pose.rotations[80]",
        allowed: "0.999 to 1.001",
    },
    Case {
        what: "a segment of 11 frames",
        spoil: |r| first(r).frame_count = Some(11),
        field: "characters[0].frame_count",
        allowed: "12 to 64",
    },
    Case {
        what: "a segment of 65 frames",
        spoil: |r| first(r).frame_count = Some(65),
        field: "characters[0].frame_count",
        allowed: "12 to 64",
    },
    Case {
        what: "no frames at all",
        spoil: |r| first(r).frame_count = Some(0),
        field: "characters[0].frame_count",
        allowed: "12 to 64",
    },
    Case {
        what: "two tokens",
        spoil: |r| {
            first(r).frame_count = None;
            first(r).allowed_token_counts = vec![4, 2];
        },
        field: "characters[0].allowed_token_counts[1]",
        allowed: "3 to 16",
    },
    Case {
        what: "seventeen tokens",
        spoil: |r| {
            first(r).frame_count = None;
            first(r).allowed_token_counts = vec![17];
        },
        field: "characters[0].allowed_token_counts[0]",
        allowed: "3 to 16",
    },
    Case {
        what: "an empty request",
        spoil: |r| r.characters.clear(),
        field: "characters",
        allowed: "1 to 256",
    },
    Case {
        what: "too many characters",
        spoil: |r| r.characters = vec![v1::Character::default(); 257],
        field: "characters",
        allowed: "1 to 256",
    },
    Case {
        what: "three context frames",
        spoil: |r| first(r).context.truncate(3),
        field: "characters[0].context",
        allowed: "exactly 4",
    },
    Case {
        what: "no target",
        spoil: |r| first(r).targets.clear(),
        field: "characters[0].targets",
        allowed: "1 to 4",
    },
    Case {
        what: "a target that fixes nothing",
        spoil: |r| first(r).targets[0] = v1::Keyframe::default(),
        field: "characters[0].targets[0]",
        allowed: "at least one of root, velocity and pose",
    },
    Case {
        what: "a context frame without its root",
        spoil: |r| first(r).context[1].root = None,
        field: "characters[0].context[1].root",
        allowed: "every context keyframe",
    },
    Case {
        what: "a target a light year away",
        spoil: |r| {
            first(r).targets[0]
                .root
                .as_mut()
                .unwrap()
                .position
                .as_mut()
                .unwrap()
                .z = 9.5e15
        },
        field: "characters[0].targets[0].root.position",
        allowed: "10000",
    },
    Case {
        what: "too hot",
        spoil: |r| first(r).temperature = 2.5,
        field: "characters[0].temperature",
        allowed: "0 to 2",
    },
    Case {
        what: "no passes",
        spoil: |r| first(r).pose_steps = Some(0),
        field: "characters[0].pose_steps",
        allowed: "1 to 10",
    },
    Case {
        what: "a given root behind the end",
        spoil: |r| first(r).root = vec![root(10, 0.0), root(30, 0.0)],
        field: "characters[0].root[1].frame",
        allowed: "11 to 29",
    },
    Case {
        what: "given roots out of order",
        spoil: |r| first(r).root = vec![root(20, 0.0), root(10, 0.0)],
        field: "characters[0].root[1].frame",
        allowed: "frames that rise",
    },
    Case {
        what: "an infinite given root",
        spoil: |r| first(r).root = vec![root(10, f32::INFINITY)],
        field: "characters[0].root[0].x",
        allowed: "finite",
    },
    Case {
        what: "a given root that contradicts the target",
        spoil: |r| first(r).root = vec![root(29, -300.0)],
        field: "characters[0].root[0]",
        allowed: "within 0.001 m",
    },
    Case {
        what: "a long id",
        spoil: |r| first(r).id = "x".repeat(129),
        field: "characters[0].id",
        allowed: "128",
    },
];

async fn good() -> v1::InBetweenRequest {
    request([character(&shared().pack().await)])
}

async fn spoilt(spoil: impl Fn(&mut v1::InBetweenRequest)) -> v1::InBetweenRequest {
    let mut request = good().await;
    spoil(&mut request);
    request
}

/// The error of a bad request over gRPC.
async fn by_grpc(request: v1::InBetweenRequest) -> ErrorAnswer {
    ErrorAnswer::from_status(
        &shared()
            .rpc()
            .await
            .in_between(request)
            .await
            .expect_err("a bad request"),
    )
}

fn check(way: &str, case: &Case, error: &ErrorAnswer) {
    let what = case.what;
    assert_eq!(
        error.field.as_deref(),
        Some(case.field),
        "{what} over {way}: {error:?}"
    );
    assert!(
        error
            .allowed
            .as_deref()
            .unwrap_or_default()
            .contains(case.allowed),
        "{what} over {way}: {error:?}"
    );
    assert!(error.message.contains(case.field), "{what} over {way}: {error:?}");
}

#[tokio::test]
async fn every_bad_value_is_named_over_grpc() {
    for case in &CASES {
        let error = by_grpc(spoilt(case.spoil).await).await;
        assert_eq!(
            error.grpc,
            Some(Code::InvalidArgument),
            "{}: {error:?}",
            case.what
        );
        check("gRPC", case, &error);
    }
}

#[tokio::test]
async fn every_bad_value_is_named_over_http() {
    for case in &CASES {
        let mut body = serde_json::to_value(spoilt(case.spoil).await).unwrap();
        nulls_to_infinity(&mut body);
        let error = shared().post_text(body.to_string()).await.expect_err(case.what);
        assert_eq!(error.http, Some(400), "{}: {error:?}", case.what);
        check("HTTP", case, &error);
    }
}

/// JSON has no NaN and no infinity; writers write null instead. A number too large for 32 bits
/// still reaches the server as infinity.
fn nulls_to_infinity(value: &mut Value) {
    match value {
        Value::Null => *value = 1e39.into(),
        Value::Array(items) => items.iter_mut().for_each(nulls_to_infinity),
        // `hold_feet` is null too if it is not set, but it is no number.
        Value::Object(entries) => {
            let numbers = entries.iter_mut().filter(|(name, _)| *name != "hold_feet");
            numbers.for_each(|(_, value)| nulls_to_infinity(value));
        }
        _ => {}
    }
}

#[tokio::test]
async fn the_client_library_names_field_and_range() {
    let (client, pack) = shared().client().await;
    let gap = InBetween::from_clip(&walk(&pack), 40, 66)
        .unwrap()
        .length(SegmentLength::Frames(65));
    let error = client
        .in_between(&pack, &gap)
        .await
        .expect_err("a frame too many");
    let [violation] = error.violations() else {
        panic!("{error:?}")
    };
    assert_eq!(violation.field, "characters[0].frame_count");
    assert_eq!(violation.allowed.as_deref(), Some("12 to 64"));

    let error = client.pack("missing").await.expect_err("no such pack");
    assert!(
        matches!(&error, ClientError::Refused(refusal) if refusal.code == Code::NotFound),
        "{error:?}"
    );
    assert_eq!(error.violations()[0].allowed.as_deref(), Some(pack.name()));
}

#[tokio::test]
async fn an_unknown_pack_is_not_found() {
    let known = shared().pack().await.name().to_owned();
    let request = spoilt(|r| r.pack = "missing".to_owned()).await;
    let error = by_grpc(request.clone()).await;
    assert_eq!(error.grpc, Some(Code::NotFound), "{error:?}");
    let by_http = shared().post(&request).await.expect_err("no such pack");
    assert_eq!(by_http.http, Some(404), "{by_http:?}");
    for error in [error, by_http] {
        assert_eq!(error.field.as_deref(), Some("pack"), "{error:?}");
        assert!(error.message.contains("missing"), "{error:?}");
        assert!(
            error.allowed.as_deref().unwrap_or_default().contains(&known),
            "{error:?}"
        );
    }
}

#[tokio::test]
async fn an_oversized_request_is_refused_with_the_limit() {
    const LIMIT: usize = 16 << 20;
    let request = spoilt(|r| r.characters = vec![r.characters[0].clone(); 10_500]).await;
    assert!(request.encoded_len() > LIMIT);
    let by_grpc = by_grpc(request).await;
    assert_eq!(by_grpc.grpc, Some(Code::ResourceExhausted), "{by_grpc:?}");

    let mut body = serde_json::to_string(&good().await).unwrap();
    body.push_str(&" ".repeat(LIMIT));
    let by_http = shared().post_text(body).await.expect_err("a body over the limit");
    assert_eq!(by_http.http, Some(413), "{by_http:?}");
    for error in [by_grpc, by_http] {
        assert_eq!(error.allowed, Some(format!("at most {LIMIT} bytes")), "{error:?}");
    }
}

#[tokio::test]
async fn a_truncated_grpc_message_is_invalid() {
    let whole = good().await.encode_to_vec();
    for length in [1, whole.len() / 2, whole.len() - 1] {
        let mut grpc = tonic::client::Grpc::new(shared().channel().await);
        grpc.ready().await.unwrap();
        let path = http::uri::PathAndQuery::from_static("/troupe.v1.Motion/InBetween");
        let cut = tonic::Request::new(whole[..length].to_vec());
        let status = grpc.unary(cut, path, RawCodec).await.expect_err("half a message");
        let code = status.code();
        assert!(
            matches!(code, Code::InvalidArgument | Code::Internal),
            "{length} bytes: {status}"
        );
    }
}

/// Sends bytes without encoding them.
#[derive(Default)]
struct RawCodec;

impl Codec for RawCodec {
    type Encode = Vec<u8>;
    type Decode = ();
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for RawCodec {
    type Item = Vec<u8>;
    type Error = tonic::Status;

    fn encode(&mut self, item: Vec<u8>, buffer: &mut EncodeBuf<'_>) -> Result<(), tonic::Status> {
        buffer.put_slice(&item);
        Ok(())
    }
}

impl Decoder for RawCodec {
    type Item = ();
    type Error = tonic::Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<()>, tonic::Status> {
        buffer.advance(buffer.remaining());
        Ok(Some(()))
    }
}

#[tokio::test]
async fn bodies_that_are_no_request_have_different_errors_over_http() {
    let whole = serde_json::to_string(&good().await).unwrap();
    let nan = whole.replacen("\"rotations\":[", "\"rotations\":[NaN,", 1);
    let text = whole.replacen("\"seed\":\"0\"", "\"seed\":\"seven\"", 1);
    let unknown = whole.replacen("\"seed\":", "\"sede\":", 1);
    for (what, body, expected) in [
        ("half a body", &whole[..whole.len() / 2], "EOF"),
        ("no body", "", "EOF"),
        ("not JSON", "frames, please", "line 1"),
        ("NaN", &nan, "line 1"),
        ("text for a number", &text, "seven"),
        ("an unknown field", &unknown, "sede"),
    ] {
        let error = shared().post_text(body.to_owned()).await.expect_err(what);
        assert_eq!(error.http, Some(400), "{what}: {error:?}");
        assert!(error.message.contains(expected), "{what}: {error:?}");
    }
}

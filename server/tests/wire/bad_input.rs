//! Every kind of bad input, over gRPC and HTTP: the code, the field and the allowed range.

use prost::Message as _;
use reqwest::StatusCode;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::{TestServer, character, framed, keyframe, request};

/// What a request turns into, and what the answer must say.
struct Case {
    name: &'static str,
    change: fn(&mut v1::InBetweenRequest),
    field: &'static str,
    /// Must be part of the description.
    says: &'static str,
}

fn first(request: &mut v1::InBetweenRequest) -> &mut v1::Character {
    &mut request.characters[0]
}

fn rotations(key: &mut v1::Keyframe) -> &mut Vec<f32> {
    &mut key.pose.as_mut().unwrap().rotations
}

fn position(key: &mut v1::Keyframe) -> &mut v1::Vec3 {
    key.root.as_mut().unwrap().position.as_mut().unwrap()
}

fn root(frame: u32, x: f32, z: f32) -> v1::RootKey {
    v1::RootKey {
        frame,
        x: Some(x),
        z: Some(z),
        ..v1::RootKey::default()
    }
}

#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { name: "empty request", change: |r| r.characters.clear(), field: "characters", says: "1 to 256" },
    Case { name: "too many characters", change: |r| r.characters = vec![character(0.0); 257], field: "characters", says: "1 to 256" },
    Case { name: "long id", change: |r| first(r).id = "é".repeat(65), field: "characters[0].id", says: "at most 128 bytes" },
    Case { name: "three context frames", change: |r| first(r).context.truncate(3), field: "characters[0].context", says: "exactly 4" },
    Case { name: "five context frames", change: |r| first(r).context.push(keyframe(0.0, 0.0)), field: "characters[0].context", says: "exactly 4" },
    Case { name: "no target", change: |r| first(r).targets.clear(), field: "characters[0].targets", says: "1 to 4" },
    Case { name: "five targets", change: |r| first(r).targets = vec![keyframe(0.0, 3.0); 5], field: "characters[0].targets", says: "1 to 4" },
    Case { name: "wrong joint count", change: |r| rotations(&mut first(r).context[2]).extend([1.0, 0.0, 0.0, 0.0]), field: "characters[0].context[2].pose.rotations", says: "exactly 8: 4 (w, x, y, z) for each of the pack's 2 joints" },
    Case { name: "not a unit rotation", change: |r| rotations(&mut first(r).targets[0])[4] = 1.01, field: "characters[0].targets[0].pose.rotations[4]", says: "unit length, 0.999 to 1.001" },
    Case { name: "keyframe with nothing", change: |r| first(r).targets[0] = v1::Keyframe::default(), field: "characters[0].targets[0]", says: "at least one of root, velocity and pose" },
    Case { name: "context without root", change: |r| first(r).context[1].root = None, field: "characters[0].context[1].root", says: "root and pose in every context keyframe" },
    Case { name: "context without pose", change: |r| first(r).context[3].pose = None, field: "characters[0].context[3].pose", says: "root and pose in every context keyframe" },
    Case { name: "target root without heading", change: |r| first(r).targets[0].pose = None, field: "characters[0].targets[0].root.heading", says: "a heading in radians" },
    Case { name: "target pose without height", change: |r| first(r).targets[0].root = None, field: "characters[0].targets[0].pose.root_height", says: "height in metres" },
    Case { name: "out of reach", change: |r| position(&mut first(r).targets[0]).x = 10_001.0, field: "characters[0].targets[0].root.position", says: "at most 10000 m" },
    Case { name: "too short a segment", change: |r| first(r).frame_count = Some(11), field: "characters[0].frame_count", says: "frame_count counts the 4 context frames, the gap and the targets; allowed: 12 to 64" },
    Case { name: "too long a segment", change: |r| first(r).frame_count = Some(65), field: "characters[0].frame_count", says: "12 to 64" },
    Case { name: "bad token count", change: |r| { first(r).frame_count = None; first(r).allowed_token_counts = vec![4, 17] }, field: "characters[0].allowed_token_counts[1]", says: "3 to 16" },
    Case { name: "count given twice", change: |r| first(r).allowed_token_counts = vec![10], field: "characters[0].allowed_token_counts", says: "only one of the two" },
    Case { name: "temperature", change: |r| first(r).temperature = 2.1, field: "characters[0].temperature", says: "0 to 2" },
    Case { name: "pose steps", change: |r| first(r).pose_steps = Some(0), field: "characters[0].pose_steps", says: "1 to 10" },
    Case { name: "later character", change: |r| r.characters[2].pose_steps = Some(11), field: "characters[2].pose_steps", says: "1 to 10" },
    Case { name: "root behind the end", change: |r| first(r).root = vec![root(10, 0.0, 0.5), root(40, 0.0, 3.0)], field: "characters[0].root[1].frame", says: "11 to 39" },
    Case { name: "roots out of order", change: |r| first(r).root = vec![root(10, 0.0, 0.5), root(10, 0.0, 0.5)], field: "characters[0].root[1].frame", says: "frames that rise" },
    Case { name: "roots without a length", change: |r| { first(r).frame_count = None; first(r).root = vec![root(10, 0.0, 0.5)] }, field: "characters[0].frame_count", says: "12 to 64" },
    Case { name: "root against the target", change: |r| first(r).root = vec![root(39, 0.0, 2.0)], field: "characters[0].root[0]", says: "x and z within 0.001 m of 0 and 3" },
    Case { name: "root against the context", change: |r| first(r).root = vec![root(1, 0.1, -0.2)], field: "characters[0].root[0]", says: "within 0.001 m" },
    Case { name: "root with half a place", change: |r| first(r).root = vec![v1::RootKey { z: None, ..root(20, 0.0, 0.0) }], field: "characters[0].root[0].z", says: "both x and z, or neither" },
    Case { name: "root of nothing", change: |r| first(r).root = vec![v1::RootKey { frame: 20, ..Default::default() }], field: "characters[0].root[0]", says: "at least one of x and z, height and heading" },
    Case { name: "root far away", change: |r| first(r).root = vec![root(20, 1e5, 0.0)], field: "characters[0].root[0]", says: "at most 10000 m" },
    Case { name: "velocity", change: |r| first(r).targets[0].velocity = Some(v1::RootVelocity { x: 1e6, ..Default::default() }), field: "characters[0].targets[0].velocity.x", says: "-1000 to 1000" },
];

/// Values that JSON cannot write, or not as such; over HTTP they get their own test.
#[rustfmt::skip]
const NOT_FINITE: &[Case] = &[
    Case { name: "NaN rotation", change: |r| rotations(&mut first(r).context[2])[7] = f32::NAN, field: "characters[0].context[2].pose.rotations[7]", says: "a finite number" },
    Case { name: "infinite position", change: |r| position(&mut first(r).context[0]).z = f32::INFINITY, field: "characters[0].context[0].root.position.z", says: "a finite number" },
    Case { name: "NaN heading", change: |r| first(r).targets[0].root.as_mut().unwrap().heading = Some(f32::NAN), field: "characters[0].targets[0].root.heading", says: "a finite number" },
    Case { name: "infinite velocity", change: |r| first(r).targets[0].velocity = Some(v1::RootVelocity { angular: f32::NEG_INFINITY, ..Default::default() }), field: "characters[0].targets[0].velocity.angular", says: "a finite number" },
    Case { name: "NaN root", change: |r| first(r).root = vec![root(20, f32::NAN, 0.0)], field: "characters[0].root[0].x", says: "a finite number" },
    Case { name: "NaN root height", change: |r| first(r).root = vec![v1::RootKey { height: Some(f32::NAN), ..root(20, 0.0, 0.0) }], field: "characters[0].root[0].height", says: "a finite number" },
    Case { name: "infinite root heading", change: |r| first(r).root = vec![v1::RootKey { heading: Some(f32::INFINITY), ..root(20, 0.0, 0.0) }], field: "characters[0].root[0].heading", says: "a finite number" },
    Case { name: "NaN temperature", change: |r| first(r).temperature = f32::NAN, field: "characters[0].temperature", says: "0 to 2" },
];

fn assert_invalid(status: &tonic::Status, name: &str, field: &str, says: &str) {
    assert_eq!(status.code(), Code::InvalidArgument, "{name}: {status:?}");
    assert!(status.message().contains(field), "{name}: {}", status.message());
    let violations = status.get_details_bad_request().expect(name).field_violations;
    assert_eq!(violations.len(), 1, "{name}");
    assert_eq!(violations[0].field, field, "{name}");
    assert!(
        violations[0].description.contains(says),
        "{name}: {}",
        violations[0].description
    );
    let info = status.get_details_error_info().expect(name);
    assert_eq!(
        (info.domain.as_str(), info.reason.as_str()),
        ("troupe.v1", "INVALID_FIELD"),
        "{name}"
    );
    assert_eq!(info.metadata["field"], field, "{name}");
}

async fn error(response: reqwest::Response) -> (StatusCode, ErrorBody) {
    let status = response.status();
    let text = response.text().await.unwrap();
    (
        status,
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text:?}")),
    )
}

#[tokio::test]
async fn grpc_names_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    for case in CASES.iter().chain(NOT_FINITE) {
        let mut request = request(3);
        (case.change)(&mut request);
        let status = client.in_between(request).await.expect_err(case.name);
        assert_invalid(&status, case.name, case.field, case.says);
    }
}

#[tokio::test]
async fn http_names_field_and_range() {
    let server = TestServer::start().await;
    for case in CASES {
        let mut request = request(3);
        (case.change)(&mut request);
        let (status, body) = error(server.post(serde_json::to_vec(&request).unwrap()).await).await;
        assert_eq!(status, StatusCode::BAD_REQUEST, "{}", case.name);
        assert_eq!(body.error.code, "INVALID_ARGUMENT", "{}", case.name);
        assert_eq!(body.error.field.as_deref(), Some(case.field), "{}", case.name);
        assert!(
            body.error.message.contains(case.says),
            "{}: {}",
            case.name,
            body.error.message
        );
        let allowed = body.error.allowed.expect(case.name);
        assert!(body.error.message.ends_with(&allowed), "{}: {allowed}", case.name);
    }
}

#[tokio::test]
async fn http_refuses_numbers_that_are_not_finite() {
    let server = TestServer::start().await;
    let json = serde_json::to_string(&request(1)).unwrap();
    let first_height = r#""y":0.9"#;
    assert!(json.contains(first_height));
    // JSON has no NaN, but protobuf's mapping has a text for it. 1e39 overflows to infinity in 32
    // bits, 1e999 in any.
    for (value, field, says) in [
        (
            "NaN",
            "characters[0].context[0].root.position.y",
            "expected value",
        ),
        (
            "\"NaN\"",
            "characters[0].context[0].root.position.y",
            "a finite number",
        ),
        (
            "1e39",
            "characters[0].context[0].root.position.y",
            "a finite number",
        ),
        (
            "-1e39",
            "characters[0].context[0].root.position.y",
            "a finite number",
        ),
        (
            "1e999",
            "characters[0].context[0].root.position.y",
            "out of range",
        ),
    ] {
        let json = json.replacen(first_height, &format!(r#""y":{value}"#), 1);
        let (status, body) = error(server.post(json).await).await;
        assert_eq!(status, StatusCode::BAD_REQUEST, "{value}: {body:?}");
        assert_eq!(body.error.field.as_deref(), Some(field), "{value}: {body:?}");
        assert!(body.error.message.contains(says), "{value}: {body:?}");
    }
}

#[tokio::test]
async fn an_unknown_pack_is_not_found() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    let named = v1::InBetweenRequest {
        pack: "dragon".into(),
        ..request(1)
    };
    let asked = v1::GetPackRequest {
        name: "dragon".into(),
    };
    for (status, field) in [
        (client.in_between(named.clone()).await.unwrap_err(), "pack"),
        (client.get_pack(asked).await.unwrap_err(), "name"),
    ] {
        assert_eq!(status.code(), Code::NotFound);
        assert_eq!(status.message(), r#"unknown pack "dragon"; loaded: other, toy"#);
        let info = status.get_details_error_info().unwrap();
        assert_eq!(
            (info.reason.as_str(), info.metadata["allowed"].as_str()),
            ("UNKNOWN_PACK", "other, toy")
        );
        assert_eq!(info.metadata["field"], field);
    }
    for (response, field) in [
        (server.post(serde_json::to_vec(&named).unwrap()).await, "pack"),
        (server.get("/v1/packs/dragon").await, "name"),
    ] {
        let (status, body) = error(response).await;
        assert_eq!(
            (status, body.error.code.as_str()),
            (StatusCode::NOT_FOUND, "NOT_FOUND")
        );
        assert_eq!(body.error.field.as_deref(), Some(field));
        assert_eq!(body.error.allowed.as_deref(), Some("other, toy"));
    }
}

#[tokio::test]
async fn errors_of_oversized_requests_state_the_limit() {
    let server = TestServer::start_with(|config| config.fixed.max_message_bytes = 4096).await;
    let large = request(100);
    let status = server.grpc().await.in_between(large.clone()).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    assert!(
        status.message().contains("at most 4096 bytes"),
        "{}",
        status.message()
    );
    let info = status.get_details_error_info().unwrap();
    assert_eq!(
        (info.reason.as_str(), info.metadata["field"].as_str()),
        ("REQUEST_TOO_LARGE", "body")
    );
    assert!(status.get_details_retry_info().is_none());

    let (status, body) = error(server.post(serde_json::to_vec(&large).unwrap()).await).await;
    assert_eq!(
        (status, body.error.code.as_str()),
        (StatusCode::PAYLOAD_TOO_LARGE, "RESOURCE_EXHAUSTED")
    );
    assert_eq!(body.error.field.as_deref(), Some("body"));
    assert_eq!(body.error.allowed.as_deref(), Some("at most 4096 bytes"));
    // What fits is served by the same server.
    server.grpc().await.in_between(request(1)).await.unwrap();
}

async fn raw_grpc(server: &TestServer, body: Vec<u8>) -> (String, String) {
    server.raw_grpc(body, ("user-agent", "test")).await
}

#[tokio::test]
async fn grpc_bodies_that_are_no_request_are_the_callers_fault() {
    let server = TestServer::start().await;
    let message = request(1).encode_to_vec();
    let good = framed(&message);
    let invalid = (Code::InvalidArgument as i32).to_string();

    let truncated = good[..good.len() - 10].to_vec();
    let (status, text) = raw_grpc(&server, truncated).await;
    assert_eq!(status, invalid);
    assert!(
        text.contains("is%20truncated") && text.contains("a%20whole%20one,%20at%20most"),
        "{text}"
    );

    // The frame is whole, but the message inside is cut, or no protobuf at all, or not there.
    for body in [
        framed(&message[..message.len() - 10]),
        framed(&[0xff; 20]),
        good[..3].to_vec(),
        Vec::new(),
    ] {
        let (status, text) = raw_grpc(&server, body).await;
        assert_eq!(status, invalid, "{text}");
    }
    let (status, text) = server.raw_grpc(good.clone(), ("grpc-encoding", "gzip")).await;
    assert_eq!(status, (Code::Unimplemented as i32).to_string(), "{text}");
    let (status, _) = raw_grpc(&server, good).await;
    assert_eq!(status, "", "a good request has its status in the trailers");
    server
        .metric(
            r#"troupe_requests_total{rpc="InBetween",code="INVALID_ARGUMENT"}"#,
            "5",
        )
        .await;
}

#[tokio::test]
async fn http_bodies_that_are_no_request_are_the_callers_fault() {
    let server = TestServer::start().await;
    let json = serde_json::to_string(&request(1)).unwrap();
    let cases = [
        (json[..json.len() / 2].to_owned(), "the body is truncated: EOF"),
        (String::new(), "the body is truncated: EOF"),
        ("not json".to_owned(), "expected"),
        (format!("{json} more"), "trailing"),
        (json.replace("frame_count", "frames"), "unknown field `frames`"),
        (json.replace("\"frame_count\":40", "\"frame_count\":-1"), "-1"),
        (
            json.replace("\"frame_count\":40", "\"frame_count\":\"forty\""),
            "string",
        ),
    ];
    for (body, says) in cases {
        let (status, answer) = error(server.post(body.clone()).await).await;
        assert_eq!(status, StatusCode::BAD_REQUEST, "{body}");
        assert_eq!(answer.error.code, "INVALID_ARGUMENT");
        assert!(answer.error.message.contains(says), "{body}: {answer:?}");
    }
    // Every one of them names the field, or the body as a whole.
    for (body, field) in [
        (
            json.replace("\"frame_count\":40", "\"frame_count\":true"),
            "characters[0].frame_count",
        ),
        ("null".to_owned(), "body"),
        ("[]".to_owned(), "body"),
        ("not json".to_owned(), "body"),
        (format!("{json} more"), "body"),
        (format!("\u{feff}{json}"), "body"),
        (json.replace("frame_count", "frames"), "characters[0].frames"),
        (json.replacen('{', "{\"characters\":[],", 1), "characters"),
        (
            json.replace("\"frame_count\"", "\"frameCount\":1,\"frame_count\""),
            "characters[0].frame_count",
        ),
        (
            json.replacen("1.0,", "null,", 1),
            "characters[0].context[0].pose.rotations[0]",
        ),
        (json.replacen('{', "{\"colour\":1,", 1), "colour"),
    ] {
        let (status, answer) = error(server.post(body.clone()).await).await;
        assert_eq!(status, StatusCode::BAD_REQUEST, "{body}");
        assert_eq!(answer.error.field.as_deref(), Some(field), "{body}: {answer:?}");
    }
}

#[tokio::test]
async fn an_http_body_shorter_than_its_length_is_answered() {
    let server = TestServer::start().await;
    let mut stream = tokio::net::TcpStream::connect(server.handle.address())
        .await
        .unwrap();
    let head = "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 1000\r\n\r\n{\"characters\":";
    stream.write_all(head.as_bytes()).await.unwrap();
    stream.shutdown().await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 400"), "{answer:?}");
    for part in [
        "INVALID_ARGUMENT",
        "is truncated",
        r#""field":"body""#,
        r#""allowed":"a whole one, at most "#,
    ] {
        assert!(answer.contains(part), "{part} is not in {answer:?}");
    }
}

#[tokio::test]
async fn errors_echo_a_little_of_the_request_only() {
    let server = TestServer::start().await;
    let long = "é".repeat(100_000);
    for body in [
        format!(r#"{{"{long}":1}}"#),
        format!(r#"{{"characters":[{{"seed":"{long}"}}]}}"#),
    ] {
        let (status, answer) = error(server.post(body).await).await;
        assert_eq!(status, StatusCode::BAD_REQUEST);
        let message = answer.error.message;
        assert!(
            message.chars().count() < 600 && message.contains('…'),
            "{message}"
        );
        assert!(answer.error.field.unwrap_or_default().chars().count() <= 257);
    }
}

#[tokio::test]
async fn a_pack_name_that_is_no_text_is_refused_in_kind() {
    let server = TestServer::start().await;
    let (status, body) = error(server.get("/v1/packs/%FF").await).await;
    assert_eq!(
        (status, body.error.code.as_str()),
        (StatusCode::BAD_REQUEST, "INVALID_ARGUMENT")
    );
    assert_eq!(body.error.field.as_deref(), Some("name"));
    server
        .metric(
            r#"troupe_requests_total{rpc="GetPack",code="INVALID_ARGUMENT"}"#,
            "1",
        )
        .await;
}

#[tokio::test]
async fn a_character_out_of_this_world_does_not_reach_the_engine() {
    let server = TestServer::start().await;
    let mut high = request(1);
    let character = first(&mut high);
    for key in character.context.iter_mut().chain(&mut character.targets) {
        position(key).y = 3e38;
    }
    let (status, body) = error(server.post(serde_json::to_vec(&high).unwrap()).await).await;
    assert_eq!(status, StatusCode::BAD_REQUEST, "{body:?}");
    assert_eq!(
        body.error.field.as_deref(),
        Some("characters[0].context[0].root.position.y")
    );
    assert_eq!(body.error.allowed.as_deref(), Some("-100 to 100"));
}

#[tokio::test]
async fn a_body_of_many_empty_messages_is_refused_before_it_takes_memory() {
    let server = TestServer::start().await;
    // Two bytes each: an empty character, and a character of empty keyframes.
    let characters = [0x12, 0].repeat(4_000_000);
    let context = [0x12, 0].repeat(100_000);
    let character = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![v1::Character::default()],
        skeleton: String::new(),
    };
    assert_eq!(character.encode_to_vec(), [0x12, 0]);
    let keyframes = [&[0x12, 0xc0, 0x9a, 0x0c], context.as_slice()].concat();
    for (body, says) in [
        (characters, "more%20than%20256%20characters"),
        (keyframes, "more%20than%20256%20keyframes"),
    ] {
        let (status, text) = raw_grpc(&server, framed(&body)).await;
        assert_eq!(status, (Code::InvalidArgument as i32).to_string());
        assert!(text.contains(says), "{text}");
    }
    let body = format!("{{\"characters\":[{}{{}}]}}", "{},".repeat(1_000_000));
    let (status, answer) = error(server.post(body).await).await;
    assert_eq!(
        (status, answer.error.field.as_deref()),
        (StatusCode::BAD_REQUEST, Some("characters"))
    );
    assert_eq!(answer.error.allowed.as_deref(), Some("1 to 256"));
}

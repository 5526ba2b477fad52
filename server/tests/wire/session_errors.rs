//! Every kind of bad input to sessions, over gRPC and HTTP: the code, the field and the allowed
//! range.

use reqwest::{Method, StatusCode};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::calls::{ids, locomote, open, options, step, walk};
use crate::common::{TestServer, keyframe};

/// A message with one mistake, the field that it is in, and what must be said about it.
struct Case<T: 'static> {
    name: &'static str,
    change: fn(&mut T),
    field: &'static str,
    says: &'static str,
}

fn assert_invalid(status: &Status, name: &str, field: &str, says: &str) {
    assert_eq!(status.code(), Code::InvalidArgument, "{name}: {status:?}");
    let violations = status.get_details_bad_request().expect(name).field_violations;
    assert_eq!(violations[0].field, field, "{name}");
    let text = &violations[0].description;
    assert!(text.contains(says), "{name}: {text}");
}

async fn assert_refused(response: reqwest::Response, name: &str, field: &str, says: &str) {
    let status = response.status();
    let text = response.text().await.unwrap();
    assert_eq!(status, StatusCode::BAD_REQUEST, "{name}: {text}");
    let body: ErrorBody = serde_json::from_str(&text).unwrap();
    assert_eq!(body.error.field.as_deref(), Some(field), "{name}: {text}");
    let allowed = body.error.allowed.unwrap_or_default();
    assert!(
        body.error.message.contains(says) || allowed.contains(says),
        "{name}: {text}"
    );
}

fn vector(x: f32, y: f32, z: f32) -> Option<v1::Vec3> {
    Some(v1::Vec3 { x, y, z })
}

fn context() -> Vec<v1::Keyframe> {
    (0..4).map(|frame| keyframe(0.0, 0.03 * frame as f32)).collect()
}

fn first(request: &mut v1::CreateSessionsRequest) -> &mut v1::SessionOptions {
    &mut request.sessions[0]
}

#[rustfmt::skip]
const CREATE: &[Case<v1::CreateSessionsRequest>] = &[
    Case { name: "none", change: |r| r.sessions.clear(), field: "sessions", says: "1 to 1024" },
    Case { name: "too many", change: |r| r.sessions = vec![options(""); 1025], field: "sessions", says: "1 to 1024" },
    Case { name: "id with a space", change: |r| first(r).id = "a b".into(), field: "sessions[0].id", says: "1 to 64 letters, digits, '-', '_' or '.'" },
    Case { name: "long id", change: |r| first(r).id = "x".repeat(65), field: "sessions[0].id", says: "1 to 64 letters" },
    Case { name: "ttl too short", change: |r| first(r).ttl_ms = Some(999), field: "sessions[0].ttl_ms", says: "1000 to 86400000" },
    Case { name: "ttl too long", change: |r| first(r).ttl_ms = Some(86_400_001), field: "sessions[0].ttl_ms", says: "1000 to 86400000" },
    Case { name: "look-ahead too short", change: |r| first(r).look_ahead_frames = Some(1), field: "sessions[0].look_ahead_frames", says: "2 to 12" },
    Case { name: "look-ahead too long", change: |r| first(r).look_ahead_frames = Some(13), field: "sessions[0].look_ahead_frames", says: "2 to 12" },
    Case { name: "interval", change: |r| first(r).replan_interval_frames = Some(2), field: "sessions[0].replan_interval_frames", says: "3 to 30" },
    Case { name: "root ratio", change: |r| first(r).root_ratio = Some(1.3), field: "sessions[0].root_ratio", says: "0 to 1.2" },
    Case { name: "temperature", change: |r| first(r).temperature = -0.1, field: "sessions[0].temperature", says: "0 to 2" },
    Case { name: "priority", change: |r| first(r).priority = Some(1.5), field: "sessions[0].priority", says: "0 to 1" },
    Case { name: "position", change: |r| first(r).position = vector(10_001.0, 0.0, 0.0), field: "sessions[0].position.x", says: "-10000 to 10000" },
    Case { name: "position in centimetres", change: |r| { first(r).convention = 1; first(r).position = vector(0.0, 2e6, 0.0) }, field: "sessions[0].position.y", says: "-1000000 to 1000000" },
    Case { name: "heading", change: |r| first(r).heading = 1001.0, field: "sessions[0].heading", says: "-1000 to 1000" },
    Case { name: "unknown style", change: |r| first(r).style = "moonwalk".into(), field: "sessions[0].style", says: "normal, sneak, still" },
    Case { name: "three context frames", change: |r| first(r).context = context()[1..].to_vec(), field: "sessions[0].context", says: "exactly 4" },
    Case { name: "context and position", change: |r| { first(r).context = context(); first(r).position = vector(1.0, 0.0, 0.0) }, field: "sessions[0].position", says: "only one of the two" },
    Case { name: "context and heading", change: |r| { first(r).context = context(); first(r).heading = 1.0 }, field: "sessions[0].heading", says: "only one of the two" },
    Case { name: "context without pose", change: |r| { first(r).context = context(); first(r).context[2].pose = None }, field: "sessions[0].context[2].pose", says: "root and pose in every context keyframe" },
    Case { name: "context with velocity", change: |r| { first(r).context = context(); first(r).context[1].velocity = Some(v1::RootVelocity::default()) }, field: "sessions[0].context[1].velocity", says: "root and pose only" },
    Case { name: "context of another skeleton", change: |r| { first(r).context = context(); first(r).context[0].pose.as_mut().unwrap().rotations.truncate(4) }, field: "sessions[0].context[0].pose.rotations", says: "exactly 8" },
    Case { name: "context not of unit length", change: |r| { first(r).context = context(); first(r).convention = 2; first(r).context[3].pose.as_mut().unwrap().rotations[0] = 1.5 }, field: "sessions[0].context[3].pose.rotations[0]", says: "in the native convention" },
    Case { name: "second session", change: |r| { r.sessions.push(options("z")); r.sessions[1].temperature = 3.0 }, field: "sessions[1].temperature", says: "0 to 2" },
];

/// What JSON has no words for.
#[rustfmt::skip]
const CREATE_GRPC: &[Case<v1::CreateSessionsRequest>] = &[
    Case { name: "convention", change: |r| first(r).convention = 4, field: "sessions[0].convention", says: "CONVENTION_NATIVE (0), CONVENTION_UNREAL (1), CONVENTION_UNITY (2) or CONVENTION_ROS (3)" },
    Case { name: "NaN position", change: |r| first(r).position = vector(0.0, 0.0, f32::NAN), field: "sessions[0].position.z", says: "-10000 to 10000" },
    Case { name: "NaN heading", change: |r| first(r).heading = f32::NAN, field: "sessions[0].heading", says: "-1000 to 1000" },
    Case { name: "NaN temperature", change: |r| first(r).temperature = f32::NAN, field: "sessions[0].temperature", says: "0 to 2" },
    Case { name: "NaN priority", change: |r| first(r).priority = Some(f32::NAN), field: "sessions[0].priority", says: "0 to 1" },
    Case { name: "infinite ratio", change: |r| first(r).root_ratio = Some(f32::INFINITY), field: "sessions[0].root_ratio", says: "0 to 1.2" },
    Case { name: "infinite root", change: |r| { first(r).context = context(); first(r).context[0].root.as_mut().unwrap().position = vector(0.0, f32::INFINITY, 0.0) }, field: "sessions[0].context[0].root.position.y", says: "a finite number" },
];

#[tokio::test]
async fn creation_names_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let good = || v1::CreateSessionsRequest {
        sessions: vec![options("a")],
    };
    for case in CREATE.iter().chain(CREATE_GRPC) {
        let mut request = good();
        (case.change)(&mut request);
        let status = client.create_sessions(request).await.expect_err(case.name);
        assert_invalid(&status, case.name, case.field, case.says);
    }
    for case in CREATE {
        let mut request = good();
        (case.change)(&mut request);
        let response = server.send(Method::POST, "/v1/sessions", &request).await;
        assert_refused(response, case.name, case.field, case.says).await;
    }
    let unknown = v1::SessionOptions {
        pack: "dragon".into(),
        ..options("a")
    };
    let sessions = vec![unknown];
    let status = client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let info = status.get_details_error_info().unwrap();
    assert_eq!(info.metadata["field"], "sessions[0].pack");
    assert_eq!(server.handle.service().sessions().open(), 0);
    client.create_sessions(good()).await.unwrap();
}

#[rustfmt::skip]
const COMMANDS: &[Case<v1::Command>] = &[
    Case { name: "unknown session", change: |c| c.session_id = "ghost".into(), field: "commands[1].session_id", says: "no session has the id \"ghost\"" },
    Case { name: "sequence 0", change: |c| c.sequence = 0, field: "commands[1].sequence", says: "1 or more" },
    Case { name: "no intent", change: |c| c.intent = None, field: "commands[1].intent", says: "locomote" },
    Case { name: "priority", change: |c| c.priority = Some(-0.1), field: "commands[1].priority", says: "0 to 1" },
    Case { name: "priority alone", change: |c| { c.intent = None; c.priority = Some(2.0) }, field: "commands[1].priority", says: "0 to 1" },
    Case { name: "too far ahead", change: |c| c.at_frame = Some(100_001), field: "commands[1].at_frame", says: "at most 100000" },
    Case { name: "up", change: |c| locomote(c).velocity = vector(0.0, 0.1, 1.0), field: "commands[1].locomote.velocity.y", says: "0" },
    Case { name: "too fast", change: |c| locomote(c).velocity = vector(0.0, 0.0, 1001.0), field: "commands[1].locomote.velocity.z", says: "-1000 to 1000" },
    Case { name: "facing", change: |c| locomote(c).facing = Some(-1001.0), field: "commands[1].locomote.facing", says: "-1000 to 1000" },
    Case { name: "style", change: |c| locomote(c).style = "moonwalk".into(), field: "commands[1].locomote.style", says: "normal, sneak, still" },
    Case { name: "gait of another style", change: |c| { locomote(c).style = "sneak".into(); locomote(c).gait = "run".into() }, field: "commands[1].locomote.gait", says: "idle, walk" },
    Case { name: "height", change: |c| locomote(c).height = Some(-0.1), field: "commands[1].locomote.height", says: "0 to 100" },
];

#[rustfmt::skip]
const COMMANDS_GRPC: &[Case<v1::Command>] = &[
    Case { name: "NaN velocity", change: |c| locomote(c).velocity = vector(f32::NAN, 0.0, 0.0), field: "commands[1].locomote.velocity.x", says: "-1000 to 1000" },
    Case { name: "NaN priority", change: |c| c.priority = Some(f32::NAN), field: "commands[1].priority", says: "0 to 1" },
    Case { name: "NaN facing", change: |c| locomote(c).facing = Some(f32::NAN), field: "commands[1].locomote.facing", says: "-1000 to 1000" },
    Case { name: "infinite height", change: |c| locomote(c).height = Some(f32::INFINITY), field: "commands[1].locomote.height", says: "0 to 100" },
];

#[tokio::test]
async fn a_command_is_refused_alone_with_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    let mut sequence = 0;
    for (index, case) in COMMANDS.iter().chain(COMMANDS_GRPC).enumerate() {
        sequence += 1;
        let mut wrong = walk("b", 1, (0.0, 1.0));
        (case.change)(&mut wrong);
        let commands = vec![walk("a", sequence, (0.0, 1.0)), wrong];
        let request = v1::CommandRequest { commands };
        let over_grpc = client.command(request.clone()).await.unwrap().into_inner();
        assert_eq!(
            over_grpc.results[0].status(),
            v1::CommandStatus::Accepted,
            "{}",
            case.name
        );
        let refused = &over_grpc.results[1];
        assert_eq!(refused.status(), v1::CommandStatus::Refused, "{}", case.name);
        let problem = refused.problem.as_ref().unwrap();
        assert_eq!(problem.field, case.field, "{}", case.name);
        let said = problem.message.contains(case.says) || problem.allowed.contains(case.says);
        assert!(said, "{}: {problem:?}", case.name);
        if index < COMMANDS.len() {
            let response = server.send(Method::POST, "/v1/commands", &request).await;
            let over_http: v1::CommandResponse = response.json().await.unwrap();
            assert_eq!(over_http.results[1], *refused, "{}", case.name);
            assert_eq!(over_http.results[0].status(), v1::CommandStatus::Repeated);
        }
    }
    for (count, says) in [(0, "is empty"), (10_001, "1 to 10000")] {
        let commands = vec![walk("a", 99, (0.0, 0.0)); count];
        let request = v1::CommandRequest { commands };
        let status = client.command(request.clone()).await.unwrap_err();
        assert_invalid(&status, "count", "commands", says);
        let response = server.send(Method::POST, "/v1/commands", &request).await;
        assert_refused(response, "count", "commands", says).await;
    }
}

#[rustfmt::skip]
const STEPS: &[Case<v1::StepRequest>] = &[
    Case { name: "none", change: |r| r.session_ids.clear(), field: "session_ids", says: "1 to 1024" },
    Case { name: "too many", change: |r| r.session_ids = ids("x", 1025), field: "session_ids", says: "1 to 1024" },
    Case { name: "twice", change: |r| r.session_ids.push("a".into()), field: "session_ids[1]", says: "each session once" },
    Case { name: "frames", change: |r| r.frames = 121, field: "frames", says: "1 to 120" },
    Case { name: "rate", change: |r| r.rate_hz = 25, field: "rate_hz", says: "30, 50 or 60" },
    Case { name: "commands", change: |r| r.commands = vec![walk("a", 1, (0.0, 0.0)); 10_001], field: "commands", says: "10000" },
];

#[tokio::test]
async fn a_step_names_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    for case in STEPS {
        let mut request = step(&["a"], 1, vec![]);
        (case.change)(&mut request);
        let response = server.send(Method::POST, "/v1/step", &request).await;
        assert_refused(response, case.name, case.field, case.says).await;
        let status = client.step(request).await.expect_err(case.name);
        assert_invalid(&status, case.name, case.field, case.says);
    }
    let mut request = step(&["a"], 1, vec![]);
    request.encoding = 9;
    let status = client.step(request).await.unwrap_err();
    assert_invalid(
        &status,
        "encoding",
        "encoding",
        "ENCODING_F32 (0) or ENCODING_COMPACT (1)",
    );
    let word = serde_json::json!({ "session_ids": ["a"], "encoding": "f16" });
    let response = server.send(Method::POST, "/v1/step", &word).await;
    assert_refused(
        response,
        "encoding",
        "encoding",
        "`ENCODING_F32`, `ENCODING_COMPACT`",
    )
    .await;

    let status = client
        .step(step(&["ghost", "wraith"], 1, vec![]))
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let info = status.get_details_error_info().unwrap();
    assert_eq!(info.reason, "UNKNOWN_SESSION");
    assert_eq!(info.metadata["field"], "session_ids[0]", "the first one's error");
    let response = server
        .send(Method::POST, "/v1/step", &step(&["ghost"], 1, vec![]))
        .await;
    assert_eq!(response.status(), StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn the_other_calls_name_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    for (path, field, says) in [
        ("/v1/sessions?page_size=1001", "page_size", "1 to 1000"),
        ("/v1/sessions?page_size=many", "query", "invalid digit"),
        ("/v1/sessions?size=3", "query", "unknown field `size`"),
        ("/v1/sessions/a/peek?frames=65", "frames", "1 to 64"),
        ("/v1/sessions/%ff", "id", "percent-encoded UTF-8"),
        ("/v1/packs/toy/styles/moonwalk", "style", "normal, sneak, still"),
    ] {
        assert_refused(server.get(path).await, path, field, says).await;
    }
    let list = v1::ListSessionsRequest {
        page_size: 1001,
        ..v1::ListSessionsRequest::default()
    };
    assert_invalid(
        &client.list_sessions(list).await.unwrap_err(),
        "list",
        "page_size",
        "1 to 1000",
    );
    let peek = |id: &str, frames| v1::PeekRequest {
        session_id: id.into(),
        frames,
    };
    assert_invalid(
        &client.peek(peek("a", 65)).await.unwrap_err(),
        "peek",
        "frames",
        "1 to 64",
    );
    let unknown = client.peek(peek("ghost", 1)).await.unwrap_err();
    assert_eq!(
        unknown.get_details_error_info().unwrap().metadata["field"],
        "session_id"
    );
    for (count, says) in [(0, "is empty"), (10_001, "10000")] {
        let close = v1::CloseSessionsRequest {
            ids: vec!["a".into(); count],
        };
        assert_invalid(
            &client.close_sessions(close).await.unwrap_err(),
            "close",
            "ids",
            says,
        );
    }
    for path in [
        "/v1/sessions/ghost",
        "/v1/sessions/ghost/peek",
        "/v1/packs/dragon/styles",
    ] {
        assert_eq!(server.get(path).await.status(), StatusCode::NOT_FOUND, "{path}");
    }
    for (method, path) in [
        (Method::PUT, "/v1/sessions"),
        (Method::GET, "/v1/step"),
        (Method::POST, "/v1/drive"),
        (Method::POST, "/v1/packs/toy/styles/normal"),
    ] {
        let response = server.send(method, path, &()).await;
        assert_eq!(response.status(), StatusCode::METHOD_NOT_ALLOWED, "{path}");
    }
}

#[tokio::test]
async fn a_style_that_is_not_one_is_refused_with_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let mut good: v1::Style = server
        .get("/v1/packs/toy/styles/sneak")
        .await
        .json()
        .await
        .unwrap();
    good.name = "mine".into();
    let put = |style| v1::PutStyleRequest {
        pack: String::new(),
        style,
        ..v1::PutStyleRequest::default()
    };
    let status = client.put_style(put(None)).await.unwrap_err();
    assert_invalid(&status, "none", "style", "a style with its keyframes");
    #[rustfmt::skip]
    let cases: &[Case<v1::Style>] = &[
        Case { name: "interval", change: |s| s.replan_interval_frames = 31, field: "style.replan_interval_frames", says: "3 to 30" },
        Case { name: "no gaits", change: |s| s.gaits.clear(), field: "style.gaits", says: "1 to 16" },
        Case { name: "no keys", change: |s| s.gaits[1].keys.clear(), field: "style.gaits[1].keys", says: "1 to 32" },
        Case { name: "another skeleton", change: |s| s.gaits[0].keys[0].rotations.push(1.0), field: "style.gaits[0].keys[0].rotations", says: "8" },
    ];
    for case in cases {
        let mut style = good.clone();
        (case.change)(&mut style);
        let response = server
            .send(Method::PUT, "/v1/packs/toy/styles/mine", &style)
            .await;
        assert_refused(response, case.name, case.field, case.says).await;
        let status = client.put_style(put(Some(style))).await.expect_err(case.name);
        assert_invalid(&status, case.name, case.field, case.says);
    }
    let response = server
        .send(Method::PUT, "/v1/packs/toy/styles/yours", &good)
        .await;
    assert_refused(response, "name", "style.name", "the name in the path, or none").await;
    let unknown = serde_json::json!({ "gates": [] });
    let response = server
        .send(Method::PUT, "/v1/packs/toy/styles/mine", &unknown)
        .await;
    assert_refused(response, "unknown field", "gates", "unknown field").await;
    client.put_style(put(Some(good))).await.unwrap();
}

#[tokio::test]
async fn calls_before_the_packs_are_loaded_say_so() {
    let server = TestServer::start_unready(|_| {}, std::time::Duration::from_millis(500)).await;
    let mut client = server.sessions().await;
    let sessions = vec![options("a")];
    let status = client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::Unavailable);
    let response = server.get("/v1/packs/toy/styles").await;
    assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
}

#[tokio::test]
async fn bodies_that_would_blow_up_are_refused_before_they_are_decoded() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let commands = vec![v1::Command::default(); 4_000_000];
    let status = client.command(v1::CommandRequest { commands }).await.unwrap_err();
    assert_invalid(&status, "commands", "commands", "has more than 10000 commands");
    let body = format!("{{\"commands\":[{}{{}}]}}", "{},".repeat(1_000_000));
    let request = reqwest::Client::new()
        .post(server.url("/v1/commands"))
        .header("content-type", "application/json")
        .body(body);
    assert_refused(
        request.send().await.unwrap(),
        "commands",
        "commands",
        "has more than 10000",
    )
    .await;
}

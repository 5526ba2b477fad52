//! What is around sessions: their expiry, a look at their future, styles, health.

use std::time::Duration;

use reqwest::{Method, StatusCode};
use tokio::time::sleep;
use tonic::Code;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::TestServer;
use crate::common::calls::{ids, locomote, open, step, stepped, walk};

#[tokio::test]
async fn a_peek_shows_the_future_and_the_plan_behind_it() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    let fresh: v1::PeekResponse = server.get("/v1/sessions/a/peek").await.json().await.unwrap();
    assert!(fresh.plan.is_none() && !fresh.in_flight);
    stepped(&mut client, step(&["a"], 12, vec![walk("a", 1, (0.0, 1.2))])).await;
    let request = v1::PeekRequest {
        session_id: "a".into(),
        frames: 0,
    };
    let peek = client.peek(request).await.unwrap().into_inner();
    let (session, future, plan) = (peek.session.unwrap(), peek.future.unwrap(), peek.plan.unwrap());
    assert_eq!((session.frame, future.first_frames[0]), (12, 13));
    assert_eq!(future.frame_count, session.buffered_frames.min(64));
    assert!(future.frame_count > 8 && future.root_positions.len() == 3 * future.frame_count as usize);
    assert_eq!((plan.context.len(), plan.targets.is_empty()), (4, false));
    for path in [&plan.root_r_g2, &plan.root_r_g3, &plan.root_r_g4] {
        assert!(path.len() >= 5 * 12 && path.len() % 5 == 0, "{}", path.len());
    }
    assert!(!plan.tokens.is_empty() && !plan.gaits.is_empty() && plan.root_r_g1.is_some());
    let weights: f32 = plan.gaits.iter().map(|gait| gait.weight).sum();
    assert!((weights - 1.0).abs() < 1e-4, "{:?}", plan.gaits);
    assert!(["command", "interval", "low_buffer"].contains(&plan.cause.as_str()));

    // A peek changes nothing, and what comes is what it showed, as long as no other plan takes
    // over.
    let few = v1::PeekRequest {
        session_id: "a".into(),
        frames: 2,
    };
    let first = loop {
        let first = client.peek(few.clone()).await.unwrap().into_inner();
        // A plan in flight may come between two peeks.
        match first.in_flight {
            true => sleep(Duration::from_millis(5)).await,
            false => break first,
        }
    };
    assert_eq!(client.peek(few).await.unwrap().into_inner(), first);
    let shown = first.future.unwrap();
    assert_eq!(shown.frame_count, 2);
    let block = stepped(&mut client, step(&["a"], 1, vec![])).await;
    assert_eq!(block.root_positions, shown.root_positions[..3]);

    let mut command = walk("a", 9, (0.0, -1.0));
    command.at_frame = Some(500);
    client
        .command(v1::CommandRequest {
            commands: vec![command.clone()],
        })
        .await
        .unwrap();
    let waiting = server.get("/v1/sessions/a/peek?frames=1").await;
    let waiting: v1::PeekResponse = waiting.json().await.unwrap();
    locomote(&mut command).style = "normal".into();
    assert_eq!(waiting.waiting, Some(command));
}

#[tokio::test]
async fn sessions_expire_and_say_so() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["idle", "walked"]).await;
    server.clock.pass(Duration::from_secs(50));
    let get = |id: &str| v1::GetSessionRequest { id: id.into() };
    let left = client
        .get_session(get("idle"))
        .await
        .unwrap()
        .into_inner()
        .expires_in_ms;
    assert_eq!(left, 10_000, "to be looked at is no sign of life");
    stepped(&mut client, step(&["walked"], 1, vec![])).await;
    server.clock.pass(Duration::from_secs(10));
    let status = client.get_session(get("idle")).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    let info = status.get_details_error_info().unwrap();
    assert_eq!(
        (info.reason.as_str(), info.metadata["field"].as_str()),
        ("SESSION_EXPIRED", "id")
    );
    let response = server.get("/v1/sessions/idle").await;
    assert_eq!(response.status(), StatusCode::GONE);
    assert_eq!(
        response.json::<ErrorBody>().await.unwrap().error.reason,
        "SESSION_EXPIRED"
    );
    let refused = client.command(v1::CommandRequest {
        commands: vec![walk("idle", 1, (0.0, 0.0)), walk("walked", 1, (0.0, 0.0))],
    });
    let results = refused.await.unwrap().into_inner().results;
    assert_eq!(results[0].problem.as_ref().unwrap().reason, "SESSION_EXPIRED");
    assert_eq!(results[1].status(), v1::CommandStatus::Accepted);
    // Its id is free again, and then no longer an expired one.
    open(&mut client, &["idle"]).await;
    assert!(client.get_session(get("idle")).await.is_ok());
    server
        .metric(
            "troupe_session_evictions_total{model=\"toy\",version=\"1.2.3\",reason=\"expired\"}",
            "1",
        )
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn ten_thousand_sessions_that_are_left_expire_cleanly() {
    // One address stands for many clients.
    let server = TestServer::start_with(|config| config.fixed.keyless_share = 1).await;
    let mut client = server.sessions().await;
    let names = ids("left", 10_000);
    let before = resident_bytes();
    for chunk in names.chunks(1000) {
        open(&mut client, chunk).await;
    }
    let service = server.handle.service().clone();
    assert_eq!(service.sessions().open(), 10_000);
    let open_bytes = resident_bytes().saturating_sub(before);
    assert!(
        open_bytes < 400 << 20,
        "{} MiB for 10,000 sessions",
        open_bytes >> 20
    );
    // Others go on meanwhile.
    open(&mut client, &["busy"]).await;
    server.clock.pass(Duration::from_secs(59));
    stepped(&mut client, step(&["busy"], 1, vec![])).await;
    server.clock.pass(Duration::from_secs(1));
    while service.sessions().open() > 1 {
        sleep(Duration::from_millis(20)).await;
    }
    stepped(&mut client, step(&["busy"], 1, vec![])).await;
    let status = client.step(step(&[&names[5]], 1, vec![])).await.unwrap_err();
    assert_eq!(status.get_details_error_info().unwrap().reason, "SESSION_EXPIRED");
    server
        .metric(
            "troupe_session_evictions_total{model=\"toy\",version=\"1.2.3\",reason=\"expired\"}",
            "10000",
        )
        .await;
    server.metric("troupe_sessions_active{model=\"toy\"", "1").await;
    // And there is room again.
    for chunk in names.chunks(1000) {
        open(&mut client, chunk).await;
    }
    let again = resident_bytes().saturating_sub(before);
    assert!(
        again < open_bytes * 2 + (64 << 20),
        "{} then {} MiB",
        open_bytes >> 20,
        again >> 20
    );
}

/// Memory of this process; 0 where the system does not tell.
fn resident_bytes() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kib = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<usize>().ok());
    kib.unwrap_or_default() * 1024
}

#[tokio::test]
async fn styles_are_listed_read_and_added() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let list: v1::ListStylesResponse = server.get("/v1/packs/toy/styles").await.json().await.unwrap();
    let names: Vec<_> = list.styles.iter().map(|style| style.name.as_str()).collect();
    assert_eq!(names, ["normal", "sneak", "still"]);
    assert_eq!(
        (list.pack.as_str(), list.default_style.as_str()),
        ("toy", "normal")
    );
    assert!(
        list.styles[0]
            .gaits
            .iter()
            .all(|gait| gait.keys.is_empty() && gait.key_count > 0)
    );
    assert_eq!(
        client
            .list_styles(v1::ListStylesRequest::default())
            .await
            .unwrap()
            .into_inner(),
        list
    );

    let mut style: v1::Style = server
        .get("/v1/packs/toy/styles/sneak")
        .await
        .json()
        .await
        .unwrap();
    assert!(style.built_in && !style.gaits[0].keys.is_empty());
    style.name = "tiptoe".into();
    style.default_speed = 0.5;
    let response = server
        .send(Method::PUT, "/v1/packs/toy/styles/tiptoe", &style)
        .await;
    assert_eq!(response.status(), StatusCode::OK);
    let put: v1::Style = response.json().await.unwrap();
    assert!(!put.built_in && put.default_speed == 0.5);
    let get = v1::GetStyleRequest {
        pack: String::new(),
        style: "tiptoe".into(),
        ..v1::GetStyleRequest::default()
    };
    assert_eq!(client.get_style(get).await.unwrap().into_inner(), put);
    let other: v1::ListStylesResponse = server.get("/v1/packs/other/styles").await.json().await.unwrap();
    assert_eq!(other.styles.len(), 3, "only the pack it was added to has it");

    open(&mut client, &["a"]).await;
    let mut command = walk("a", 1, (0.0, 0.5));
    locomote(&mut command).style = "tiptoe".into();
    stepped(&mut client, step(&["a"], 3, vec![command])).await;
    let get = v1::GetSessionRequest { id: "a".into() };
    assert_eq!(
        client.get_session(get).await.unwrap().into_inner().style,
        "tiptoe"
    );
    // Added ones may be replaced, the pack's own may not.
    style.default_speed = 0.6;
    let response = server
        .send(Method::PUT, "/v1/packs/toy/styles/tiptoe", &style)
        .await;
    assert_eq!(response.status(), StatusCode::OK);
    style.name = "normal".into();
    let response = server
        .send(Method::PUT, "/v1/packs/toy/styles/normal", &style)
        .await;
    assert_eq!(response.status(), StatusCode::CONFLICT);
    assert_eq!(
        response.json::<ErrorBody>().await.unwrap().error.reason,
        "STYLE_IS_BUILT_IN"
    );
}

#[tokio::test]
async fn health_and_reflection_know_the_service() {
    let server = TestServer::start().await;
    let mut health = HealthClient::new(server.channel().await);
    let request = HealthCheckRequest {
        service: "troupe.v1.Sessions".into(),
    };
    let answer = health.check(request).await.unwrap().into_inner();
    assert_eq!(answer.status(), ServingStatus::Serving);
    let mut reflection = ServerReflectionClient::new(server.channel().await);
    let ask = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::FileContainingSymbol(
            "troupe.v1.Sessions.Drive".into(),
        )),
    };
    let answers = reflection.server_reflection_info(tokio_stream::iter([ask])).await;
    let answer = answers.unwrap().into_inner().message().await.unwrap().unwrap();
    let file = answer.message_response.unwrap();
    assert!(
        matches!(file, MessageResponse::FileDescriptorResponse(_)),
        "{file:?}"
    );
}

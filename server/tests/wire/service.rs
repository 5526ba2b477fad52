//! The server as a whole: answers, batching, refusals, and what tools need.

use std::time::Duration;

use prost::Message as _;
use reqwest::StatusCode;
use tokio::io::AsyncWriteExt as _;
use tokio::net::TcpStream;
use tonic::Code;
use tonic::transport::Channel;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use tonic_reflection::pb::v1::{ServerReflectionRequest, ServerReflectionResponse};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_server::api::ErrorBody;

use crate::common::{JOINTS, TestServer, character, framed, keyframe, request};

fn last_root(result: &v1::CharacterResult) -> &[f32] {
    let roots = &result.frames.as_ref().unwrap().root_positions;
    &roots[roots.len() - 3..]
}

fn assert_near(actual: &[f32], expected: &[f32]) {
    assert_eq!(actual.len(), expected.len());
    for (a, b) in actual.iter().zip(expected) {
        assert!((a - b).abs() < 1e-4, "{actual:?} is not {expected:?}");
    }
}

#[tokio::test]
async fn both_fronts_give_the_same_frames() {
    let server = TestServer::start().await;
    let mut asked = request(3);
    asked.characters[1].return_intermediates = true;
    asked.characters[2].return_positions = true;
    asked.characters[2].frame_count = None;
    asked.characters[2].allowed_token_counts = vec![5];
    let over_grpc = server
        .grpc()
        .await
        .in_between(asked.clone())
        .await
        .unwrap()
        .into_inner();
    let response = server.post(serde_json::to_vec(&asked).unwrap()).await;
    assert_eq!(response.status(), StatusCode::OK);
    let over_http: v1::InBetweenResponse = response.json().await.unwrap();
    assert_eq!(over_grpc.characters, over_http.characters);

    assert_eq!(
        (over_grpc.pack.as_str(), over_grpc.pack_version.as_str()),
        ("toy", "1.2.3")
    );
    for (index, result) in over_grpc.characters.iter().enumerate() {
        assert_eq!(result.id, asked.characters[index].id);
        assert_near(last_root(result), &[0.1 * index as f32, 0.9, 3.0]);
        let frames = result.frames.as_ref().unwrap();
        let count = frames.frame_count as usize;
        assert_eq!(count, if index == 2 { 20 } else { 40 });
        assert_eq!(frames.rotations.len(), count * JOINTS * 4);
        assert_eq!(frames.contacts.len(), count);
        assert_eq!(
            frames.positions.len(),
            if index == 2 { count * JOINTS * 3 } else { 0 }
        );
        assert_eq!(result.intermediates.is_some(), index == 1);
    }
    let stages = over_grpc.characters[1].intermediates.as_ref().unwrap();
    assert_eq!(
        (stages.predicted_frame_count, stages.tokens.as_slice()),
        (40, [1; 20].as_slice())
    );
    assert_eq!(stages.token_count_probabilities.len(), 14);
    assert_near(&stages.root_r_g3[195..], &[0.1, 0.9, 3.0, 1.0, 0.0]);

    let timing = over_grpc.timing.unwrap();
    assert_eq!(timing.batch_size, 3);
    let parts = timing.queue_us + timing.assemble_us + timing.inference_us + timing.scatter_us;
    assert!(timing.total_us > 0 && parts <= timing.total_us, "{timing:?}");
}

#[tokio::test]
async fn packs_are_listed_and_described() {
    let server = TestServer::start().await;
    let mut client = server.grpc().await;
    let list = client
        .list_packs(v1::ListPacksRequest {})
        .await
        .unwrap()
        .into_inner();
    let names: Vec<_> = list
        .packs
        .iter()
        .map(|pack| (pack.name.as_str(), pack.is_default))
        .collect();
    assert_eq!(names, [("other", false), ("toy", true)]);
    assert_eq!(
        server
            .get("/v1/packs")
            .await
            .json::<v1::ListPacksResponse>()
            .await
            .unwrap(),
        list
    );

    let toy = client
        .get_pack(v1::GetPackRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(toy, list.packs[1]);
    assert_eq!(
        server
            .get("/v1/packs/toy")
            .await
            .json::<v1::Pack>()
            .await
            .unwrap(),
        toy
    );
    assert_eq!(
        (toy.min_frames, toy.max_frames, toy.joints.len()),
        (12, 64, JOINTS)
    );
    assert_eq!(
        toy.left_axis,
        Some(v1::Vec3 {
            x: 1.0,
            y: 0.0,
            z: 0.0
        })
    );
    assert_eq!(toy.contact_rules.unwrap().clearance, [0.05]);

    let other = v1::InBetweenRequest {
        pack: "other".into(),
        ..request(1)
    };
    assert_eq!(client.in_between(other).await.unwrap().into_inner().pack, "other");
}

#[tokio::test(flavor = "multi_thread")]
async fn concurrent_callers_share_batches_and_get_their_own_frames() {
    let server = TestServer::start_with(|config| {
        config.max_batch = 64;
        // The gate makes batches look slow.
        config.fixed.max_batch_time = Duration::ZERO;
    })
    .await;
    let channel = server.channel().await;
    let call = |x: f32| {
        let mut client = MotionClient::new(channel.clone());
        async move {
            let asked = v1::InBetweenRequest {
                pack: String::new(),
                characters: vec![character(x)],
                skeleton: String::new(),
            };
            client.in_between(asked).await.unwrap().into_inner()
        }
    };
    let alone = call(1.5).await;
    assert_eq!(alone.timing.unwrap().batch_size, 1);

    server.gate.close();
    let first = tokio::spawn(call(0.0));
    server.metric("troupe_batch_size_count{model=\"toy\"", "2").await;
    let waiting: Vec<_> = (1..=48)
        .map(|index| tokio::spawn(call(0.1 * index as f32)))
        .collect();
    server.metric("troupe_pending_requests{model=\"toy\"", "48").await;
    server.gate.open();
    first.await.unwrap();
    for (index, answer) in waiting.into_iter().enumerate() {
        let answer = answer.await.unwrap();
        assert_eq!(answer.timing.unwrap().batch_size, 48);
        assert_near(
            last_root(&answer.characters[0]),
            &[0.1 * (index + 1) as f32, 0.9, 3.0],
        );
        if index == 14 {
            assert_eq!(answer.characters[0].frames, alone.characters[0].frames);
        }
    }
    let text = server.get("/metrics").await.text().await.unwrap();
    for line in [
        r#"troupe_requests_total{rpc="InBetween",code="OK"} 50"#,
        r#"troupe_batch_size_sum{model="toy",version="1.2.3"} 50"#,
        r#"troupe_dispatch_total{model="toy",version="1.2.3",reason="backlog"}"#,
        r#"troupe_frames_generated_total{model="toy",version="1.2.3"} 2000"#,
        r#"troupe_queue_duration_seconds_count{model="toy",version="1.2.3",class="request"} 50"#,
        r#"troupe_inference_duration_seconds_count{model="toy",version="1.2.3",stage="decoder"} 3"#,
        r#"troupe_model_load_seconds{model="toy",version="1.2.3"}"#,
        "process_resident_memory_bytes",
    ] {
        assert!(text.contains(line), "{line} is missing in\n{text}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_large_request_is_split_and_joined_in_order() {
    let server = TestServer::start_with(|config| config.max_batch = 8).await;
    let answer = server
        .grpc()
        .await
        .in_between(request(30))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.timing.unwrap().batch_size, 8);
    for (index, result) in answer.characters.iter().enumerate() {
        assert_near(last_root(result), &[0.1 * index as f32, 0.9, 3.0]);
    }
    server.metric("troupe_batch_size_count{model=\"toy\"", "4").await;
}

/// A call on its way.
type Call = tokio::task::JoinHandle<Result<tonic::Response<v1::InBetweenResponse>, tonic::Status>>;

/// A server whose queue is full: of one client, a call of four characters is in the engine, and
/// another one waits.
async fn full_server() -> (TestServer, MotionClient<Channel>, [Call; 2]) {
    let server = TestServer::start_with(|config| {
        config.fixed.max_characters_per_request = 4;
        config.fixed.max_queued_characters = Some(4);
    })
    .await;
    server.gate.close();
    let client = server.grpc().await;
    let call = || {
        let mut client = client.clone();
        tokio::spawn(async move { client.in_between(request(4)).await })
    };
    let running = call();
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    let waiting = call();
    server
        .metric("troupe_pending_characters{model=\"toy\"", "4")
        .await;
    (server, client, [running, waiting])
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_refuses_with_a_retry_hint() {
    let (server, mut client, calls) = full_server().await;
    let status = client.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    assert_eq!(status.get_details_error_info().unwrap().reason, "QUEUE_FULL");
    let hint = status.get_details_retry_info().unwrap().retry_delay.unwrap();
    assert!(hint >= Duration::from_millis(10));

    // Another client has as much waiting, so nothing makes room for it.
    let response = server.post(serde_json::to_vec(&request(4)).unwrap()).await;
    assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
    assert_eq!(response.headers()["retry-after"], "1");
    let body: ErrorBody = response.json().await.unwrap();
    assert_eq!(body.error.code, "RESOURCE_EXHAUSTED");
    assert!(body.error.retry_after_ms.unwrap() >= 10);

    server.gate.open();
    for answer in calls {
        assert_eq!(answer.await.unwrap().unwrap().into_inner().characters.len(), 4);
    }
    server
        .metric(
            "troupe_rejections_total{model=\"toy\",version=\"1.2.3\",reason=\"queue_full\"}",
            "2",
        )
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_makes_room_for_a_client_with_less_waiting() {
    let (server, _, [running, waiting]) = full_server().await;
    let mut small = server.grpc().await;
    let small = tokio::spawn(async move { small.in_between(request(1)).await });
    let status = waiting.await.unwrap().unwrap_err();
    assert_eq!(status.get_details_error_info().unwrap().reason, "QUEUE_FULL");
    server.gate.open();
    small.await.unwrap().unwrap();
    running.await.unwrap().unwrap();
    server
        .metric(
            "troupe_rejections_total{model=\"toy\",version=\"1.2.3\",reason=\"pushed_out\"}",
            "1",
        )
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_end_at_the_servers_or_the_callers_deadline() {
    let server = TestServer::start_with(|config| config.request_timeout_ms = 200).await;
    server.gate.close();
    let mut client = server.grpc().await;
    let status = client.in_between(request(1)).await.unwrap_err();
    assert_eq!(status.code(), Code::DeadlineExceeded);
    assert!(status.message().contains("within 200 ms"), "{}", status.message());
    let response = server.post(serde_json::to_vec(&request(1)).unwrap()).await;
    assert_eq!(response.status(), StatusCode::GATEWAY_TIMEOUT);

    // The gRPC library's client would keep its own time.
    let body = framed(&request(1).encode_to_vec());
    let (status, text) = server.raw_grpc(body, ("grpc-timeout", "20m")).await;
    assert_eq!(status, (Code::DeadlineExceeded as i32).to_string());
    assert!(text.contains("20%20ms") || text.contains("20 ms"), "{text}");
    // The work of those callers is dropped: only the first batch was cut.
    server.gate.open();
    client.in_between(request(1)).await.unwrap();
    server.metric("troupe_batch_size_count{model=\"toy\"", "2").await;
    server
        .metric(
            "troupe_rejections_total{model=\"toy\",version=\"1.2.3\",reason=\"client_gone\"}",
            "2",
        )
        .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_who_leaves_is_noticed() {
    let server = TestServer::start().await;
    server.gate.close();
    let mut client = server.grpc().await;
    let call = tokio::spawn(async move { client.in_between(request(1)).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    call.abort();
    server
        .metric(r#"troupe_requests_total{rpc="InBetween",code="CANCELLED"}"#, "1")
        .await;

    // The same over HTTP/1.1: the connection closes.
    let body = serde_json::to_string(&request(1)).unwrap();
    let mut stream = TcpStream::connect(server.handle.address()).await.unwrap();
    let head = format!(
        "POST /v1/inbetween HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    stream.write_all((head + &body).as_bytes()).await.unwrap();
    server.metric("troupe_pending_requests{model=\"toy\"", "1").await;
    drop(stream);
    server
        .metric(r#"troupe_requests_total{rpc="InBetween",code="CANCELLED"}"#, "2")
        .await;
    server.gate.open();
}

#[tokio::test]
async fn reflection_describes_the_service() {
    let server = TestServer::start().await;
    let mut client = ServerReflectionClient::new(server.channel().await);
    let ask = |message| ServerReflectionRequest {
        host: String::new(),
        message_request: Some(message),
    };
    let questions = tokio_stream::iter([
        ask(MessageRequest::ListServices(String::new())),
        ask(MessageRequest::FileContainingSymbol(
            "troupe.v1.Motion.InBetween".into(),
        )),
    ]);
    let mut answers = client
        .server_reflection_info(questions)
        .await
        .unwrap()
        .into_inner();
    let Some(ServerReflectionResponse {
        message_response: Some(MessageResponse::ListServicesResponse(list)),
        ..
    }) = answers.message().await.unwrap()
    else {
        panic!("no list");
    };
    let names: Vec<_> = list.service.iter().map(|service| service.name.as_str()).collect();
    assert!(
        names.contains(&"troupe.v1.Motion") && names.contains(&"grpc.health.v1.Health"),
        "{names:?}"
    );
    let file = answers
        .message()
        .await
        .unwrap()
        .unwrap()
        .message_response
        .unwrap();
    assert!(
        matches!(file, MessageResponse::FileDescriptorResponse(_)),
        "{file:?}"
    );
}

#[tokio::test]
async fn paths_and_methods_that_do_not_exist_are_answered_in_kind() {
    let server = TestServer::start().await;
    let missing = server.get("/v2/nothing").await;
    assert_eq!(missing.status(), StatusCode::NOT_FOUND);
    assert_eq!(
        missing.json::<ErrorBody>().await.unwrap().error.message,
        "there is no /v2/nothing"
    );
    let wrong = server.get("/v1/inbetween").await;
    assert_eq!(wrong.status(), StatusCode::METHOD_NOT_ALLOWED);
    assert_eq!(
        wrong.json::<ErrorBody>().await.unwrap().error.code,
        "METHOD_NOT_ALLOWED"
    );

    let http2 = reqwest::Client::builder()
        .http2_prior_knowledge()
        .build()
        .unwrap();
    for path in ["/troupe.v9.Motion/InBetween", "/troupe.v1.Motion/Dance"] {
        let request = http2
            .post(server.url(path))
            .header("content-type", "application/grpc");
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        assert_eq!(response.headers()["grpc-status"], "12", "{path}");
    }
}

#[tokio::test]
async fn the_documentation_needs_no_network() {
    let server = TestServer::start().await;
    let document: serde_json::Value = server.get("/openapi.json").await.json().await.unwrap();
    assert!(document["paths"]["/v1/inbetween"]["post"].is_object());
    let page = server.get("/docs/api/").await;
    let html = page.text().await.unwrap();
    let mut assets = 0;
    for part in html.split(['"', '\'']) {
        assert!(
            !part.starts_with("http://") && !part.starts_with("https://") && !part.starts_with("//"),
            "{part}"
        );
        if part.ends_with(".js") || part.ends_with(".css") {
            assets += 1;
            let path = format!("/docs/api/{}", part.trim_start_matches("./"));
            assert_eq!(server.get(&path).await.status(), StatusCode::OK, "{path}");
        }
    }
    assert!(assets >= 3, "{html}");
    let script = server
        .get("/docs/api/swagger-initializer.js")
        .await
        .text()
        .await
        .unwrap();
    assert!(
        script.contains("/openapi.json") && script.contains("\"validatorUrl\": \"none\""),
        "{script}"
    );
}

#[tokio::test]
async fn a_partial_target_is_enough() {
    let server = TestServer::start().await;
    let mut asked = request(1);
    asked.characters[0].targets = vec![v1::Keyframe {
        root: Some(v1::Root {
            heading: Some(0.5),
            ..keyframe(2.0, 2.0).root.unwrap()
        }),
        ..v1::Keyframe::default()
    }];
    let answer = server.grpc().await.in_between(asked).await.unwrap().into_inner();
    assert_near(last_root(&answer.characters[0]), &[2.0, 0.9, 2.0]);
}

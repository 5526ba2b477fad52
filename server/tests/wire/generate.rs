//! A model family that needs several steps a job, streams parts and answers in words: scheduler,
//! sessions and API know none.

use std::time::Duration;

use crate::common::{self, TestServer};
use troupe_engine::generator::Generator;
use troupe_engine::pack::Pack;
use troupe_engine::toy::{PART_FRAMES, STEPS, Toy};
use troupe_motion::model::Capabilities;
use troupe_proto::v1;
use troupe_proto::v1::describe_response;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;
use troupe_server::server::PackSource;

const WORDS: &str = "words";

/// A server with a pack of the toy family beside those of MotionBricks.
pub async fn words_server() -> TestServer {
    let more = |workers| {
        let mut manifest = common::pack(WORDS).manifest;
        manifest.family = troupe_engine::toy::FAMILY.to_owned();
        manifest.capabilities = Capabilities {
            inbetween: true,
            live: true,
            text: true,
            describe: true,
            ..Capabilities::default()
        };
        let folder = std::path::Path::new(common::FOLDER);
        vec![PackSource {
            pack: Pack::from_manifest(manifest, folder).unwrap(),
            workers,
            generator: Box::new(|pack, max_batch| {
                Ok(Box::new(Toy::new(pack.rig.dims, max_batch)) as Box<dyn Generator>)
            }),
            decision: None,
        }]
    };
    let mut server = TestServer::start_also(|_| {}, Duration::ZERO, more).await;
    server.handle.ready().await.unwrap();
    server
}

/// The error of an HTTP call to generate.
async fn json_error(server: &TestServer, body: &serde_json::Value) -> serde_json::Value {
    error_of(server, "/v1/generate", body).await
}

/// The error of an HTTP call.
async fn error_of(server: &TestServer, path: &str, body: &serde_json::Value) -> serde_json::Value {
    let call = reqwest::Client::new().post(server.url(path));
    let answer = call.json(body).send().await.unwrap();
    assert!(!answer.status().is_success(), "{body}");
    let answer: serde_json::Value = answer.json().await.unwrap();
    answer["error"].clone()
}

fn prompt(text: &str, seed: u64) -> v1::GenerateRequest {
    v1::GenerateRequest {
        pack: WORDS.to_owned(),
        goal: Some(Goal::Prompt(v1::Prompt {
            text: text.to_owned(),
            ..v1::Prompt::default()
        })),
        seed,
        ..v1::GenerateRequest::default()
    }
}

async fn parts(server: &TestServer, request: v1::GenerateRequest) -> Vec<v1::GenerateResponse> {
    let mut stream = server.grpc().await.generate(request).await.unwrap().into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await.unwrap() {
        parts.push(part);
    }
    parts
}

#[tokio::test]
async fn words_are_acted_out_part_by_part() {
    let server = words_server().await;
    let made = parts(&server, prompt("walk to the door", 7)).await;
    assert_eq!(made.len(), 4, "a part a word");
    let last: Vec<bool> = made.iter().map(|part| part.is_last).collect();
    assert_eq!(last, [false, false, false, true]);
    let mut z = Vec::new();
    for part in &made {
        let Some(Part::Frames(frames)) = &part.part else {
            panic!("{part:?}")
        };
        assert_eq!(frames.frame_count as usize, PART_FRAMES);
        z.extend(frames.root_positions.chunks(3).map(|position| position[2]));
    }
    assert!(z.windows(2).all(|pair| pair[1] > pair[0]), "it goes on: {z:?}");

    // The same alone and in company, and another with another seed.
    let beside = ["a", "b c", "d e f g h i", "walk to the door"];
    let company = beside.map(|text| parts(&server, prompt(text, 7)));
    let company = futures_util::future::join_all(company).await;
    assert_eq!(company[3], made);
    assert_ne!(parts(&server, prompt("walk to the door", 8)).await, made);
}

#[tokio::test]
async fn the_same_over_http_as_lines() {
    let server = words_server().await;
    let body = serde_json::json!({"pack": WORDS, "prompt": {"text": "wave twice"}, "seed": 3});
    let client = reqwest::Client::new();
    let answer = client
        .post(server.url("/v1/generate"))
        .json(&body)
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "application/x-ndjson");
    let text = answer.text().await.unwrap();
    let lines: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 2);
    assert_eq!(lines[1]["is_last"], true);
    let grpc = parts(&server, prompt("wave twice", 3)).await;
    let Some(Part::Frames(frames)) = &grpc[0].part else {
        panic!("{grpc:?}")
    };
    let first = &lines[0]["frames"]["root_positions"];
    assert_eq!(first.as_array().unwrap().len(), frames.root_positions.len());
}

#[tokio::test]
async fn a_motion_is_put_into_words() {
    let server = words_server().await;
    let request = v1::DescribeRequest {
        pack: WORDS.to_owned(),
        frames: common::character(0.0).context,
        ..v1::DescribeRequest::default()
    };
    let mut stream = server
        .grpc()
        .await
        .describe(request.clone())
        .await
        .unwrap()
        .into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await.unwrap() {
        parts.push(part);
    }
    let word = |part: &v1::DescribeResponse| match &part.part {
        Some(describe_response::Part::Text(text)) => text.clone(),
        other => panic!("{other:?}"),
    };
    let words: Vec<String> = parts.iter().map(word).collect();
    assert!(words[0] == "walks " && words[1].ends_with(" m"), "{words:?}");
    assert!(!parts[0].is_last && parts[1].is_last);

    // The same over HTTP, a part a line.
    let call = reqwest::Client::new().post(server.url("/v1/describe"));
    let answer = call.json(&request).send().await.unwrap();
    assert_eq!(answer.headers()["content-type"], "application/x-ndjson");
    let text = answer.text().await.unwrap();
    let lines: Vec<v1::DescribeResponse> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines, parts);
}

#[tokio::test]
async fn in_between_and_sessions_do_not_know_the_family() {
    const { assert!(STEPS > 1) };
    let server = words_server().await;
    let request = v1::InBetweenRequest {
        pack: WORDS.to_owned(),
        characters: vec![common::character(1.0), common::character(2.0)],
        skeleton: String::new(),
    };
    let answer = server
        .grpc()
        .await
        .in_between(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.characters.len(), 2);
    let frames = answer.characters[0].frames.as_ref().unwrap();
    assert!(frames.frame_count >= 12);

    // A live character, whose plans take several steps each, beside calls that join between them.
    let mut sessions = server.sessions().await;
    let options = v1::SessionOptions {
        pack: WORDS.to_owned(),
        ..v1::SessionOptions::default()
    };
    let request = v1::CreateSessionsRequest {
        sessions: vec![options.clone(), options],
    };
    let created = sessions.create_sessions(request).await.unwrap().into_inner();
    let ids: Vec<String> = created.sessions.into_iter().map(|session| session.id).collect();
    let step = v1::StepRequest {
        session_ids: ids,
        frames: 90,
        ..v1::StepRequest::default()
    };
    let calls = (0..10).map(|seed| parts(&server, prompt("walk on beside it", seed)));
    let (stepped, calls) = tokio::join!(sessions.step(step), futures_util::future::join_all(calls));
    assert!(calls.iter().all(|parts| parts.len() == 4));
    let block = &stepped.unwrap().into_inner().blocks[0];
    assert_eq!(block.frame_count, 90);
}

#[tokio::test]
async fn a_pack_that_cannot_do_it_says_what_it_can() {
    let server = words_server().await;
    let mut request = prompt("walk", 1);
    request.pack = "toy".to_owned();
    let status = server.grpc().await.generate(request).await.unwrap_err();
    assert_eq!(status.code(), tonic::Code::InvalidArgument);
    assert_eq!(
        status.message(),
        "the pack toy cannot do this: it has no capability text; it has: inbetween, live"
    );
    for (body, field) in [
        (serde_json::json!({"pack": WORDS}), "goal"),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "  "}}),
            "prompt.text",
        ),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "x".repeat(1001)}}),
            "prompt.text",
        ),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "x", "frame_count": 0}}),
            "prompt.frame_count",
        ),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "x"}, "sampling": {"temperature": 3}}),
            "sampling.temperature",
        ),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "x", "audio": {"sound": "speech", "codes": [1]}}}),
            "prompt.audio",
        ),
        (
            serde_json::json!({"pack": WORDS, "prompt": {"text": "x", "others": [{"text": "y"}]}}),
            "pack",
        ),
        (
            serde_json::json!({"pack": "none", "prompt": {"text": "x"}}),
            "pack",
        ),
    ] {
        let error = json_error(&server, &body).await;
        assert_eq!(error["field"].as_str().unwrap_or_default(), field, "{error}");
    }
    for (body, field) in [
        (serde_json::json!({"pack": "toy"}), "pack"),
        (serde_json::json!({"pack": WORDS, "frames": []}), "frames"),
        (serde_json::json!({"pack": WORDS, "into": "music"}), "into"),
        (serde_json::json!({"pack": WORDS, "into": "song"}), "into"),
    ] {
        let error = error_of(&server, "/v1/describe", &body).await;
        assert_eq!(error["field"].as_str().unwrap_or_default(), field, "{error}");
    }
}

#[tokio::test]
async fn what_fails_before_the_first_part_is_an_error_of_the_call() {
    let server = words_server().await;
    let body = serde_json::json!({"pack": WORDS, "prompt": {"text": "fail"}});
    let error = json_error(&server, &body).await;
    assert_eq!(error["code"], "INTERNAL");
}

#[tokio::test]
async fn a_client_that_leaves_cancels_the_rest() {
    let server = words_server().await;
    let long = vec!["go"; 300].join(" ");
    for _ in 0..20 {
        let mut stream = server
            .grpc()
            .await
            .generate(prompt(&long, 1))
            .await
            .unwrap()
            .into_inner();
        stream.message().await.unwrap();
    }
    // The slots are free again.
    let done = tokio::time::timeout(Duration::from_secs(10), parts(&server, prompt("stop", 1))).await;
    assert_eq!(done.unwrap().len(), 1);
}

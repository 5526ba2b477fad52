//! A server with a pack of words: a tiny VerMo pack of random weights.

use std::path::Path;

use tokio::net::TcpListener;
use tonic::Code;
use tonic::transport::Channel;
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;
use troupe_proto::v1::motion_client::MotionClient;
use troupe_server::config::Config;
use troupe_server::server::{ServerHandle, serve};

type Client = MotionClient<Channel>;

async fn start() -> (ServerHandle, Client) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
    let config = Config::local(&folder).unwrap();
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut server = serve(config, listener).await.unwrap();
    server.ready().await.unwrap();
    let client = Client::connect(format!("http://{}", server.address()))
        .await
        .unwrap();
    (server, client.max_decoding_message_size(usize::MAX))
}

fn prompt(text: &str, frame_count: Option<u32>) -> v1::GenerateRequest {
    v1::GenerateRequest {
        goal: Some(Goal::Prompt(v1::Prompt {
            text: text.to_owned(),
            frame_count,
        })),
        seed: 3,
        temperature: 1.0,
        ..v1::GenerateRequest::default()
    }
}

async fn parts(mut client: Client, request: v1::GenerateRequest) -> Vec<v1::GenerateResponse> {
    let mut stream = client.generate(request).await.unwrap().into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await.unwrap() {
        parts.push(part);
    }
    parts
}

fn frames(parts: &[v1::GenerateResponse]) -> Vec<u32> {
    let count = |part: &v1::GenerateResponse| match &part.part {
        Some(Part::Frames(frames)) => frames.frame_count,
        other => panic!("{other:?}"),
    };
    parts.iter().map(count).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn words_become_motion_part_by_part_alone_and_in_company() {
    let (server, mut client) = start().await;
    let packs = client
        .list_packs(v1::ListPacksRequest {})
        .await
        .unwrap()
        .into_inner()
        .packs;
    assert_eq!(
        (packs[0].family.as_str(), packs[0].engine.as_str()),
        ("vermo", "cpu")
    );
    let alone = parts(client.clone(), prompt("an old robot walks", Some(100))).await;
    assert_eq!(frames(&alone), [16, 32, 32, 20]);
    assert_eq!(
        alone[0].notes,
        ["captions of the pack's training have not used: robot"]
    );
    assert!(alone[1].notes.is_empty() && alone[3].is_last && !alone[2].is_last);
    let company = (0..20).map(|index| {
        let text = if index == 7 {
            "an old robot walks"
        } else {
            "someone waves"
        };
        parts(
            client.clone(),
            prompt(text, Some(if index == 7 { 100 } else { 40 + index })),
        )
    });
    let company = futures_util::future::join_all(company).await;
    assert_eq!(company[7], alone);
    assert_eq!(frames(&company[3]).iter().sum::<u32>(), 43);
    // Longer than a reply.
    let long = parts(client.clone(), prompt("someone walks", Some(600))).await;
    assert_eq!(frames(&long).iter().sum::<u32>(), 600);
    drop(server);
}

#[tokio::test(flavor = "multi_thread")]
async fn motion_becomes_words_over_both_fronts() {
    let (server, client) = start().await;
    let pack = client
        .clone()
        .get_pack(v1::GetPackRequest::default())
        .await
        .unwrap()
        .into_inner();
    let joints = pack.joints.len();
    let frames = (0..40).map(|frame| v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x: 0.0,
                y: 0.9,
                z: 0.03 * frame as f32,
            }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(joints),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    });
    let frames: Vec<v1::Keyframe> = frames.collect();
    let request = v1::GenerateRequest {
        goal: Some(Goal::Describe(v1::Describe {
            frames: frames.clone(),
        })),
        ..v1::GenerateRequest::default()
    };
    let told = parts(client.clone(), request.clone()).await;
    assert!(told.last().is_some_and(|part| part.is_last));
    let words: String = told
        .into_iter()
        .map(|part| match part.part {
            Some(Part::Text(text)) => text,
            other => panic!("{other:?}"),
        })
        .collect();
    assert!(!words.is_empty());
    let answer = reqwest::Client::new()
        .post(format!("http://{}/v1/generate", server.address()))
        .json(&request)
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    let same: String = (answer.text().await.unwrap().lines())
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        .filter_map(|line| line["part"]["text"].as_str().map(str::to_owned))
        .collect();
    assert_eq!(same, words);
    // A past of the context's length or more goes before words.
    for (count, fits) in [(15, false), (16, true), (40, true)] {
        let request = v1::GenerateRequest {
            past: frames[..count].to_vec(),
            ..prompt("a person walks", Some(24))
        };
        let answer = client.clone().generate(request).await;
        assert_eq!(answer.is_ok(), fits, "{count}: {answer:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_pack_cannot_read_or_do_is_an_error_of_the_request() {
    let (server, mut client) = start().await;
    let long = "zz ".repeat(60);
    for (request, said) in [
        (
            prompt("  ", None),
            "prompt.text: is empty; allowed: 1 to 1000 characters",
        ),
        (
            prompt(&long, None),
            "prompt.text: is 180 pieces long; allowed: at most 40 pieces",
        ),
        (
            prompt("走", None),
            "prompt.text: is \"走\"; allowed: letters that the pack can read",
        ),
    ] {
        let status = client.generate(request).await.unwrap_err();
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, said));
    }
    let status = client
        .in_between(v1::InBetweenRequest::default())
        .await
        .unwrap_err();
    assert!(
        status
            .message()
            .contains("it has no capability inbetween; it has: text, describe, agents")
    );
    drop(server);
}

//! A server with a pack of words: a tiny VerMo pack of random weights. Words become motion;
//! [`describe`] has the other way.

mod describe;
mod mmcp;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use tonic::Code;
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;
use troupe_server::server::ServerHandle;

use super::{Client, served};

async fn start() -> (ServerHandle, Client) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/vermo");
    served(&folder).await
}

fn prompt(text: &str, frame_count: Option<u32>) -> v1::GenerateRequest {
    v1::GenerateRequest {
        goal: Some(Goal::Prompt(v1::Prompt {
            text: text.to_owned(),
            frame_count,
            ..v1::Prompt::default()
        })),
        seed: 3,
        ..v1::GenerateRequest::default()
    }
}

/// A request with this prompt.
fn asking(prompt: v1::Prompt) -> v1::GenerateRequest {
    v1::GenerateRequest {
        goal: Some(Goal::Prompt(prompt)),
        seed: 3,
        ..v1::GenerateRequest::default()
    }
}

fn agent(text: &str, past: &[v1::Keyframe]) -> v1::Agent {
    v1::Agent {
        text: text.to_owned(),
        past: past.to_vec(),
    }
}

/// Frames of a body that stands still while it slides along +Z from `z` on, `x` beside the origin.
async fn slide(client: &Client, count: usize, x: f32, z: f32) -> Vec<v1::Keyframe> {
    let pack = client
        .clone()
        .get_pack(v1::GetPackRequest::default())
        .await
        .unwrap()
        .into_inner();
    let joints = pack.joints.len();
    let key = |frame: usize| v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x,
                y: 0.9,
                z: z + 0.03 * frame as f32,
            }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(joints),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    };
    (0..count).map(key).collect()
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

/// Each character's root positions, of all parts.
fn roots(parts: &[v1::GenerateResponse]) -> BTreeMap<u32, Vec<f32>> {
    let mut roots: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
    for part in parts {
        let Some(Part::Frames(frames)) = &part.part else {
            panic!("{part:?}")
        };
        roots
            .entry(part.character)
            .or_default()
            .extend(&frames.root_positions);
    }
    roots
}

/// The parts over HTTP.
async fn http_parts(server: &ServerHandle, request: &v1::GenerateRequest) -> Vec<v1::GenerateResponse> {
    let url = format!("http://{}/v1/generate", server.address());
    let answer = reqwest::Client::new()
        .post(url)
        .json(request)
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    let text = answer.text().await.unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pack_says_what_its_language_model_takes() {
    let (server, mut client) = start().await;
    let pack = client
        .get_pack(v1::GetPackRequest::default())
        .await
        .unwrap()
        .into_inner();
    let language = pack.language.unwrap();
    assert_eq!(language.tasks.len(), 10);
    assert_eq!(
        (
            language.max_prompt_pieces,
            language.max_agents,
            language.audio_codes,
            language.flow_steps
        ),
        (40, 3, 64, 28)
    );
    let sampling = v1::Sampling {
        temperature: Some(0.7),
        top_k: Some(0),
        top_p: Some(0.9),
        repetition: Some(1.1),
    };
    assert_eq!(language.sampling, Some(sampling));
    drop(server);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_past_and_targets_are_joined_in_one_part() {
    let (server, client) = start().await;
    let past = slide(&client, 40, 0.0, 0.0).await;
    let targets = slide(&client, 16, 0.0, 2.2).await;
    // A past of the context's length or more goes before words.
    for (count, fits) in [(15, false), (16, true), (40, true)] {
        let request = v1::GenerateRequest {
            past: past[..count].to_vec(),
            ..prompt("a person walks", Some(24))
        };
        let answer = client.clone().generate(request).await;
        assert_eq!(answer.is_ok(), fits, "{count}: {answer:?}");
    }
    for text in ["a person walks", ""] {
        let between = v1::Prompt {
            text: text.to_owned(),
            seconds: Some(1.05),
            targets: targets.clone(),
            ..v1::Prompt::default()
        };
        let request = v1::GenerateRequest {
            past: past.clone(),
            ..asking(between)
        };
        let made = parts(client.clone(), request.clone()).await;
        // 31.5 frames are 8 tokens.
        assert_eq!(frames(&made), [32]);
        assert!(made[0].is_last);
        let roots = &roots(&made)[&0];
        let gap = |z: f32, frame: usize| (roots[frame * 3 + 2] - z).hypot(roots[frame * 3]);
        // The motion goes from the last frame before to the first one behind.
        assert!(gap(1.17, 0) < 0.3 && gap(2.2, 31) < 0.3, "{roots:?}");
        assert_eq!(http_parts(&server, &request).await, made);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn characters_move_together_each_in_its_own_parts() {
    let (server, client) = start().await;
    let two = v1::Prompt {
        text: "someone walks".to_owned(),
        seconds: Some(2.0),
        others: vec![agent("someone waves", &[])],
        ..v1::Prompt::default()
    };
    let made = parts(client.clone(), asking(two.clone())).await;
    let lasts = made.iter().filter(|part| part.is_last).count();
    assert!(lasts == 1 && made.last().unwrap().is_last);
    let of = roots(&made);
    assert_eq!(of.keys().copied().collect::<Vec<_>>(), [0, 1]);
    assert!(
        of.values().all(|roots| roots.len() == 3 * 60),
        "60 frames of each"
    );
    // Side by side, 1 m apart.
    let apart = (of[&1][0] - of[&0][0], of[&1][2] - of[&0][2]);
    assert!((apart.0 - 1.0).abs() < 0.2 && apart.1.abs() < 0.2, "{apart:?}");
    assert_eq!(http_parts(&server, &asking(two)).await, made);

    // Each goes on from its own past, also over several replies.
    let (first, second) = (
        slide(&client, 20, 0.0, 0.0).await,
        slide(&client, 20, -2.0, 1.0).await,
    );
    let on = v1::Prompt {
        text: "someone walks".to_owned(),
        frame_count: Some(300),
        others: vec![agent("someone waves", &second)],
        ..v1::Prompt::default()
    };
    let request = v1::GenerateRequest {
        past: first.clone(),
        ..asking(on)
    };
    let made = parts(client.clone(), request.clone()).await;
    let of = roots(&made);
    assert!(
        of.values().all(|roots| roots.len() == 3 * 300),
        "300 frames of each"
    );
    for (character, x, z) in [(0, 0.0, 0.57), (1, -2.0, 1.57)] {
        let roots = &of[&character];
        let off = (roots[0] - x).hypot(roots[2] - z);
        assert!(off < 0.3, "character {character} begins {off} m away");
    }
    assert_eq!(parts(client.clone(), request).await, made, "the same seed");
}

#[tokio::test(flavor = "multi_thread")]
async fn audio_becomes_motion() {
    let (server, client) = start().await;
    let to = |sound: v1::Sound, codes: &[u32]| v1::Prompt {
        frame_count: Some(64),
        audio: Some(v1::Audio {
            sound: sound.into(),
            codes: codes.to_vec(),
        }),
        ..v1::Prompt::default()
    };
    let codes: Vec<u32> = (0..40).map(|n| n * 7 % 64).collect();
    let mut seen = Vec::new();
    for sound in [v1::Sound::Music, v1::Sound::Speech] {
        let request = asking(to(sound, &codes));
        let made = parts(client.clone(), request.clone()).await;
        assert_eq!(frames(&made).iter().sum::<u32>(), 64);
        assert_eq!(http_parts(&server, &request).await, made);
        seen.push(made);
    }
    assert_ne!(seen[0], seen[1]);
    let too_long = asking(to(v1::Sound::Music, &[1; 110]));
    let status = client.clone().generate(too_long).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(
        status.message().starts_with("prompt.audio.codes: "),
        "{}",
        status.message()
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn flow_steps_make_other_frames_of_the_same_tokens() {
    let (server, client) = start().await;
    let with = |flow_steps| v1::Prompt {
        text: "someone walks".to_owned(),
        frame_count: Some(40),
        flow_steps,
        ..v1::Prompt::default()
    };
    let plain = parts(client.clone(), asking(with(None))).await;
    assert_eq!(parts(client.clone(), asking(with(Some(0)))).await, plain);
    assert!(plain.len() > 1);
    let finer = parts(client.clone(), asking(with(Some(4)))).await;
    assert_eq!(frames(&finer), [40], "in one part");
    assert_ne!(roots(&finer), roots(&plain));
    drop(server);
}

#[tokio::test(flavor = "multi_thread")]
async fn sampling_is_the_packs_or_the_requests() {
    let (server, client) = start().await;
    let with = |sampling: Option<v1::Sampling>, seed| v1::GenerateRequest {
        sampling,
        seed,
        ..prompt("someone walks", Some(40))
    };
    let some = |change: fn(&mut v1::Sampling)| {
        let mut sampling = v1::Sampling::default();
        change(&mut sampling);
        Some(sampling)
    };
    let made = |request| parts(client.clone(), request);
    let usual = made(with(None, 3)).await;
    let written_out = some(|s| {
        *s = v1::Sampling {
            temperature: Some(0.7),
            top_k: Some(0),
            top_p: Some(0.9),
            repetition: Some(1.1),
        }
    });
    assert_eq!(made(with(written_out, 3)).await, usual);
    assert_ne!(made(with(None, 4)).await, usual);
    // The likeliest tokens depend on no seed, and so it is where one token may be drawn.
    for still in [some(|s| s.temperature = Some(0.0)), some(|s| s.top_k = Some(1))] {
        let request = |seed| with(still, seed);
        assert_eq!(made(request(3)).await, made(request(4)).await);
    }
    for (sampling, said) in [
        (
            some(|s| s.temperature = Some(2.5)),
            "sampling.temperature: is 2.5; allowed: 0 to 2",
        ),
        (
            some(|s| s.top_p = Some(0.0)),
            "sampling.top_p: is 0; allowed: more than 0, and at most 1",
        ),
        (
            some(|s| s.repetition = Some(0.5)),
            "sampling.repetition: is 0.5; allowed: 1 to 10",
        ),
    ] {
        let status = client.clone().generate(with(sampling, 3)).await.unwrap_err();
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, said));
    }
    drop(server);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_leaves_cancels_the_rest() {
    let (server, client) = start().await;
    let alone = parts(client.clone(), prompt("someone waves", Some(60))).await;
    for _ in 0..3 * troupe_engine::families::vermo::SLOTS {
        let request = prompt("someone walks", Some(1024));
        let mut stream = client.clone().generate(request).await.unwrap().into_inner();
        stream.message().await.unwrap();
    }
    // The slots are free again, and what was begun there is gone.
    let request = prompt("someone waves", Some(60));
    let done = tokio::time::timeout(Duration::from_secs(60), parts(client.clone(), request)).await;
    assert_eq!(done.unwrap(), alone);
    drop(server);
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

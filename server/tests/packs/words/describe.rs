//! Motion becomes words, or audio that goes with it.

use v1::describe_response::Part;

use super::*;

async fn described(client: &Client, request: &v1::DescribeRequest) -> Vec<v1::DescribeResponse> {
    let answer = client.clone().describe(request.clone()).await;
    let mut stream = answer.unwrap().into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await.unwrap() {
        parts.push(part);
    }
    assert!(parts.last().is_some_and(|part| part.is_last));
    assert_eq!(parts.iter().filter(|part| part.is_last).count(), 1);
    parts
}

async fn http_described(server: &ServerHandle, request: &v1::DescribeRequest) -> Vec<v1::DescribeResponse> {
    let url = format!("http://{}/v1/describe", server.address());
    let call = reqwest::Client::new().post(url).json(request);
    let answer = call.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], "application/x-ndjson");
    let text = answer.text().await.unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn text(parts: &[v1::DescribeResponse]) -> String {
    let words = |part: &v1::DescribeResponse| match &part.part {
        Some(Part::Text(text)) => text.clone(),
        other => panic!("{other:?}"),
    };
    parts.iter().map(words).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn motion_becomes_words_over_both_fronts_alone_and_in_company() {
    let (server, client) = start().await;
    let request = v1::DescribeRequest {
        frames: slide(&client, 40, 0.0, 0.0).await,
        seed: 5,
        ..v1::DescribeRequest::default()
    };
    let alone = described(&client, &request).await;
    assert!(!text(&alone).is_empty());
    assert_eq!(http_described(&server, &request).await, alone);
    let seeds = (0..12).map(|seed| v1::DescribeRequest {
        seed,
        ..request.clone()
    });
    let requests: Vec<_> = seeds.collect();
    let company = requests.iter().map(|request| described(&client, request));
    let walks = (0..4).map(|_| parts(client.clone(), prompt("someone walks", Some(60))));
    let (company, walks) = tokio::join!(
        futures_util::future::join_all(company),
        futures_util::future::join_all(walks)
    );
    assert_eq!(text(&company[5]), text(&alone));
    assert!(company.iter().any(|other| text(other) != text(&alone)));
    assert!(walks.iter().all(|walk| *walk == walks[0]));
}

#[tokio::test(flavor = "multi_thread")]
async fn motion_of_several_characters_becomes_words() {
    let (server, client) = start().await;
    let frames = slide(&client, 40, 0.0, 0.0).await;
    let other = v1::OtherMotion {
        frames: slide(&client, 40, 1.0, 0.0).await,
    };
    let two = v1::DescribeRequest {
        frames: frames.clone(),
        others: vec![other.clone()],
        ..v1::DescribeRequest::default()
    };
    let alone = v1::DescribeRequest {
        others: Vec::new(),
        ..two.clone()
    };
    let described_two = described(&client, &two).await;
    assert_ne!(text(&described_two), text(&described(&client, &alone).await));
    assert_eq!(http_described(&server, &two).await, described_two);
}

#[tokio::test(flavor = "multi_thread")]
async fn motion_becomes_audio() {
    let (server, client) = start().await;
    let frames = slide(&client, 40, 0.0, 0.0).await;
    for (into, sound) in [
        (v1::Telling::Music, v1::Sound::Music),
        (v1::Telling::Speech, v1::Sound::Speech),
    ] {
        let request = v1::DescribeRequest {
            frames: frames.clone(),
            into: into.into(),
            seed: 2,
            ..v1::DescribeRequest::default()
        };
        let parts = described(&client, &request).await;
        let mut codes = Vec::new();
        for part in &parts {
            match &part.part {
                Some(Part::Audio(audio)) if audio.sound == i32::from(sound) => codes.extend(&audio.codes),
                other => panic!("{other:?}"),
            }
        }
        assert!(
            !codes.is_empty() && codes.iter().all(|&code| code < 64),
            "{codes:?}"
        );
        assert_eq!(described(&client, &request).await, parts, "the same seed");
        assert_eq!(http_described(&server, &request).await, parts);

        // The audio of a motion can be danced to.
        let dance = v1::Prompt {
            frame_count: Some(16),
            audio: Some(v1::Audio {
                sound: sound.into(),
                codes: codes.into_iter().take(60).collect(),
            }),
            ..v1::Prompt::default()
        };
        let made = super::parts(client.clone(), asking(dance)).await;
        assert_eq!(super::frames(&made).iter().sum::<u32>(), 16);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_described_names_the_field_on_both_fronts() {
    let (server, client) = start().await;
    let frames = slide(&client, 300, 0.0, 0.0).await;
    let request = |count: usize| v1::DescribeRequest {
        frames: frames[..count].to_vec(),
        ..v1::DescribeRequest::default()
    };
    let hot = v1::DescribeRequest {
        sampling: Some(v1::Sampling {
            temperature: Some(2.5),
            ..v1::Sampling::default()
        }),
        ..request(40)
    };
    for (request, field, allowed) in [
        (request(0), "frames", "2 to 1024"),
        (request(3), "frames", "4 to 259"),
        (request(300), "frames", "4 to 259"),
        (hot, "sampling.temperature", "0 to 2"),
    ] {
        let status = client.clone().describe(request.clone()).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        let said = status.message();
        assert!(said.starts_with(&format!("{field}: ")), "{said}");
        assert!(said.ends_with(&format!("allowed: {allowed}")), "{said}");
        let url = format!("http://{}/v1/describe", server.address());
        let call = reqwest::Client::new().post(url).json(&request);
        let answer = call.send().await.unwrap();
        assert_eq!(answer.status(), 400);
        let error: serde_json::Value = answer.json().await.unwrap();
        assert_eq!(error["error"]["field"], field);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_leaves_cancels_a_description() {
    let (server, client) = start().await;
    let request = v1::DescribeRequest {
        frames: slide(&client, 40, 0.0, 0.0).await,
        ..v1::DescribeRequest::default()
    };
    let alone = described(&client, &request).await;
    for _ in 0..3 * troupe_engine::families::vermo::SLOTS {
        drop(client.clone().describe(request.clone()).await.unwrap());
    }
    let again = tokio::time::timeout(Duration::from_secs(60), described(&client, &request)).await;
    assert_eq!(text(&again.unwrap()), text(&alone));
    drop(server);
}

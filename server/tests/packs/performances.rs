//! Characters of the pack `human` that act out words of a tiny VerMo pack of random weights.

use std::path::Path;
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use tokio::net::TcpListener;
use tokio_tungstenite::tungstenite::Message;
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Said;
use troupe_proto::v1::session_event::Kind;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_server::config::Config;
use troupe_server::server::{ServerHandle, serve};

use crate::calls::{Client, drive, frames_of, ids, open, options, step, walk};
use crate::pack_folder;

/// A server with `human`, `g1` and the pack of words.
async fn start() -> (ServerHandle, Client) {
    let folder = tempfile::tempdir().unwrap();
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let words = here.join("../engine/tests/vermo").canonicalize().unwrap();
    let robot = here.join("../models/g1").canonicalize().unwrap();
    let human = pack_folder().canonicalize().unwrap();
    for (name, of) in [("human", human), ("words", words), ("g1", robot)] {
        std::os::unix::fs::symlink(of, folder.path().join(name)).unwrap();
    }
    let config = Config::local(folder.path()).unwrap();
    let listener = TcpListener::bind(config.listen).await.unwrap();
    let mut server = serve(config, listener).await.unwrap();
    server.ready().await.unwrap();
    let client = SessionsClient::connect(format!("http://{}", server.address()));
    let client = client.await.unwrap().max_decoding_message_size(usize::MAX);
    (server, client)
}

fn asked(id: &str, sequence: u64, perform: v1::Perform) -> v1::Command {
    v1::Command {
        intent: Some(Intent::Perform(perform)),
        ..walk(id, sequence, (0.0, 0.0))
    }
}

fn perform(id: &str, sequence: u64, text: &str) -> v1::Command {
    let perform = v1::Perform {
        text: text.to_owned(),
        seconds: Some(2.0),
        ..v1::Perform::default()
    };
    asked(id, sequence, perform)
}

/// The events of performances: the frame, and the reason of an end.
fn performances(events: &[v1::SessionEvent]) -> Vec<(u64, &str)> {
    let of = |event: &'_ v1::SessionEvent| (event.frame, event.kind.clone());
    let word = |kind: Option<Kind>| match kind {
        Some(Kind::Performing(_)) => Some("STARTED"),
        Some(Kind::Performed(end)) => Some(match end.reason.as_str() {
            "DONE" => "DONE",
            "INTERRUPTED" => "INTERRUPTED",
            "LATE" => "LATE",
            _ => "OTHER",
        }),
        _ => None,
    };
    let kinds = events.iter().map(of);
    kinds
        .filter_map(|(frame, kind)| Some((frame, word(kind)?)))
        .collect()
}

/// Frames and events of a session that walks, performs and walks again, in steps of `frames`.
async fn stepped(client: &mut Client, id: &str, frames: u32) -> (Vec<f32>, Vec<v1::SessionEvent>) {
    open(client, &[id]).await;
    let (mut roots, mut events) = (Vec::new(), Vec::new());
    for start in (0..150).step_by(frames as usize) {
        let commands = match start {
            0 => vec![walk(id, 1, (0.0, 1.2))],
            30 => vec![perform(id, 2, "an old robot walks")],
            _ => Vec::new(),
        };
        let answer = client
            .step(step(&[id], frames, commands))
            .await
            .unwrap()
            .into_inner();
        roots.extend(frames_of(&answer.blocks[0], 0).0);
        events.extend(answer.events.into_iter().flat_map(|of| of.events));
    }
    (roots, events)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_performs_and_walks_again_the_same_however_it_is_stepped() {
    let (server, mut client) = start().await;
    let (roots, events) = stepped(&mut client, "a", 30).await;
    // Two seconds of words from the splice frame on, of which the last frames go over to the walk.
    assert_eq!(performances(&events), [(34, "STARTED"), (34 + 60 - 8, "DONE")]);
    match &events[0].kind {
        Some(Kind::Performing(start)) => {
            assert_eq!((start.sequence, start.pack.as_str()), (2, "tiny-vermo"));
            assert_eq!(
                (start.text.as_str(), &start.unknown_words[..]),
                ("an old robot walks", &["robot".to_owned()][..])
            );
        }
        other => panic!("{other:?}"),
    }
    let speed = |from: usize, to: usize| {
        let place = |frame: usize| [roots[frame * 3], roots[frame * 3 + 2]];
        let (a, b) = (place(from), place(to));
        (b[0] - a[0]).hypot(b[1] - a[1]) * 30.0 / (to - from) as f32
    };
    assert!(
        speed(10, 30) > 0.5 && speed(125, 149) > 0.5,
        "{} and {} m/s",
        speed(10, 30),
        speed(125, 149)
    );
    let (again, same_events) = stepped(&mut client, "b", 15).await;
    assert_eq!((again, same_events), (roots, events));
    server.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_acted_out_names_the_field() {
    let (server, mut client) = start().await;
    open(&mut client, &["a"]).await;
    let robot = v1::SessionOptions {
        pack: "g1".to_owned(),
        ..options("r")
    };
    let request = v1::CreateSessionsRequest {
        sessions: vec![robot],
    };
    client.create_sessions(request).await.unwrap();
    let of = |text: &str| v1::Perform {
        text: text.to_owned(),
        ..v1::Perform::default()
    };
    let in_pack = |pack: &str| v1::Perform {
        pack: pack.to_owned(),
        ..of("wave")
    };
    let lasting = |seconds| v1::Perform {
        seconds: Some(seconds),
        ..of("wave")
    };
    let cases = [
        ("a", of(""), "perform.text", "is empty"),
        ("a", of(" \n"), "perform.text", "is empty"),
        ("a", of(&"é".repeat(1001)), "perform.text", "has 1001 characters"),
        ("a", of(&"zz ".repeat(60)), "perform.text", "at most 40 pieces"),
        (
            "a",
            in_pack("opera"),
            "perform.pack",
            "unknown pack \"opera\"; loaded: g1, human, tiny-vermo",
        ),
        ("a", in_pack("human"), "perform.pack", "it has no capability text"),
        ("a", lasting(0.1), "perform.seconds", "0.5 to 30"),
        ("a", lasting(f32::NAN), "perform.seconds", "0.5 to 30"),
        (
            "a",
            v1::Perform {
                temperature: Some(9.0),
                ..of("wave")
            },
            "perform.temperature",
            "0 to 2",
        ),
        (
            "r",
            in_pack("tiny-vermo"),
            "perform.pack",
            "its joints differ from the session's",
        ),
        (
            "r",
            of("wave"),
            "perform.pack",
            "no pack of this server turns words into motion",
        ),
    ];
    let commands = cases.iter().enumerate();
    let commands: Vec<v1::Command> = commands
        .map(|(index, (id, perform, ..))| asked(id, index as u64 + 1, perform.clone()))
        .collect();
    let request = v1::CommandRequest {
        commands: commands.clone(),
    };
    let results = client
        .command(request.clone())
        .await
        .unwrap()
        .into_inner()
        .results;
    let http = reqwest::Client::new()
        .post(format!("http://{}/v1/commands", server.address()))
        .json(&v1::CommandRequest {
            // JSON has no NaN.
            commands: commands
                .into_iter()
                .filter(|command| command.sequence != 8)
                .collect(),
        })
        .send()
        .await
        .unwrap();
    assert_eq!(http.status(), 200);
    let http: v1::CommandResponse = http.json().await.unwrap();
    for results in [results, http.results] {
        for (place, result) in results.iter().enumerate() {
            let (_, _, field, said) = &cases[result.sequence as usize - 1];
            let problem = result.problem.as_ref().unwrap_or_else(|| panic!("{result:?}"));
            assert_eq!(problem.field, format!("commands[{place}].{field}"), "{problem:?}");
            let whole = format!("{} {}", problem.message, problem.allowed);
            assert!(whole.contains(said), "{whole}");
        }
    }
    server.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_socket_performs_too_and_a_session_says_what_it_acts_out() {
    let (server, mut client) = start().await;
    open(&mut client, &["a"]).await;
    let url = format!("ws://{}/v1/drive", server.address());
    let mut socket = tokio_tungstenite::connect_async(url).await.unwrap().0;
    for message in [
        serde_json::json!({"open": {}}),
        serde_json::json!({"attach": {"session_ids": ["a"]}}),
        serde_json::json!({"command": {"commands": [
            {"session_id": "a", "sequence": 1, "perform": {"text": "someone waves", "seconds": 2.0}}
        ]}}),
    ] {
        socket
            .send(Message::Text(message.to_string().into()))
            .await
            .unwrap();
    }
    let mut events = Vec::new();
    let mut activity = None;
    while !events
        .iter()
        .any(|event: &v1::SessionEvent| matches!(event.kind, Some(Kind::Performed(_))))
    {
        let next = tokio::time::timeout(Duration::from_secs(20), socket.next()).await;
        let Message::Text(text) = next.expect("in time").unwrap().unwrap() else {
            continue;
        };
        let said: v1::DriveResponse = serde_json::from_str(&text).unwrap();
        if let Some(Said::Events(happened)) = said.message {
            events.extend(happened.sessions.into_iter().flat_map(|of| of.events));
            let session = client
                .get_session(v1::GetSessionRequest { id: "a".into() })
                .await
                .unwrap();
            activity = activity.or(session.into_inner().activity);
        }
    }
    assert_eq!(
        performances(&events)
            .iter()
            .map(|(_, word)| *word)
            .collect::<Vec<_>>(),
        ["STARTED", "DONE"]
    );
    let activity = activity.unwrap();
    assert_eq!(
        (activity.kind(), activity.text.as_str()),
        (v1::ActivityKind::Performing, "someone waves")
    );
    server.shut_down().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn some_perform_while_others_walk_without_an_underrun() {
    let (server, mut client) = start().await;
    let (actors, walkers) = (ids("actor", 20), ids("walker", 20));
    let all: Vec<String> = actors.iter().chain(&walkers).cloned().collect();
    open(&mut client, &all).await;
    let (ask, mut answers) = drive(&mut client, &all).await;
    let commands = actors.iter().map(|id| perform(id, 2, "a person waves"));
    let commands = v1::CommandRequest {
        commands: commands.collect(),
    };
    let message = Some(Ask::Command(commands));
    ask.send(v1::DriveRequest { message }).await.unwrap();
    let (mut events, mut ended, mut ticks_after) = (Vec::new(), 0, 0);
    while ended < actors.len() || ticks_after < 60 {
        let next = tokio::time::timeout(Duration::from_secs(30), answers.message()).await;
        match next.expect("in time").unwrap().unwrap().message {
            Some(Said::Events(happened)) => {
                events.extend(happened.sessions.into_iter().flat_map(|of| of.events));
                let is_end = |event: &&v1::SessionEvent| matches!(event.kind, Some(Kind::Performed(_)));
                ended = events.iter().filter(is_end).count();
            }
            Some(Said::Frames(_)) if ended == actors.len() => ticks_after += 1,
            _ => {}
        }
    }
    let count = |word: &str| {
        performances(&events)
            .iter()
            .filter(|(_, other)| *other == word)
            .count()
    };
    assert_eq!(
        (count("STARTED"), count("DONE")),
        (20, 20),
        "{:?}",
        performances(&events)
    );
    let mut underruns = 0;
    for id in &all {
        let session = client
            .get_session(v1::GetSessionRequest { id: id.clone() })
            .await
            .unwrap();
        underruns += session.into_inner().stats.unwrap().underruns;
    }
    assert_eq!(underruns, 0);
    let text = reqwest::get(format!("http://{}/metrics", server.address()))
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    let done = text
        .lines()
        .find(|line| line.starts_with("troupe_performances_total{model=\"human\"") && line.contains("done"));
    assert!(done.is_some_and(|line| line.ends_with(" 20")), "{done:?}");
    server.shut_down().await;
}

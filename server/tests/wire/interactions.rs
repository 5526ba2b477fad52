//! Interactions over the wire: commands, what becomes of them, and what is refused.

use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;
use troupe_proto::v1::session_event::Kind;

use crate::common::TestServer;
use crate::common::calls::{options, step, walk};
use crate::common::scenes::{STOOL, YARD, put_scene, put_stool, scenes};

fn inside(id: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        scene: "yard".into(),
        ..options(id)
    }
}

fn command(id: &str, sequence: u64, intent: Intent) -> v1::Command {
    v1::Command {
        session_id: id.into(),
        sequence,
        intent: Some(intent),
        ..v1::Command::default()
    }
}

fn interact(instance: &str, variant: &str) -> Intent {
    Intent::Interact(v1::Interact {
        instance: instance.into(),
        variant: variant.into(),
        approach: String::new(),
    })
}

/// A server with a yard, and sessions in it.
async fn yard(ids: &[&str]) -> TestServer {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, YARD).await.unwrap();
    let request = v1::CreateSessionsRequest {
        sessions: ids.iter().map(|id| inside(id)).collect(),
    };
    server.sessions().await.create_sessions(request).await.unwrap();
    server
}

fn kinds(events: &[v1::SessionEvent]) -> Vec<&'static str> {
    let kind = |event: &v1::SessionEvent| match event.kind.as_ref().unwrap() {
        Kind::Started(_) => "started",
        Kind::Entered(_) => "entered",
        Kind::Reached(_) => "reached",
        Kind::Attached(_) => "attached",
        Kind::Released(_) => "released",
        Kind::Done(_) => "done",
        Kind::Failed(_) => "failed",
        Kind::Interrupted(_) => "interrupted",
        Kind::Fell(_) => "fell",
        Kind::Landed(_) => "landed",
        Kind::Arrived(_) => "arrived",
        Kind::Bounded(_) => "bounded",
        Kind::Performing(_) => "performing",
        Kind::Performed(_) => "performed",
    };
    events.iter().map(kind).collect()
}

async fn session(server: &TestServer, id: &str) -> v1::Session {
    let request = v1::GetSessionRequest { id: id.into() };
    let answer = server.sessions().await.get_session(request).await;
    answer.unwrap().into_inner()
}

#[tokio::test]
async fn an_object_is_used_and_left_again() {
    let server = yard(&["a", "b"]).await;
    let mut client = server.sessions().await;
    let commands = vec![command("a", 1, interact("stool-1", ""))];
    let mut seen: Vec<v1::SessionEvent> = Vec::new();
    let mut next = step(&["a", "b"], 10, commands);
    for _ in 0..40 {
        let answer = client.step(next).await.unwrap().into_inner();
        assert!(
            answer.command_results.iter().all(|r| r.problem.is_none()),
            "{answer:?}"
        );
        for of in answer.events {
            assert_eq!(
                (of.slot, of.session_id.as_str()),
                (0, "a"),
                "nothing happens to the other"
            );
            seen.extend(of.events);
        }
        if session(&server, "a").await.activity.unwrap().kind() == v1::ActivityKind::Held {
            break;
        }
        next = step(&["a", "b"], 10, vec![]);
    }
    assert_eq!(kinds(&seen), ["started", "entered", "reached"], "{seen:?}");
    let Some(Kind::Started(started)) = &seen[0].kind else {
        panic!()
    };
    assert_eq!(
        (
            started.definition.as_str(),
            started.variant.as_str(),
            started.approach.as_str()
        ),
        ("stool", "sit", "front")
    );
    assert!(seen.is_sorted_by_key(|event| event.frame));
    let scene = v1::GetSceneRequest {
        name: "yard".into(),
        ..v1::GetSceneRequest::default()
    };
    let mut of_scenes = scenes(&server).await;
    let stool = of_scenes
        .get_scene(scene)
        .await
        .unwrap()
        .into_inner()
        .objects
        .remove(0);
    assert_eq!(
        (stool.state(), stool.holder.as_str()),
        (v1::ObjectState::Reserved, "a")
    );

    // The answer to the second character names the holder.
    let commands = vec![
        command("b", 1, interact("stool-1", "")),
        command("b", 2, interact("stool-9", "")),
        command("b", 3, interact("stool-2", "kick")),
        command("a", 2, Intent::EndInteraction(v1::EndInteraction {})),
    ];
    let answer = client
        .step(step(&["a", "b"], 60, commands))
        .await
        .unwrap()
        .into_inner();
    let problems: Vec<_> = (answer.command_results[..3].iter())
        .map(|result| result.problem.clone().unwrap())
        .map(|problem| (problem.reason, problem.field))
        .collect();
    let problem = |reason: &str, field: &str| (reason.to_owned(), field.to_owned());
    assert_eq!(
        problems,
        [
            problem("OBJECT_TAKEN", "commands[0].interact.instance"),
            problem("UNKNOWN_OBJECT", "commands[1].interact.instance"),
            problem("UNKNOWN_VARIANT", "commands[2].interact.variant"),
        ]
    );
    let rest: Vec<_> = answer.events.iter().flat_map(|of| kinds(&of.events)).collect();
    assert_eq!(rest, ["done"]);
    server
        .metric(
            "troupe_interactions_total{model=\"toy\",version=\"1.2.3\",outcome=\"done\"}",
            "1",
        )
        .await;
}

#[tokio::test]
async fn a_session_limits_its_waiting_commands() {
    let server = yard(&["a"]).await;
    let mut client = server.sessions().await;
    let later = |sequence| v1::Command {
        at_frame: Some(1000),
        ..command("a", sequence, Intent::Drop(v1::DropHeld {}))
    };
    let commands = (1..=9).map(later).chain([walk("a", 10, (0.0, 1.0))]).collect();
    let answer = client.step(step(&["a"], 1, commands)).await.unwrap().into_inner();
    let mut results = answer.command_results;
    let full = results.remove(8).problem.unwrap();
    assert_eq!(
        (full.reason.as_str(), full.field.as_str()),
        ("TOO_MANY_COMMANDS", "commands[8].intent")
    );
    assert!(full.message.contains("at most 8"), "{}", full.message);
    assert!(
        results
            .iter()
            .all(|result| result.status() == v1::CommandStatus::Accepted)
    );
}

#[tokio::test]
async fn a_command_breaks_off_and_a_session_that_ends_frees_what_it_had() {
    let server = yard(&["a"]).await;
    let mut client = server.sessions().await;
    let commands = vec![command("a", 1, interact("stool-2", "sit"))];
    client.step(step(&["a"], 5, commands)).await.unwrap();
    let activity = session(&server, "a").await.activity.unwrap();
    assert_ne!(activity.kind(), v1::ActivityKind::Locomotion);
    assert_eq!(activity.instance, "stool-2");
    let answer = client
        .step(step(&["a"], 5, vec![walk("a", 2, (0.0, 1.0))]))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(kinds(&answer.events[0].events), ["interrupted"]);
    let commands = vec![command("a", 3, interact("stool-2", ""))];
    client.step(step(&["a"], 5, commands)).await.unwrap();
    let close = v1::CloseSessionsRequest {
        ids: vec!["a".into()],
    };
    client.close_sessions(close).await.unwrap();
    let scene: v1::Scene = server.get("/v1/scenes/yard").await.json().await.unwrap();
    assert!(
        scene
            .objects
            .iter()
            .all(|object| object.state() == v1::ObjectState::Free)
    );
}

#[tokio::test]
async fn a_stream_tells_what_happens() {
    let server = yard(&["a"]).await;
    let mut client = server.sessions().await;
    let (ask, asked) = tokio::sync::mpsc::channel(8);
    let ask = |message| {
        let sent = ask.try_send(v1::DriveRequest {
            message: Some(message),
        });
        sent.unwrap();
    };
    ask(Ask::Open(v1::DriveOpen::default()));
    ask(Ask::Attach(v1::DriveAttach {
        session_ids: vec!["a".into()],
    }));
    let commands = vec![command("a", 1, interact("stool-1", ""))];
    ask(Ask::Command(v1::CommandRequest { commands }));
    let stream = tokio_stream::wrappers::ReceiverStream::new(asked);
    let mut said = client.drive(stream).await.unwrap().into_inner();
    let mut seen = Vec::new();
    let all = async {
        while let Some(message) = said.message().await.unwrap() {
            if let Some(Say::Events(happened)) = message.message {
                seen.extend(happened.sessions.into_iter().flat_map(|of| of.events));
            }
            if kinds(&seen).contains(&"reached") {
                return;
            }
        }
    };
    tokio::time::timeout(std::time::Duration::from_secs(20), all)
        .await
        .unwrap();
    assert_eq!(kinds(&seen), ["started", "entered", "reached"]);
}

/// Two want one object within one step: who asks at the earlier frame gets it, whoever is first in
/// the request and whoever's plans come first.
#[tokio::test]
async fn the_earlier_frame_wins_within_a_step() {
    for ids in [["a", "b"], ["b", "a"]] {
        let server = yard(&["a", "b"]).await;
        let at = |id: &str, frame: u64| v1::Command {
            at_frame: Some(frame),
            ..command(id, 1, interact("stool-1", ""))
        };
        let commands = vec![at("a", 40), at("b", 30)];
        let answer = server.sessions().await.step(step(&ids, 60, commands)).await;
        let answer = answer.unwrap().into_inner();
        let seen = |id: &str| {
            let of = answer.events.iter().find(|of| of.session_id == id).unwrap();
            (kinds(&of.events)[0], of.events[0].frame)
        };
        assert_eq!(seen("b"), ("started", 30), "{answer:?}");
        assert_eq!(seen("a"), ("failed", 40), "{answer:?}");
    }
}

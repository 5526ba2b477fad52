//! Skills over the wire: gRPC, HTTP and WebSocket.

use serde_json::{Value, json};
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_response::Message as Say;
use troupe_proto::v1::session_event::Kind;

use crate::common::TestServer;
use crate::common::calls::{open, step, walk};
use crate::websocket::Socket;

fn skill(id: &str, sequence: u64, name: &str, variant: &str) -> v1::Command {
    v1::Command {
        session_id: id.into(),
        sequence,
        intent: Some(Intent::Skill(v1::UseSkill {
            name: name.into(),
            variant: variant.into(),
        })),
        ..v1::Command::default()
    }
}

async fn session(server: &TestServer, id: &str) -> v1::Session {
    let request = v1::GetSessionRequest { id: id.into() };
    let answer = server.sessions().await.get_session(request).await;
    answer.unwrap().into_inner()
}

#[tokio::test]
async fn a_pack_lists_its_skills() {
    let server = TestServer::start().await;
    let body: Value = reqwest::get(server.url("/v1/packs"))
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let skills = &body["packs"][0]["skills"];
    assert_eq!(
        *skills,
        json!([{
            "name": "duck",
            "description": "Goes down, and up again when it is ended.",
            "variants": ["low"],
            "held": true,
        }])
    );
}

#[tokio::test]
async fn a_skill_is_held_and_left_before_it_walks() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    let answer = client
        .step(step(&["a"], 90, vec![skill("a", 1, "duck", "")]))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.command_results[0].problem, None);
    let low = session(&server, "a").await;
    let activity = low.activity.clone().unwrap();
    assert_eq!(activity.kind(), v1::ActivityKind::Held);
    assert_eq!(
        (activity.instance.as_str(), activity.set.as_str()),
        ("duck", "down")
    );
    assert!((low.position.unwrap().y - 0.5).abs() < 0.02, "{low:?}");

    let walks = walk("a", 2, (0.0, 1.0));
    let answer = client
        .step(step(&["a"], 120, vec![walks]))
        .await
        .unwrap()
        .into_inner();
    let kinds: Vec<_> = answer.events[0]
        .events
        .iter()
        .map(|event| event.kind.clone().unwrap())
        .collect();
    assert!(
        matches!(&kinds[0], Kind::Entered(of) if of.set == "up"),
        "{kinds:?}"
    );
    assert!(
        matches!(kinds.last().unwrap(), Kind::Done(of) if of.instance == "duck"),
        "{kinds:?}"
    );
    let up = session(&server, "a").await;
    assert!(up.position.unwrap().y > 0.7 && up.speed > 0.5, "{up:?}");
}

#[tokio::test]
async fn an_unknown_skill_is_refused_with_the_known_names() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    let long = "x".repeat(65);
    let commands = vec![
        skill("a", 1, "fly", ""),
        skill("a", 2, "duck", "high"),
        skill("a", 3, "", ""),
        skill("a", 4, "duck", &long),
        // It is in the pack's folder, and did not keep the server from starting.
        skill("a", 5, "hop", ""),
    ];
    let request = v1::CommandRequest { commands };
    let results = client.command(request).await.unwrap().into_inner().results;
    let problems: Vec<_> = (results.iter())
        .map(|result| {
            let problem = result.problem.as_ref().unwrap();
            (
                problem.reason.as_str(),
                problem.field.as_str(),
                problem.allowed.as_str(),
            )
        })
        .collect();
    assert_eq!(
        problems,
        [
            ("UNKNOWN_SKILL", "commands[0].skill.name", "duck"),
            ("UNKNOWN_VARIANT", "commands[1].skill.variant", "low"),
            ("INVALID_FIELD", "commands[2].skill.name", "1 to 64 characters"),
            (
                "INVALID_FIELD",
                "commands[3].skill.variant",
                "at most 64, or none"
            ),
            (
                "TOO_SHORT",
                "commands[4].skill.name",
                "one whose sets have at least 8 frames, or a pack that makes fewer at a time"
            ),
        ]
    );
    let problem = results[4].problem.as_ref().unwrap();
    assert!(
        problem.message.contains(
            "skill \"hop\" has a set of 5 frames (\"off\"), and pack toy makes at least 8 at a time"
        ),
        "{}",
        problem.message
    );
}

#[tokio::test]
async fn http_and_websocket_do_skills() {
    let server = TestServer::start().await;
    open(&mut server.sessions().await, &["a", "b"]).await;
    let duck =
        |id: &str| json!({"session_id": id, "sequence": 1, "skill": {"name": "duck", "variant": "low"}});
    let asked = json!({"session_ids": ["a"], "frames": 10, "commands": [duck("a")]});
    let call = reqwest::Client::new().post(server.url("/v1/step")).json(&asked);
    let answer: Value = call.send().await.unwrap().json().await.unwrap();
    assert_eq!(
        answer["events"][0]["events"][0]["started"]["definition"], "duck",
        "{answer}"
    );

    let mut socket = Socket::connect(&server).await;
    socket.text(json!({ "open": {} })).await;
    socket.text(json!({ "attach": { "session_ids": ["b"] } })).await;
    socket
        .text(json!({ "command": { "commands": [duck("b")] } }))
        .await;
    for _ in 0..200 {
        if let Say::Events(happened) = socket.said(true).await {
            let first = &happened.sessions[0].events[0].kind;
            assert!(
                matches!(first, Some(Kind::Started(of)) if of.variant == "low"),
                "{first:?}"
            );
            return;
        }
    }
    panic!("nothing happened");
}

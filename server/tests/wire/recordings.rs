//! Recordings of sessions, and their replay.

use http::StatusCode;
use reqwest::Method;
use serde_json::{Value, json};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message as Say;

use crate::common::TestServer;
use crate::common::calls::{Client, drive, options, step, stepped, walk};

/// Frames from one command of a walk to the next.
const BETWEEN: u32 = 12;

async fn open(client: &mut Client, id: &str) -> v1::Session {
    let recorded = v1::SessionOptions {
        record: true,
        ..options(id)
    };
    let sessions = vec![recorded];
    let request = v1::CreateSessionsRequest { sessions };
    let opened = client.create_sessions(request).await.unwrap().into_inner();
    opened.sessions[0].clone()
}

/// Opens a session, which is recorded, and walks with ten commands.
async fn walk_about(client: &mut Client, id: &str) {
    assert!(open(client, id).await.recorded);
    for sequence in 1..=10 {
        let aside = 0.2 * (sequence as f32 - 5.0);
        let commands = vec![walk(id, sequence, (aside, 1.2))];
        stepped(client, step(&[id], BETWEEN, commands)).await;
    }
}

async fn recording(client: &mut Client, id: &str) -> v1::SessionRecording {
    let session_id = id.to_owned();
    let request = v1::GetRecordingRequest { session_id };
    client.get_recording(request).await.unwrap().into_inner()
}

/// The last part of a replay.
async fn replayed(
    client: &mut Client,
    recording: String,
    anyway: bool,
) -> Result<v1::ReplayResponse, Box<Status>> {
    let request = v1::ReplayRequest { recording, anyway };
    let mut parts = client.replay(request).await?.into_inner();
    let mut last = v1::ReplayResponse::default();
    while let Some(part) = parts.message().await? {
        assert!(!last.is_last && part.frames >= last.frames, "{part:?}");
        last = part;
    }
    assert!(last.is_last);
    Ok(last)
}

/// A recording whose lines `change` has changed.
fn changed(lines: &str, mut change: impl FnMut(&mut Value)) -> String {
    let changed = lines.lines().map(|line| {
        let mut line = serde_json::from_str(line).unwrap();
        change(&mut line);
        format!("{line}\n")
    });
    changed.collect()
}

#[tokio::test]
async fn a_recorded_walk_is_equal_when_it_is_played_again() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    walk_about(&mut client, "guard").await;
    assert!(!recording(&mut client, "guard").await.ended);
    let ids = vec!["guard".to_owned()];
    client
        .close_sessions(v1::CloseSessionsRequest { ids })
        .await
        .unwrap();

    let found = recording(&mut client, "guard").await;
    assert_eq!((found.session_id.as_str(), found.ended), ("guard", true));
    let over_http = server.get("/v1/sessions/guard/recording").await;
    assert_eq!(over_http.headers()["content-type"], "application/x-ndjson");
    assert_eq!(over_http.text().await.unwrap(), found.lines);

    let result = replayed(&mut client, found.lines.clone(), false).await.unwrap();
    assert_eq!(
        (result.equal, result.frames, result.commands, result.underruns),
        (true, 120, 10, 0),
        "{result:?}"
    );
    let why = "the recording ends at frame 120 because the session ended";
    assert_eq!((result.difference, result.notes), (None, vec![why.to_owned()]));

    let body = json!({ "recording": found.lines });
    let answer = server.send(Method::POST, "/v1/replay", &body).await;
    let text = answer.text().await.unwrap();
    let last: v1::ReplayResponse = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert!(last.equal && last.frames == 120, "{text}");
}

#[tokio::test]
async fn a_command_that_was_tampered_with_is_found_by_its_frame() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    walk_about(&mut client, "guard").await;
    let lines = recording(&mut client, "guard").await.lines;
    let tampered = changed(&lines, |line| {
        if line["command"]["sequence"] == "6" {
            line["command"]["locomote"]["velocity"]["z"] = json!(0.4);
        }
    });
    assert_ne!(tampered, changed(&lines, |_| {}));
    let result = replayed(&mut client, tampered, false).await.unwrap();
    let difference = result.difference.unwrap();
    assert!(!result.equal);
    // The command came at frame 60, and its plan takes over two frames later.
    assert!((61..=72).contains(&difference.frame), "{difference:?}");
    assert_eq!(difference.field, "root");
    assert_eq!(result.frames + 1, difference.frame);
    assert!(
        difference
            .message
            .contains(&format!("frame {} differs in its root", difference.frame)),
        "{difference:?}"
    );
    // The same lines in another order of their members are equal still.
    let same = changed(&lines, |_| {});
    assert!(replayed(&mut client, same, false).await.unwrap().equal);
}

#[tokio::test]
async fn a_frame_that_was_tampered_with_is_named() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    walk_about(&mut client, "guard").await;
    let lines = recording(&mut client, "guard").await.lines;
    for (field, value) in [
        ("rotations", json!("00000000")),
        ("contacts", json!(200)),
        ("underrun", json!(true)),
    ] {
        let tampered = changed(&lines, |line| {
            if line["frame"]["number"] == 42 {
                line["frame"][field] = value.clone();
            }
        });
        let result = replayed(&mut client, tampered, false).await.unwrap();
        let difference = result.difference.unwrap();
        assert_eq!((difference.frame, difference.field.as_str()), (42, field));
        assert_eq!(result.frames, 41);
    }
}

#[tokio::test]
async fn late_plans_and_underruns_of_a_stream_are_played_again() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, "guard").await;
    let (ask, mut answers) = drive(&mut client, &["guard".to_owned()]).await;
    let mut ticks = 0;
    let mut slow = 0;
    // No plan comes for a while: the character slows down, and goes on once plans come again.
    while ticks < 60 || slow == 0 {
        let answer = answers.message().await.unwrap().unwrap();
        if let Some(Say::Frames(frames)) = answer.message {
            ticks += 1;
            slow += frames.underruns;
            if ticks == 20 {
                server.gate.close();
            }
        }
        assert!(ticks < 600, "no underrun");
    }
    server.gate.open();
    let mut after = 0;
    while after < 60 {
        let answer = answers.message().await.unwrap().unwrap();
        after += u32::from(matches!(answer.message, Some(Say::Frames(_))));
    }
    drop((ask, answers));
    let lines = recording(&mut client, "guard").await.lines;
    let result = replayed(&mut client, lines, false).await.unwrap();
    assert!(result.equal && result.frames >= 120, "{result:?}");
    assert!(result.underruns > 0, "{result:?}");
    assert!(
        result.notes[0].starts_with("the recording has no end"),
        "{:?}",
        result.notes
    );
}

#[tokio::test]
async fn a_recording_of_something_else_is_refused_with_the_reason() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    walk_about(&mut client, "guard").await;
    let lines = recording(&mut client, "guard").await.lines;
    let with = |field: &str, value: &str| {
        changed(&lines, |line| {
            if line["made_with"].is_object() {
                line["made_with"][field] = json!(value);
            }
        })
    };
    for (field, says) in [
        (
            "pack_version",
            "version of the pack is \"else\", and here \"1.2.3\"",
        ),
        (
            "content_hash",
            "content_hash of the pack is \"else\", and here \"sha256:",
        ),
        ("engine", "engine is \"else\", and here"),
        ("server", "server is \"else\", and here"),
    ] {
        let other = with(field, "else");
        let status = replayed(&mut client, other.clone(), false).await.unwrap_err();
        assert_eq!(status.code(), Code::FailedPrecondition);
        assert!(status.message().contains(says), "{}", status.message());
        let reason = status.get_details_error_info().unwrap().reason;
        assert_eq!(reason, "RECORDING_DIFFERS");
        let result = replayed(&mut client, other, true).await.unwrap();
        assert!(result.equal && result.notes[0].contains(says), "{result:?}");
    }
    let newer = lines.replacen("\"troupe_recording\":1", "\"troupe_recording\":2", 1);
    let status = replayed(&mut client, newer, true).await.unwrap_err();
    assert!(status.message().contains("has format 2"), "{}", status.message());
    let status = replayed(&mut client, "{}\n".to_owned(), true).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(
        status.message().starts_with("line 1 of the recording"),
        "{}",
        status.message()
    );
}

#[tokio::test]
async fn sessions_are_recorded_only_if_they_ask_and_have_no_scene() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let plain = v1::CreateSessionsRequest {
        sessions: vec![options("plain")],
    };
    let opened = client.create_sessions(plain).await.unwrap().into_inner();
    assert!(!opened.sessions[0].recorded);
    let answer = server.get("/v1/sessions/plain/recording").await;
    assert_eq!(answer.status(), StatusCode::NOT_FOUND);
    let body: Value = answer.json().await.unwrap();
    assert_eq!(body["error"]["reason"], "UNKNOWN_RECORDING");

    let scene = json!({ "scene": { "ground": 0.0 } });
    let put = server.send(Method::PUT, "/v1/scenes/yard", &scene).await;
    assert_eq!(put.status(), StatusCode::OK, "{:?}", put.text().await);
    let resident = json!({ "sessions": [{ "scene": "yard", "record": true }] });
    let answer = server.send(Method::POST, "/v1/sessions", &resident).await;
    assert_eq!(answer.status(), StatusCode::BAD_REQUEST);
    let body: Value = answer.json().await.unwrap();
    assert_eq!(body["error"]["field"], "sessions[0].record");
}

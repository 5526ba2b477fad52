//! Streams against a server by script.

use glam::Vec3;

use super::*;
use crate::Pack;
use crate::live::options::SessionOptions;
use crate::live::testing::{block, problem, scripted};

fn from_server(message: FromServer) -> v1::DriveResponse {
    v1::DriveResponse {
        message: Some(message),
    }
}

fn tick(number: u64, slots: &[u32]) -> v1::DriveResponse {
    from_server(FromServer::Frames(v1::DriveFrames {
        tick: number,
        blocks: vec![block(slots, 1, vec![number; slots.len()])],
        dropped_ticks: 4,
        underruns: 1,
        held: slots.iter().map(|&slot| held(slot)).collect(),
    }))
}

fn held(slot: u32) -> v1::HeldObject {
    v1::HeldObject {
        slot,
        instance: format!("cup-{slot}"),
        ..v1::HeldObject::default()
    }
}

fn attached(ids: &[(&str, u32)]) -> v1::DriveResponse {
    let sessions = ids.iter().map(|&(id, slot)| v1::Attached {
        session_id: id.to_owned(),
        slot,
    });
    from_server(FromServer::Attached(v1::DriveAttached {
        sessions: sessions.collect(),
        problems: Vec::new(),
    }))
}

fn session_problem(slot: u32, id: &str, reason: &str) -> v1::SessionProblem {
    v1::SessionProblem {
        slot,
        session_id: id.to_owned(),
        problem: Some(problem(reason)),
    }
}

fn closing(reason: &str) -> v1::DriveResponse {
    from_server(FromServer::Closing(v1::DriveClosing {
        reason: Some(problem(reason)),
    }))
}

/// A stream with sessions a, b, ..., on which the server sends all of `script`.
async fn stream(every_tick: bool, sessions: &[&str], script: Vec<v1::DriveResponse>) -> Drive {
    let (client, pack, server) = scripted().await;
    server.lock().unwrap().stream = script;
    let options = sessions
        .iter()
        .map(|&id| SessionOptions::new().id(id))
        .collect::<Vec<_>>();
    let sessions = client.open_sessions(&pack, &options).await.unwrap();
    let options = DriveOptions {
        every_tick,
        reconnect: None,
        ..DriveOptions::default()
    };
    let mut drive = client.drive(options).await.unwrap();
    drive.attach(sessions).await.unwrap();
    drive
}

/// The numbers of the ticks until the stream ends, and how it ends.
async fn all(drive: &mut Drive) -> (Vec<u64>, Vec<DriveEvent>, Result<(), ClientError>) {
    let (mut ticks, mut events) = (Vec::new(), Vec::new());
    loop {
        match drive.next().await {
            Ok(Some(update)) => {
                ticks.extend(update.tick.map(|t| t.number()));
                events.extend(update.events);
            }
            Ok(None) => return (ticks, events, Ok(())),
            Err(error) => return (ticks, events, Err(error)),
        }
    }
}

#[tokio::test]
async fn every_tick_comes_in_order_where_asked_for() {
    let script = vec![
        attached(&[("a", 7)]),
        tick(0, &[7]),
        tick(1, &[7]),
        tick(2, &[7]),
        closing("CLIENT_DONE"),
    ];
    let mut drive = stream(true, &["a"], script).await;
    let (ticks, events, end) = all(&mut drive).await;
    assert_eq!(ticks, [0, 1, 2]);
    assert!(matches!(&events[..], [DriveEvent::Attached { session }] if session == "a"));
    end.unwrap();
    assert!(drive.next().await.unwrap().is_none(), "it stays ended");
}

#[tokio::test]
async fn a_late_look_gives_the_newest_and_counts_the_rest() {
    let mut script = vec![attached(&[("a", 7)])];
    script.extend((0..5).map(|number| tick(number, &[7])));
    script.push(closing("CLIENT_DONE"));
    let mut drive = stream(false, &["a"], script).await;
    // All ticks have come meanwhile.
    tokio::time::sleep(Duration::from_millis(300)).await;
    let mut given = 0;
    let mut dropped = 0;
    let mut newest = 0;
    while let Some(update) = drive.next().await.unwrap() {
        if let Some(tick) = update.tick {
            given += 1;
            (dropped, newest) = (tick.dropped(), tick.number());
            let (id, frames) = tick.characters().next().unwrap();
            assert_eq!((id, frames.last().unwrap().root.x), ("a", 7.0));
        }
    }
    assert_eq!(newest, 4);
    // The server dropped four, and the client skipped the others.
    assert_eq!(dropped, 4 + 5 - given);
    assert!(given < 5, "it did catch up");
}

#[tokio::test]
async fn sessions_come_back_when_they_leave() {
    let not_taken = from_server(FromServer::Attached(v1::DriveAttached {
        sessions: Vec::new(),
        problems: vec![
            session_problem(0, "b", "SESSION_BUSY"),
            session_problem(0, "c", "SESSION_EXPIRED"),
        ],
    }));
    let left = from_server(FromServer::Left(v1::DriveLeft {
        sessions: vec![session_problem(7, "a", "DETACHED")],
    }));
    let script = vec![
        attached(&[("a", 7)]),
        not_taken,
        tick(0, &[7]),
        left,
        tick(1, &[7]),
        closing("DRAINING"),
    ];
    let mut drive = stream(true, &["a", "b", "c"], script).await;
    let (ticks, events, end) = all(&mut drive).await;
    assert_eq!(ticks, [0, 1], "a tick of one who has just left is no error");
    let back = events.iter().filter_map(|event| match event {
        DriveEvent::NotAttached { id, session, problem } | DriveEvent::Left { id, session, problem } => {
            Some((id.as_str(), session.is_some(), problem.kind.clone()))
        }
        _ => None,
    });
    assert_eq!(
        back.collect::<Vec<_>>(),
        [
            ("b", true, ProblemKind::SessionBusy),
            ("c", false, ProblemKind::SessionExpired),
            ("a", true, ProblemKind::Detached),
        ]
    );
    let error = end.unwrap_err();
    assert!(
        matches!(&error, ClientError::StreamEnded(why) if why.kind == ProblemKind::Draining),
        "{error}"
    );
    assert!(drive.into_sessions().is_empty());
}

#[tokio::test]
async fn a_stream_that_breaks_off_is_an_error_and_the_sessions_are_kept() {
    let (client, pack, server) = scripted().await;
    let session = client
        .session(&pack, &SessionOptions::new().id("a"))
        .await
        .unwrap();
    server.lock().unwrap().stream = vec![attached(&[("a", 1)]), v1::DriveResponse::default()];
    let mut drive = client.drive(DriveOptions::default()).await.unwrap();
    drive.attach([session]).await.unwrap();
    let (_, _, end) = all(&mut drive).await;
    assert!(matches!(end, Err(ClientError::Answer(_))), "{end:?}");
    assert_eq!(drive.into_sessions()[0].id(), "a");
}

#[tokio::test]
async fn events_come_with_the_next_call_and_held_objects_with_the_tick() {
    let done = v1::SessionEvent {
        frame: 7,
        kind: Some(v1::session_event::Kind::Done(v1::InteractionDone {
            instance: "cup".to_owned(),
        })),
    };
    let events = from_server(FromServer::Events(v1::DriveEvents {
        sessions: vec![v1::SessionEvents {
            slot: 3,
            session_id: "b".to_owned(),
            events: vec![done.clone()],
            events_dropped: 2,
        }],
    }));
    let script = vec![
        attached(&[("a", 1), ("b", 3)]),
        events,
        tick(0, &[1, 3]),
        closing("CLIENT_DONE"),
    ];
    let mut drive = stream(true, &["a", "b"], script).await;
    let (mut happened, mut held) = (Vec::new(), Vec::new());
    while let Ok(Some(update)) = drive.next().await {
        for event in update.events {
            if let DriveEvent::Happened {
                session,
                events,
                dropped,
            } = event
            {
                happened.push((session, events, dropped));
            }
        }
        if let Some(tick) = update.tick {
            held.extend(
                tick.held()
                    .map(|(id, held)| (id.to_owned(), held.instance.clone())),
            );
        }
    }
    assert_eq!(happened, [("b".to_owned(), vec![done], 2)]);
    let pair = |id: &str, cup: &str| (id.to_owned(), cup.to_owned());
    assert_eq!(held, [pair("a", "cup-1"), pair("b", "cup-3")]);
}

#[tokio::test]
async fn intents_go_with_the_next_look() {
    let (client, pack, server) = scripted().await;
    let session = client
        .session(&pack, &SessionOptions::new().id("a"))
        .await
        .unwrap();
    let refused = v1::CommandResult {
        session_id: "a".to_owned(),
        sequence: 1,
        status: v1::CommandStatus::Refused.into(),
        problem: Some(problem("UNKNOWN_STYLE")),
    };
    server.lock().unwrap().stream = vec![from_server(FromServer::Commands(v1::CommandResponse {
        results: vec![refused],
    }))];
    let mut drive = client.drive(DriveOptions::default()).await.unwrap();
    drive.attach([session]).await.unwrap();
    *drive.intent_mut("a").unwrap() = Locomotion::walk(Vec3::Z);
    assert!(drive.intent_mut("b").is_none());
    let update = drive.next().await.unwrap().unwrap();
    assert!(matches!(&update.events[..], [DriveEvent::Refused { session, .. }] if session == "a"));
    let sessions = drive.close().await.unwrap();
    assert_eq!(sessions.len(), 1);
    let asked = std::mem::take(&mut server.lock().unwrap().asked);
    let kinds = asked.iter().map(|ask| match ask.message.as_ref().unwrap() {
        Ask::Open(open) => format!("open {}", open.rate_hz),
        Ask::Attach(attach) => format!("attach {:?}", attach.session_ids),
        Ask::Detach(_) => "detach".to_owned(),
        Ask::Command(command) => format!("command {}", command.commands[0].sequence),
    });
    assert_eq!(
        kinds.collect::<Vec<_>>(),
        ["open 30", "attach [\"a\"]", "command 1"]
    );
}

/// The position of the session after the stream broke.
fn resumed(id: &str, frame: u64, last_sequence: u64) -> v1::ResumeSessionsResponse {
    v1::ResumeSessionsResponse {
        sessions: vec![v1::ResumedSession {
            session: Some(v1::Session {
                id: id.to_owned(),
                frame,
                last_sequence,
                ..v1::Session::default()
            }),
            restored: true,
            restored_frame: frame - 1,
        }],
        problems: Vec::new(),
    }
}

#[tokio::test]
async fn a_stream_that_breaks_is_opened_again_behind_the_last_frame() {
    let (client, pack, server) = scripted().await;
    {
        let mut server = server.lock().unwrap();
        server.stream = vec![attached(&[("a", 0)]), tick(7, &[0]), closing("DRAINING")];
        server.resumed = Some(resumed("a", 8, 0));
    }
    let sessions = client
        .open_sessions(&pack, &[SessionOptions::new().id("a")])
        .await
        .unwrap();
    let mut drive = client
        .drive(DriveOptions {
            every_tick: true,
            ..DriveOptions::default()
        })
        .await
        .unwrap();
    drive.attach(sessions).await.unwrap();
    drive.intent_mut("a").unwrap().velocity = Vec3::Z;
    let mut ticks = Vec::new();
    let mut events = Vec::new();
    while !events
        .iter()
        .any(|event| matches!(event, DriveEvent::Resumed { .. }))
    {
        let update = drive.next().await.unwrap().unwrap();
        ticks.extend(update.tick.map(|tick| tick.number()));
        events.extend(update.events);
    }
    assert_eq!(ticks, [7]);
    assert!(
        matches!(
            events.last(),
            Some(DriveEvent::Resumed { session, frame: 8, restored: true, lost_commands: 1 }) if session == "a"
        ),
        "{events:?}"
    );
    // The client sent the last frame that it saw, and takes the session onto the new stream.
    let asked = server.lock().unwrap().resumes.clone();
    let [one] = asked[0].sessions.as_slice() else {
        panic!("{asked:?}")
    };
    assert_eq!((&*one.session_id, one.frame), ("a", Some(7)));
    assert!(one.pose.as_ref().unwrap().pose.is_some());
    assert!(drive.session("a").is_some());
}

/// The ticks and events of a stream of session a until tick 8.
async fn broken_off(client: &Client, pack: &Pack) -> (Vec<u64>, Vec<DriveEvent>) {
    let sessions = client
        .open_sessions(pack, &[SessionOptions::new().id("a")])
        .await
        .unwrap();
    let options = DriveOptions {
        every_tick: true,
        ..DriveOptions::default()
    };
    let mut drive = client.drive(options).await.unwrap();
    drive.attach(sessions).await.unwrap();
    let (mut ticks, mut events) = (Vec::new(), Vec::new());
    while !ticks.contains(&8) {
        let update = drive.next().await.unwrap().unwrap();
        ticks.extend(update.tick.map(|tick| tick.number()));
        events.extend(update.events);
    }
    (ticks, events)
}

#[tokio::test]
async fn a_stream_whose_last_session_moved_follows_it() {
    let (client, pack, server) = scripted().await;
    let elsewhere = v1::Problem {
        allowed: "b:2".to_owned(),
        ..problem("SESSION_ELSEWHERE")
    };
    {
        let mut server = server.lock().unwrap();
        let left = from_server(FromServer::Left(v1::DriveLeft {
            sessions: vec![session_problem(0, "a", "SESSION_MOVED")],
        }));
        server.stream = vec![attached(&[("a", 0)]), tick(7, &[0]), left];
        server.later_streams = [vec![attached(&[("a", 0)]), tick(8, &[0])]].into();
        server.not_resumed = [v1::ResumeSessionsResponse {
            sessions: Vec::new(),
            problems: vec![v1::SessionProblem {
                problem: Some(elsewhere),
                ..session_problem(0, "a", "")
            }],
        }]
        .into();
        server.resumed = Some(resumed("a", 8, 0));
    }
    let (ticks, events) = broken_off(&client, &pack).await;
    assert_eq!(ticks, [7, 8]);
    assert!(
        !events
            .iter()
            .any(|event| matches!(event, DriveEvent::Left { .. })),
        "{events:?}"
    );
    // The first server names the other one. Session and stream go on there.
    let b = Some("b:2".to_owned());
    assert_eq!(server.lock().unwrap().servers, [None, None, b.clone(), b]);
}

#[tokio::test]
async fn the_last_frame_is_known_after_a_stream_without_frames() {
    let (client, pack, server) = scripted().await;
    {
        let mut server = server.lock().unwrap();
        server.stream = vec![attached(&[("a", 0)]), tick(7, &[0]), closing("DRAINING")];
        server.later_streams = [
            vec![closing("DRAINING")],
            vec![attached(&[("a", 0)]), tick(8, &[0])],
        ]
        .into();
        server.resumed = Some(resumed("a", 8, 0));
    }
    broken_off(&client, &pack).await;
    let resumes = &server.lock().unwrap().resumes;
    let frames: Vec<_> = resumes.iter().map(|one| one.sessions[0].frame).collect();
    assert_eq!(frames, [Some(7), Some(7)]);
}

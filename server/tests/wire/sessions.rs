//! Sessions: opened, commanded, stepped, closed.

use std::time::Duration;

use reqwest::{Method, StatusCode};
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::calls::{frames_of, ids, locomote, open, options, step, stepped, walk};
use crate::common::{JOINTS, TestServer, keyframe};

#[tokio::test]
async fn a_session_is_opened_described_listed_and_closed() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let wanted = v1::SessionOptions {
        position: Some(v1::Vec3 {
            x: 2.0,
            y: 5.0,
            z: -1.0,
        }),
        heading: 1.25,
        ttl_ms: Some(5000),
        style: "sneak".into(),
        ..options("guard-1")
    };
    let request = v1::CreateSessionsRequest {
        sessions: vec![wanted, v1::SessionOptions::default()],
    };
    let opened = client
        .create_sessions(request)
        .await
        .unwrap()
        .into_inner()
        .sessions;
    let guard = &opened[0];
    assert_eq!(
        (
            guard.id.as_str(),
            guard.pack.as_str(),
            guard.style.as_str(),
            guard.seed
        ),
        ("guard-1", "toy", "sneak", 7)
    );
    assert_eq!((guard.frame, guard.clock()), (0, v1::Clock::Free));
    assert_eq!((guard.ttl_ms, guard.expires_in_ms), (5000, 5000));
    // The height is the style's.
    let position = guard.position.unwrap();
    assert_eq!((position.x, position.y, position.z), (2.0, 0.9, -1.0));
    assert!((guard.heading - 1.25).abs() < 1e-4);
    let other = &opened[1];
    assert!(other.id.len() >= 16, "{}", other.id);
    assert_eq!((other.style.as_str(), other.ttl_ms), ("normal", 60_000));

    let described = client.get_session(v1::GetSessionRequest { id: "guard-1".into() });
    assert_eq!(&described.await.unwrap().into_inner(), guard);
    let over_http: v1::Session = server.get("/v1/sessions/guard-1").await.json().await.unwrap();
    assert_eq!(&over_http, guard);

    let gone = v1::CloseSessionsRequest {
        ids: vec!["guard-1".into(), "never-was".into()],
    };
    assert_eq!(client.close_sessions(gone).await.unwrap().into_inner().closed, 1);
    let path = format!("/v1/sessions/{}", other.id);
    for closed in [1, 0] {
        let response = server.send(Method::DELETE, &path, &()).await;
        let answer: v1::CloseSessionsResponse = response.json().await.unwrap();
        assert_eq!(answer.closed, closed);
    }
    assert_eq!(server.get(&path).await.status(), StatusCode::NOT_FOUND);
    server.metric("troupe_sessions_active{model=\"toy\"", "0").await;
    server
        .metric(
            "troupe_session_evictions_total{model=\"toy\",version=\"1.2.3\",reason=\"closed\"}",
            "2",
        )
        .await;
}

#[tokio::test]
async fn sessions_are_opened_all_or_none() {
    let server = TestServer::start_with(|config| {
        config.max_sessions = 5;
        config.fixed.keyless_share = 1;
    })
    .await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    let mut try_to_open = async |ids: &[&str]| {
        let sessions = ids.iter().map(|id| options(id)).collect();
        let request = v1::CreateSessionsRequest { sessions };
        client.create_sessions(request).await.unwrap_err()
    };
    for (ids, field) in [(["c", "a"], "sessions[1].id"), (["c", "c"], "sessions[1].id")] {
        let status = try_to_open(&ids).await;
        assert_eq!(status.code(), Code::AlreadyExists);
        let info = status.get_details_error_info().unwrap();
        assert_eq!(
            (info.reason.as_str(), info.metadata["field"].as_str()),
            ("SESSION_EXISTS", field)
        );
    }
    let status = try_to_open(&["c", "d", "e", "f"]).await;
    assert_eq!(status.code(), Code::ResourceExhausted);
    let info = status.get_details_error_info().unwrap();
    assert_eq!(
        (info.reason.as_str(), info.metadata["allowed"].as_str()),
        ("TOO_MANY_SESSIONS", "at most 5")
    );
    let hint = status.get_details_retry_info().unwrap().retry_delay;
    assert_eq!(hint, Some(Duration::from_secs(1)));
    assert_eq!(
        server.handle.service().sessions().open(),
        2,
        "none of the refused are open"
    );
    open(&mut client, &["c", "d", "e"]).await;
}

#[tokio::test]
async fn lists_come_in_pages_by_id() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let mut wanted = ids("s", 25);
    open(&mut client, &wanted).await;
    wanted.sort();
    let (mut found, mut pages, mut token) = (Vec::new(), 0, String::new());
    loop {
        let path = format!("/v1/sessions?page_size=10&page_token={token}");
        let page: v1::ListSessionsResponse = server.get(&path).await.json().await.unwrap();
        assert_eq!(page.total, 25);
        found.extend(page.sessions.into_iter().map(|session| session.id));
        pages += 1;
        token = page.next_page_token;
        if token.is_empty() {
            break;
        }
        // What is opened before the page does not shift it.
        open(&mut client, &[format!("a-{pages}")]).await;
        let close = v1::CloseSessionsRequest {
            ids: vec![format!("a-{pages}")],
        };
        client.close_sessions(close).await.unwrap();
    }
    assert_eq!((found, pages), (wanted, 3));
}

#[tokio::test]
async fn steps_move_characters_as_commanded() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("c", 3);
    open(&mut client, &names).await;
    // The middle one is left standing.
    let commands = vec![walk("c-0", 1, (0.0, 1.2)), walk("c-2", 1, (0.6, 0.0))];
    let request = v1::StepRequest {
        return_positions: true,
        ..step(&names, 60, commands)
    };
    let answer = client.step(request).await.unwrap().into_inner();
    assert!(answer.waited_us > 0 && answer.total_us >= answer.waited_us);
    assert!(
        answer
            .command_results
            .iter()
            .all(|r| r.status() == v1::CommandStatus::Accepted)
    );
    let block = &answer.blocks[0];
    assert_eq!(
        (block.pack.as_str(), block.slots.as_slice()),
        ("toy", [0, 1, 2].as_slice())
    );
    assert_eq!(
        (block.frame_count, block.first_frames.as_slice()),
        (60, [1, 1, 1].as_slice())
    );
    assert_eq!(block.root_positions.len(), 3 * 60 * 3);
    assert_eq!(block.rotations.len(), 3 * 60 * JOINTS * 4);
    assert_eq!(block.positions.len(), 3 * 60 * JOINTS * 3);
    assert_eq!(block.contacts.len(), 3 * 60);
    let end = |character: usize| &block.root_positions[(character * 60 + 59) * 3..][..3];
    assert!(end(0)[2] > 1.2 && end(0)[0].abs() < 0.3, "{:?}", end(0));
    assert!(end(1)[0].abs() < 0.1 && end(1)[2].abs() < 0.1, "{:?}", end(1));
    assert!(end(2)[0] > 0.4, "{:?}", end(2));

    let get = v1::GetSessionRequest { id: "c-0".into() };
    let session = client.get_session(get).await.unwrap().into_inner();
    assert_eq!((session.frame, session.last_sequence), (60, 1));
    assert_eq!(session.clock(), v1::Clock::Free);
    let stats = session.stats.unwrap();
    assert!(
        stats.plans_for_command >= 1 && stats.plans_for_interval >= 3,
        "{stats:?}"
    );
    assert_eq!((stats.late_plans, stats.underruns, stats.failed_plans), (0, 0, 0));
    server
        .metric("troupe_frames_sent_total{model=\"toy\"", "180")
        .await;
}

/// A walk with turns, style and gait changes, one session, taken in steps of the given frames.
async fn scripted(
    client: &mut crate::common::calls::Client,
    others: usize,
    steps: &[u32],
) -> (Vec<f32>, Vec<f32>) {
    let names: Vec<String> = std::iter::once("hero".to_owned())
        .chain(ids("extra", others))
        .collect();
    open(client, &names).await;
    let mut script = Vec::new();
    for (sequence, (at, velocity, style)) in [
        (0, (0.0, 1.2), ""),
        (31, (0.8, 0.8), "sneak"),
        (32, (-1.0, 0.0), ""),
        (75, (0.0, 0.0), "normal"),
    ]
    .into_iter()
    .enumerate()
    {
        let mut command = walk("hero", sequence as u64 + 1, velocity);
        locomote(&mut command).style = style.into();
        script.push((at, command));
    }
    let (mut roots, mut rotations, mut frame) = (Vec::new(), Vec::new(), 0);
    for &frames in steps {
        let due = script.extract_if(.., |(at, _)| *at < frame + frames);
        let mut commands: Vec<v1::Command> = due
            .map(|(at, command)| v1::Command {
                at_frame: Some(at.into()),
                ..command
            })
            .collect();
        // Only the newest may wait for its frame, so the steps end where commands begin.
        assert!(commands.len() <= 1);
        for (index, name) in names.iter().enumerate().skip(1) {
            commands.push(walk(name, u64::from(frame) + 1, (0.1 * index as f32, 0.5)));
        }
        let block = stepped(client, step(&names, frames, commands)).await;
        let (more_roots, more_rotations) = frames_of(&block, 0);
        roots.extend(more_roots);
        rotations.extend(more_rotations);
        frame += frames;
    }
    let close = v1::CloseSessionsRequest { ids: names };
    client.close_sessions(close).await.unwrap();
    (roots, rotations)
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_are_the_same_alone_among_others_and_however_they_are_split() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let alone = scripted(&mut client, 0, &[31, 1, 43, 45]).await;
    assert_eq!(alone.0.len(), 120 * 3);
    assert!(alone.0.iter().any(|x| x.abs() > 0.8), "it went somewhere");
    assert_eq!(scripted(&mut client, 20, &[31, 1, 43, 45]).await, alone);
    let single: Vec<u32> = vec![1; 120];
    assert_eq!(scripted(&mut client, 3, &single).await, alone);
    assert_eq!(scripted(&mut client, 0, &[7, 13, 11, 1, 20, 23, 45]).await, alone);
}

#[tokio::test]
async fn sequence_numbers_make_late_and_repeated_commands_harmless() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    let commands = [5, 5, 3, 6]
        .map(|sequence| walk("a", sequence, (0.0, sequence as f32 * 0.1)))
        .to_vec();
    let request = v1::CommandRequest { commands };
    let results = client.command(request).await.unwrap().into_inner().results;
    let statuses: Vec<_> = results
        .iter()
        .map(|result| (result.sequence, result.status()))
        .collect();
    use v1::CommandStatus::{Accepted, Late, Repeated};
    assert_eq!(statuses, [(5, Accepted), (5, Repeated), (3, Late), (6, Accepted)]);
    let get = v1::GetSessionRequest { id: "a".into() };
    assert_eq!(
        client.get_session(get).await.unwrap().into_inner().last_sequence,
        6
    );
}

#[tokio::test]
async fn a_priority_is_kept_and_changes_nothing_of_what_a_session_does() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let sessions = vec![
        options("a"),
        v1::SessionOptions {
            priority: Some(0.0),
            ..options("b")
        },
    ];
    let opened = client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap()
        .into_inner()
        .sessions;
    assert_eq!((opened[0].priority, opened[1].priority), (0.5, 0.0));
    // Both walk. Only one gets a new priority, while another command waits for its frame.
    let turn = |id: &str| v1::Command {
        at_frame: Some(40),
        ..walk(id, 2, (1.0, 0.0))
    };
    for (frames, commands) in [
        (10, vec![walk("a", 1, (0.0, 1.2)), walk("b", 1, (0.0, 1.2))]),
        (5, vec![turn("a"), turn("b")]),
    ] {
        stepped(&mut client, step(&["a", "b"], frames, commands)).await;
    }
    let important = |sequence, priority| v1::Command {
        session_id: "a".into(),
        sequence,
        priority: Some(priority),
        ..v1::Command::default()
    };
    let commands = vec![important(3, 1.0), important(3, 0.1), important(2, 0.2)];
    let request = v1::CommandRequest { commands };
    let results = client.command(request).await.unwrap().into_inner().results;
    use v1::CommandStatus::{Accepted, Late, Repeated};
    let statuses: Vec<_> = results.iter().map(v1::CommandResult::status).collect();
    assert_eq!(statuses, [Accepted, Repeated, Late]);

    // One plan more would show in the frames.
    let block = stepped(&mut client, step(&["a", "b"], 60, vec![])).await;
    assert_eq!(frames_of(&block, 0), frames_of(&block, 1));
    let of = |id: &str| v1::GetSessionRequest { id: id.into() };
    let a = client.get_session(of("a")).await.unwrap().into_inner();
    let b = client.get_session(of("b")).await.unwrap().into_inner();
    assert_eq!((a.priority, a.last_sequence, b.last_sequence), (1.0, 3, 2));
}

#[tokio::test]
async fn all_conventions_show_the_same_motion() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    // Forward at 1.2 m/s and a place 1 m to the left, each in its own words.
    type Words = (v1::Convention, [f32; 3], [f32; 3], fn(&[f32]) -> [f32; 3]);
    let words: [Words; 4] = [
        (v1::Convention::Native, [1.0, 0.0, 0.0], [0.0, 0.0, 1.2], |p| {
            [p[0], p[1], p[2]]
        }),
        (
            v1::Convention::Unreal,
            [0.0, -100.0, 0.0],
            [120.0, 0.0, 0.0],
            |p| [-p[1] / 100.0, p[2] / 100.0, p[0] / 100.0],
        ),
        (v1::Convention::Unity, [-1.0, 0.0, 0.0], [0.0, 0.0, 1.2], |p| {
            [-p[0], p[1], p[2]]
        }),
        (v1::Convention::Ros, [0.0, 1.0, 0.0], [1.2, 0.0, 0.0], |p| {
            [p[1], p[2], p[0]]
        }),
    ];
    let vector = |[x, y, z]: [f32; 3]| Some(v1::Vec3 { x, y, z });
    let mut native: Option<Vec<f32>> = None;
    for (index, (convention, place, velocity, back)) in words.into_iter().enumerate() {
        let id = format!("c-{index}");
        let wanted = v1::SessionOptions {
            convention: convention.into(),
            position: vector(place),
            ..options(&id)
        };
        let sessions = vec![wanted];
        client
            .create_sessions(v1::CreateSessionsRequest { sessions })
            .await
            .unwrap();
        let mut command = walk(&id, 1, (0.0, 0.0));
        locomote(&mut command).velocity = vector(velocity);
        let block = stepped(&mut client, step(&[&id], 45, vec![command])).await;
        let roots: Vec<f32> = block.root_positions.chunks(3).flat_map(back).collect();
        assert!(roots[134] > 0.8, "{convention:?}: {:?}", &roots[132..]);
        let native = native.get_or_insert_with(|| roots.clone());
        for (a, b) in roots.iter().zip(native.iter()) {
            assert!((a - b).abs() < 1e-4, "{convention:?}");
        }
    }
}

#[tokio::test]
async fn rates_of_50_and_60_hz_are_in_between() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b", "c"]).await;
    let mut ends = Vec::new();
    for (id, rate_hz) in [("a", 30), ("b", 50), ("c", 60)] {
        let request = v1::StepRequest {
            rate_hz,
            ..step(&[id], rate_hz, vec![walk(id, 1, (0.0, 1.0))])
        };
        let block = stepped(&mut client, request).await;
        let last = block.root_positions.len() - 3;
        ends.push(block.root_positions[last..].to_vec());
        let session = client.get_session(v1::GetSessionRequest { id: id.into() });
        assert_eq!(
            session.await.unwrap().into_inner().frame,
            30,
            "a second is 30 frames"
        );
    }
    for end in &ends {
        assert!(
            end.iter().zip(&ends[0]).all(|(a, b)| (a - b).abs() < 1e-3),
            "{ends:?}"
        );
    }
}

#[tokio::test]
async fn a_session_may_begin_in_the_middle_of_a_movement() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let context: Vec<v1::Keyframe> = (0..4).map(|frame| keyframe(3.0, 0.04 * frame as f32)).collect();
    let sessions = vec![v1::SessionOptions {
        context,
        ..options("mover")
    }];
    let opened = client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
    let position = opened.into_inner().sessions[0].position.unwrap();
    assert_eq!((position.x, position.z), (3.0, 0.12));
    let block = stepped(
        &mut client,
        step(&["mover"], 30, vec![walk("mover", 1, (0.0, 1.2))]),
    )
    .await;
    let (roots, _) = frames_of(&block, 0);
    assert!((roots[0] - 3.0).abs() < 0.1 && roots[89] > 0.7, "{roots:?}");
}

#[tokio::test]
async fn a_step_serves_those_that_it_can() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    let other = v1::SessionOptions {
        pack: "other".into(),
        ..options("o")
    };
    let sessions = vec![other];
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
    let request = step(&["a", "ghost", "o", "b"], 2, vec![walk("ghost", 1, (0.0, 1.0))]);
    let answer = client.step(request).await.unwrap().into_inner();
    let slots: Vec<_> = answer
        .blocks
        .iter()
        .map(|block| (block.pack.as_str(), block.slots.clone()))
        .collect();
    assert_eq!(slots, [("toy", vec![0, 3]), ("other", vec![2])]);
    let problem = &answer.problems[0];
    assert_eq!(
        (answer.problems.len(), problem.slot, problem.session_id.as_str()),
        (1, 1, "ghost")
    );
    let why = problem.problem.as_ref().unwrap();
    assert_eq!(
        (why.reason.as_str(), why.field.as_str()),
        ("UNKNOWN_SESSION", "session_ids[1]")
    );
    let refused = &answer.command_results[0];
    assert_eq!(refused.status(), v1::CommandStatus::Refused);
    assert_eq!(refused.problem.as_ref().unwrap().reason, "UNKNOWN_SESSION");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_has_one_clock_at_a_time_and_loses_no_frame_to_a_caller_who_left() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    server.gate.close();
    // It needs a plan within a second, and there is none.
    let long = step(&["a"], 60, vec![walk("a", 1, (0.0, 1.0))]);
    let mut blocked_client = client.clone();
    let blocked = tokio::spawn(async move { blocked_client.step(long).await });
    server.metric("troupe_batch_size_count{model=\"toy\"", "1").await;
    let status = client.step(step(&["a"], 1, vec![])).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert_eq!(status.get_details_error_info().unwrap().reason, "SESSION_BUSY");
    let response = server
        .send(Method::POST, "/v1/step", &step(&["a"], 1, vec![]))
        .await;
    assert_eq!(response.status(), StatusCode::CONFLICT);
    assert_eq!(
        response.json::<ErrorBody>().await.unwrap().error.reason,
        "SESSION_BUSY"
    );

    blocked.abort();
    server
        .metric(r#"troupe_requests_total{rpc="Step",code="CANCELLED"}"#, "1")
        .await;
    server.gate.open();
    let get = v1::GetSessionRequest { id: "a".into() };
    let before = client.get_session(get).await.unwrap().into_inner();
    assert_eq!(before.clock(), v1::Clock::Free);
    let block = stepped(&mut client, step(&["a"], 1, vec![])).await;
    // The frame that it was on its way to is finished first.
    assert_eq!(block.first_frames, [before.frame + 2]);
}

#[tokio::test]
async fn plans_that_fail_end_a_step_with_their_error_and_the_session_recovers() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a"]).await;
    server.gate.set_broken(true);
    let status = client.step(step(&["a"], 60, vec![])).await.unwrap_err();
    assert_eq!(status.code(), Code::Internal, "{status:?}");
    assert!(status.message().contains("set to fail"), "{status:?}");
    server.gate.set_broken(false);
    stepped(&mut client, step(&["a"], 60, vec![])).await;
    let get = v1::GetSessionRequest { id: "a".into() };
    let stats = client.get_session(get).await.unwrap().into_inner().stats.unwrap();
    assert!(stats.failed_plans >= 3, "{stats:?}");
    let name = "troupe_failed_plans_total{model=\"toy\"";
    server.metric(name, &stats.failed_plans.to_string()).await;
}

#[tokio::test]
async fn small_batches_delay_a_step_refuse_no_plan_and_change_nothing() {
    let quiet = TestServer::start().await;
    let busy = TestServer::start_with(|config| {
        config.fixed.max_characters_per_request = 2;
        config.fixed.max_queued_characters = Some(2);
        config.max_batch = 2;
    })
    .await;
    busy.gate.set_row_time(Duration::from_micros(500));
    let names = ids("c", 40);
    let mut blocks = Vec::new();
    for server in [&quiet, &busy] {
        let mut client = server.sessions().await;
        open(&mut client, &names).await;
        let commands = names.iter().map(|id| walk(id, 1, (0.3, 0.9))).collect();
        blocks.push(stepped(&mut client, step(&names, 40, commands)).await);
    }
    // Far more wait than calls would have room for.
    let refused = "troupe_rejections_total{model=\"toy\",version=\"1.2.3\",reason=\"queue_full\"} 0";
    let full = "troupe_dispatch_total{model=\"toy\",version=\"1.2.3\",reason=\"full\"} 0";
    let text = busy.handle.service().telemetry().render();
    assert!(text.contains(refused) && !text.contains(full), "{text}");
    assert_eq!(blocks[0], blocks[1]);
}

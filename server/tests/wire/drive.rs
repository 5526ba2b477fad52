//! Streams over gRPC: sessions driven by the server's clock, and every way in which a stream may
//! end.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Streaming};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Say;

use crate::common::calls::{Client, ids, open, options, start_drive, step, walk};
use crate::common::{JOINTS, TestServer, robot};

/// Both ends of a stream.
struct Drive {
    ask: mpsc::Sender<v1::DriveRequest>,
    answers: Streaming<v1::DriveResponse>,
}

impl Drive {
    async fn start(client: &mut Client) -> Self {
        let (ask, answers) = start_drive(client).await;
        Self { ask, answers }
    }

    /// A stream with those sessions, and their slots.
    async fn with(client: &mut Client, opened: v1::DriveOpen, ids: &[String]) -> (Self, Vec<u32>) {
        let mut drive = Self::start(client).await;
        drive.say(Ask::Open(opened)).await;
        let session_ids = ids.to_vec();
        drive.say(Ask::Attach(v1::DriveAttach { session_ids })).await;
        let attached = drive.attached().await;
        assert!(attached.problems.is_empty(), "{attached:?}");
        let slots = attached.sessions.iter().map(|session| session.slot).collect();
        (drive, slots)
    }

    async fn say(&self, message: Ask) {
        let message = Some(message);
        self.ask.send(v1::DriveRequest { message }).await.unwrap();
    }

    async fn next(&mut self) -> Option<Say> {
        let answer = timeout(Duration::from_secs(10), self.answers.message()).await;
        answer
            .expect("an answer in time")
            .unwrap()
            .map(|answer| answer.message.unwrap())
    }

    async fn frames(&mut self) -> v1::DriveFrames {
        match self.next().await.expect("frames") {
            Say::Frames(frames) => frames,
            other => panic!("{other:?}"),
        }
    }

    /// The next answer that is no frames.
    async fn control(&mut self) -> Say {
        loop {
            match self.next().await.expect("an answer") {
                Say::Frames(_) => {}
                other => return other,
            }
        }
    }

    async fn attached(&mut self) -> v1::DriveAttached {
        match self.control().await {
            Say::Attached(attached) => attached,
            other => panic!("{other:?}"),
        }
    }

    /// Why the stream closes, after which it must end.
    async fn closing(&mut self) -> v1::Problem {
        match self.control().await {
            Say::Closing(closing) => {
                assert!(self.next().await.is_none(), "the stream ends after that");
                closing.reason.unwrap()
            }
            other => panic!("{other:?}"),
        }
    }
}

async fn session(client: &mut Client, id: &str) -> v1::Session {
    let request = v1::GetSessionRequest { id: id.into() };
    client.get_session(request).await.unwrap().into_inner()
}

/// Waits until no client advances the session.
async fn freed(client: &mut Client, id: &str) {
    for _ in 0..500 {
        if session(client, id).await.clock() == v1::Clock::Free {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("{id} is never free");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_of_qpos_takes_robots_alone() {
    let folder = robot::Folder::new("stream");
    let server = robot::start(&folder).await;
    let mut client = server.sessions().await;
    open(&mut client, &["human"]).await;
    let sessions = vec![v1::SessionOptions {
        pack: robot::G1.into(),
        ..options("robot")
    }];
    client
        .create_sessions(v1::CreateSessionsRequest { sessions })
        .await
        .unwrap();
    let mut drive = Drive::start(&mut client).await;
    drive
        .say(Ask::Open(v1::DriveOpen {
            encoding: v1::Encoding::Qpos.into(),
            return_six_d: true,
            ..v1::DriveOpen::default()
        }))
        .await;
    let session_ids = vec!["human".to_owned(), "robot".to_owned()];
    drive.say(Ask::Attach(v1::DriveAttach { session_ids })).await;
    let attached = drive.attached().await;
    assert_eq!(attached.sessions.len(), 1);
    let problem = attached.problems[0].problem.as_ref().unwrap();
    assert_eq!(
        (attached.problems[0].session_id.as_str(), problem.field.as_str()),
        ("human", "open.encoding")
    );
    assert!(
        problem.message.contains("pack toy has no robot"),
        "{}",
        problem.message
    );
    let commands = vec![walk("robot", 1, (0.0, 0.8))];
    drive.say(Ask::Command(v1::CommandRequest { commands })).await;
    let mut ahead = 0.0;
    for _ in 0..45 {
        let frames = drive.frames().await;
        let block = &frames.blocks[0];
        assert_eq!((block.qpos.len(), block.clamped_hinges.len()), (robot::QPOS, 1));
        assert_eq!(block.six_d.len(), robot::JOINTS * 6);
        ahead = block.qpos[0];
    }
    assert!(ahead > 0.2, "{ahead} m along MuJoCo's X");
    // No client drives the other one.
    assert_eq!(session(&mut client, "human").await.clock(), v1::Clock::Free);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_drives_its_sessions_as_commanded() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("d", 3);
    open(&mut client, &names).await;
    let opened = v1::DriveOpen {
        rate_hz: 60,
        return_positions: true,
        ..v1::DriveOpen::default()
    };
    let (mut drive, slots) = Drive::with(&mut client, opened, &names).await;
    assert_eq!(slots, [0, 1, 2]);
    let commands = vec![
        walk("d-1", 1, (0.0, 1.2)),
        walk("d-1", 1, (0.0, 0.0)),
        walk("ghost", 1, (0.0, 0.0)),
    ];
    drive.say(Ask::Command(v1::CommandRequest { commands })).await;
    // Only what was not accepted comes back.
    let Say::Commands(results) = drive.control().await else {
        panic!("no results");
    };
    let statuses: Vec<_> = results.results.iter().map(|result| result.status()).collect();
    assert_eq!(
        statuses,
        [v1::CommandStatus::Repeated, v1::CommandStatus::Refused]
    );

    let (mut last, mut moved) = (None, 0.0);
    for _ in 0..60 {
        let frames = drive.frames().await;
        assert!(
            last.is_none_or(|last| frames.tick > last),
            "{last:?} then {}",
            frames.tick
        );
        last = Some(frames.tick);
        let block = &frames.blocks[0];
        assert_eq!(
            (block.slots.as_slice(), block.frame_count),
            ([0, 1, 2].as_slice(), 1)
        );
        assert_eq!(block.rotations.len(), 3 * JOINTS * 4);
        assert_eq!(block.positions.len(), 3 * JOINTS * 3);
        moved = block.root_positions[5];
    }
    assert!(moved > 0.3, "it walks: {moved}");
    let busy = session(&mut client, "d-1").await;
    assert_eq!(
        (busy.clock(), busy.expires_in_ms),
        (v1::Clock::Drive, busy.ttl_ms)
    );

    drive
        .say(Ask::Detach(v1::DriveDetach {
            session_ids: vec!["d-0".into(), "ghost".into()],
        }))
        .await;
    let Say::Left(left) = drive.control().await else {
        panic!("no session left");
    };
    assert_eq!((left.sessions.len(), left.sessions[0].slot), (1, 0));
    assert_eq!(left.sessions[0].problem.as_ref().unwrap().reason, "DETACHED");
    assert_eq!(session(&mut client, "d-0").await.clock(), v1::Clock::Free);
    // A slot names one session for good.
    drive
        .say(Ask::Attach(v1::DriveAttach {
            session_ids: vec!["d-0".into()],
        }))
        .await;
    assert_eq!(drive.attached().await.sessions[0].slot, 3);
    let block = drive.frames().await.blocks.remove(0);
    assert_eq!(block.slots, [1, 2, 3]);

    let close = v1::CloseSessionsRequest {
        ids: vec!["d-2".into()],
    };
    client.close_sessions(close).await.unwrap();
    let Say::Left(left) = drive.control().await else {
        panic!("no session left");
    };
    assert_eq!(
        left.sessions[0].problem.as_ref().unwrap().reason,
        "SESSION_CLOSED"
    );
    assert_eq!(drive.frames().await.blocks[0].slots, [1, 3]);

    drop(drive.ask);
    let mut drive = Drive {
        ask: mpsc::channel(1).0,
        answers: drive.answers,
    };
    assert_eq!(drive.closing().await.reason, "CLIENT_DONE");
    freed(&mut client, "d-1").await;
    // What was driven can be stepped.
    client.step(step(&["d-1"], 1, vec![])).await.unwrap();
    server.metric("troupe_streams_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn compact_frames_are_a_third_of_the_size() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("d", 10);
    open(&mut client, &names).await;
    let opened = v1::DriveOpen {
        encoding: v1::Encoding::Compact.into(),
        ..v1::DriveOpen::default()
    };
    let (mut drive, _) = Drive::with(&mut client, opened, &names).await;
    let block = drive.frames().await.blocks.remove(0);
    assert_eq!(block.packed_roots.len(), 10 * 12);
    assert_eq!(block.packed_rotations.len(), 10 * JOINTS * 6);
    assert!(block.rotations.is_empty() && block.root_positions.is_empty() && block.positions.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_is_on_one_stream_at_a_time() {
    let server = TestServer::start_with(|config| config.fixed.max_sessions_per_stream = 2).await;
    let mut client = server.sessions().await;
    let names = ids("d", 3);
    open(&mut client, &names).await;
    let (_first, _) = Drive::with(&mut client, v1::DriveOpen::default(), &names[..1]).await;
    let mut second = Drive::start(&mut client).await;
    second.say(Ask::Open(v1::DriveOpen::default())).await;
    let wanted = ["d-0", "unknown", "d-1", "d-1"].map(str::to_owned);
    for session_ids in [wanted[..2].to_vec(), wanted[2..].to_vec()] {
        second.say(Ask::Attach(v1::DriveAttach { session_ids })).await;
    }
    let reasons = |attached: &v1::DriveAttached| -> Vec<String> {
        let problems = attached
            .problems
            .iter()
            .map(|p| p.problem.as_ref().unwrap().reason.clone());
        problems.collect()
    };
    assert_eq!(
        reasons(&second.attached().await),
        ["SESSION_BUSY", "UNKNOWN_SESSION"]
    );
    let attached = second.attached().await;
    assert_eq!(
        (attached.sessions.len(), reasons(&attached)),
        (1, vec!["SESSION_BUSY".to_owned()])
    );
    // A step cannot have it either.
    let status = client.step(step(&["d-0"], 1, vec![])).await.unwrap_err();
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("a stream"), "{}", status.message());
    let session_ids = vec!["d-2".to_owned()];
    second.say(Ask::Attach(v1::DriveAttach { session_ids })).await;
    assert!(reasons(&second.attached().await).is_empty());
    open(&mut client, &["d-3"]).await;
    let session_ids = vec!["d-3".to_owned()];
    second.say(Ask::Attach(v1::DriveAttach { session_ids })).await;
    assert_eq!(reasons(&second.attached().await), ["TOO_MANY_SESSIONS"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_dies_frees_its_sessions_or_closes_them() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    for (close_sessions, prefix) in [(false, "keep"), (true, "drop")] {
        let names = ids(prefix, 20);
        open(&mut client, &names).await;
        // A connection of its own, which dies with everything on it.
        let mut doomed = server.sessions().await;
        let opened = v1::DriveOpen {
            close_sessions,
            ..v1::DriveOpen::default()
        };
        let (mut drive, _) = Drive::with(&mut doomed, opened, &names).await;
        drive.frames().await;
        drop((drive, doomed));
        server.metric("troupe_streams_active", "0").await;
        let open = server.handle.service().sessions().open();
        assert_eq!(open, 20, "those that are kept, and none of the others");
    }
    freed(&mut client, "keep-7").await;
    client.step(step(&ids("keep", 20), 5, vec![])).await.unwrap();
    let status = client.step(step(&["drop-7"], 1, vec![])).await.unwrap_err();
    assert_eq!(status.get_details_error_info().unwrap().reason, "UNKNOWN_SESSION");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_that_is_never_read_gets_the_latest_then_closes() {
    let server =
        TestServer::start_with(|config| config.fixed.reader_timeout = Duration::from_millis(1500)).await;
    let mut client = server.sessions().await;
    // Enough that what the connection takes in is full after a few ticks.
    let names = ids("d", 400);
    open(&mut client, &names).await;
    let mut slow = server.sessions().await;
    let opened = v1::DriveOpen {
        rate_hz: 60,
        return_positions: true,
        ..v1::DriveOpen::default()
    };
    let (mut drive, _) = Drive::with(&mut slow, opened, &names).await;
    // Another stream is not disturbed.
    open(&mut client, &["other"]).await;
    let (mut other, _) = Drive::with(&mut client, v1::DriveOpen::default(), &["other".to_owned()]).await;
    let mut ticks = 0;
    let from = tokio::time::Instant::now();
    while session(&mut client, "d-0").await.clock() == v1::Clock::Drive {
        other.frames().await;
        ticks += 1;
        assert!(from.elapsed() < Duration::from_secs(20), "it was never closed");
    }
    assert!(ticks > 30, "{ticks}");
    assert_eq!(session(&mut client, "d-399").await.clock(), v1::Clock::Free);
    let text = server.handle.service().telemetry().render();
    let line = text
        .lines()
        .find(|line| line.starts_with("troupe_stream_dropped_frames_total{model=\"toy\""))
        .unwrap();
    let dropped: f64 = line.rsplit(' ').next().unwrap().parse().unwrap();
    assert!(dropped >= 400.0 * 60.0, "{line}");

    // One who wakes up finds a few old ticks, the latest with the count of those it missed, and the
    // reason.
    let (mut read, mut missed) = (0, 0);
    let reason = loop {
        match drive.next().await.unwrap() {
            Say::Frames(frames) => {
                read += 1;
                missed = frames.dropped_ticks;
            }
            Say::Closing(closing) => break closing.reason.unwrap(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(reason.reason, "SLOW_READER");
    assert!(read < 150 && missed >= 60, "{read} read, {missed} missed");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_makes_no_sense_closes_the_stream_with_field_and_range() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let opening = |change: fn(&mut v1::DriveOpen)| {
        let mut open = v1::DriveOpen::default();
        change(&mut open);
        Ask::Open(open)
    };
    let attach = |count: usize| {
        Ask::Attach(v1::DriveAttach {
            session_ids: ids("x", count),
        })
    };
    let commands = |count: usize| {
        Ask::Command(v1::CommandRequest {
            commands: vec![v1::Command::default(); count],
        })
    };
    let fine = || opening(|_| {});
    let cases = [
        (vec![attach(1)], "message", "open as the first message"),
        (
            vec![opening(|open| open.rate_hz = 24)],
            "open.rate_hz",
            "30, 50 or 60",
        ),
        (
            vec![opening(|open| open.encoding = 7)],
            "open.encoding",
            "ENCODING_F32 (0) or ENCODING_COMPACT (1)",
        ),
        (vec![fine(), fine()], "message", "attach, detach or command"),
        (vec![fine(), attach(0)], "attach.session_ids", "1 to 4096"),
        (vec![fine(), attach(4097)], "attach.session_ids", "1 to 4096"),
        (vec![fine(), commands(0)], "command.commands", "1 to 10000"),
        (vec![fine(), commands(10_001)], "command.commands", "1 to 10000"),
        (vec![fine(), commands(2_000_000)], "body", "at most 2097152 bytes"),
    ];
    for (messages, field, says) in cases {
        let mut drive = Drive::start(&mut client).await;
        for message in messages {
            drive.say(message).await;
        }
        let reason = drive.closing().await;
        assert_eq!(
            (reason.reason.as_str(), reason.field.as_str()),
            ("INVALID_REQUEST", field)
        );
        assert!(reason.allowed.contains(says), "{reason:?}");
    }
    let mut drive = Drive::start(&mut client).await;
    drive.ask.send(v1::DriveRequest { message: None }).await.unwrap();
    assert_eq!(drive.closing().await.reason, "INVALID_REQUEST");
    server.metric("troupe_streams_active", "0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_that_is_not_opened_closes() {
    let server =
        TestServer::start_with(|config| config.fixed.reader_timeout = Duration::from_millis(200)).await;
    let mut client = server.sessions().await;
    let mut drive = Drive::start(&mut client).await;
    let reason = drive.closing().await;
    assert_eq!(reason.reason, "INVALID_REQUEST");
    assert!(reason.message.contains("within 200 ms"), "{reason:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_number_of_streams_is_limited() {
    let server = TestServer::start_with(|config| {
        config.max_streams = 2;
        config.fixed.max_streams_per_client = Some(100);
    })
    .await;
    let mut client = server.sessions().await;
    let first = Drive::start(&mut client).await;
    let _second = Drive::start(&mut client).await;
    let (_ask, asked) = mpsc::channel::<v1::DriveRequest>(1);
    let status = client.drive(ReceiverStream::new(asked)).await.unwrap_err();
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert_eq!(
        status.get_details_error_info().unwrap().reason,
        "TOO_MANY_STREAMS"
    );
    assert!(status.get_details_retry_info().unwrap().retry_delay.is_some());
    server.metric("troupe_streams_active", "2").await;
    drop(first);
    server.metric("troupe_streams_active", "1").await;
    Drive::start(&mut client).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drain_tells_open_streams_and_does_not_wait_for_them() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("d", 2);
    open(&mut client, &names).await;
    let (mut drive, _) = Drive::with(&mut client, v1::DriveOpen::default(), &names).await;
    drive.frames().await;
    let unopened = Drive::start(&mut client).await;
    let stopping = tokio::spawn(timeout(Duration::from_secs(5), server.handle.shut_down()));
    assert_eq!(drive.closing().await.reason, "DRAINING");
    let mut unopened = unopened;
    assert_eq!(unopened.closing().await.reason, "DRAINING");
    assert!(stopping.await.unwrap().unwrap(), "the stop is clean");
}

#[tokio::test(flavor = "multi_thread")]
async fn characters_go_on_where_plans_fail_and_slow_down_where_none_comes() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("d", 4);
    open(&mut client, &names).await;
    let (mut drive, _) = Drive::with(&mut client, v1::DriveOpen::default(), &names).await;
    let commands = names.iter().map(|id| walk(id, 1, (0.0, 1.2))).collect();
    drive.say(Ask::Command(v1::CommandRequest { commands })).await;
    for _ in 0..30 {
        drive.frames().await;
    }
    server.gate.set_broken(true);
    let (mut underruns, mut steps) = (0, Vec::new());
    let mut before = drive.frames().await.blocks[0].root_positions[2];
    for _ in 0..75 {
        let frames = drive.frames().await;
        underruns += frames.underruns;
        let z = frames.blocks[0].root_positions[2];
        steps.push(z - before);
        before = z;
    }
    assert!(underruns > 0, "the buffer ran dry");
    assert!(
        steps.iter().all(|step| (-0.01..0.1).contains(step)),
        "no pop: {steps:?}"
    );
    assert!(steps[74] < 0.01, "it slowed down: {steps:?}");
    server.gate.set_broken(false);
    for _ in 0..30 {
        drive.frames().await;
    }
    let after = drive.frames().await;
    assert!(after.blocks[0].root_positions[2] > before + 0.2, "it walks again");
    let stats = session(&mut client, "d-0").await.stats.unwrap();
    assert!(stats.failed_plans > 3 && stats.underruns >= 1, "{stats:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_driven_session_does_not_expire() {
    let server = TestServer::start().await;
    let mut client = server.sessions().await;
    let names = ids("d", 1);
    open(&mut client, &names).await;
    let (mut drive, _) = Drive::with(&mut client, v1::DriveOpen::default(), &names).await;
    for _ in 0..3 {
        server.clock.pass(Duration::from_secs(3600));
        server.handle.service().sessions().sweep();
        drive.frames().await;
    }
    drop(drive);
    freed(&mut client, "d-0").await;
    // Its time begins when it is let go.
    server.clock.pass(Duration::from_secs(59));
    assert_eq!(session(&mut client, "d-0").await.expires_in_ms, 1000);
    server.clock.pass(Duration::from_secs(1));
    let request = v1::GetSessionRequest { id: "d-0".into() };
    let status = client.get_session(request).await.unwrap_err();
    assert_eq!(status.get_details_error_info().unwrap().reason, "SESSION_EXPIRED");
}

//! Live characters through the client library (steps, crowds, streams) and through `troupe drive`
//! and `troupe film`.

use std::time::Duration;

use serde_json::Value;
use troupe_client::{
    Client, ClientError, Crowd, CrowdOptions, Drive, DriveEvent, DriveOptions, Encoding, FrameOptions,
    Locomotion, Pack, ProblemKind, Rate, Recording, Session, SessionOptions,
};
use troupe_motion::clip::Clip;
use troupe_motion::codec::{MAX_ROOT_ERROR_M, MAX_ROTATION_ERROR_RAD};
use troupe_motion::conventions::Convention;
use troupe_motion::rotation::angle_between;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::sessions_client::SessionsClient;

use crate::cli::{Folder, failed, printed, troupe};
use crate::crowd;
use crate::motion::difference;
use crate::server::{Server, shared};

/// A short dance: the frames and the intent of each of its parts. `nth` turns its directions.
fn dance(nth: usize) -> [(u32, Locomotion); 4] {
    let way = |heading: f32, speed: f32| Vec3::new(heading.sin(), 0.0, heading.cos()) * speed;
    let turn = nth as f32 * 0.4;
    [
        (7, Locomotion::stand()),
        (20, Locomotion::walk(way(turn, 1.2))),
        (15, Locomotion::walk(way(turn + 1.5, 1.0)).facing(turn)),
        (11, Locomotion::stand()),
    ]
}

fn options(nth: usize) -> SessionOptions {
    SessionOptions::new()
        .seed(nth as u64)
        .at(Vec3::new(nth as f32, 0.0, -0.5), 0.3 * nth as f32)
}

/// Steps a session through a dance and records it.
async fn perform(session: &mut Session, dance: &[(u32, Locomotion)]) -> Clip {
    let mut recording = Recording::of(session);
    for (frames, intent) in dance {
        session.set_intent(intent.clone());
        let frames = session.step(*frames).await.unwrap();
        frames.iter().for_each(|frame| recording.push(frame));
    }
    recording.into_clip().unwrap()
}

/// Opens a session, steps it through a dance and closes it.
async fn solo(client: &Client, pack: &Pack, options: &SessionOptions, dance: &[(u32, Locomotion)]) -> Clip {
    let mut session = client.session(pack, options).await.unwrap();
    let clip = perform(&mut session, dance).await;
    session.close().await.unwrap();
    clip
}

/// Asserts that the frames are the same to the last bit.
fn assert_same(a: &Clip, b: &Clip) {
    assert_eq!(a.frames(), b.frames());
    for frame in 0..a.frames() {
        let same = a.root_positions[frame] == b.root_positions[frame]
            && a.rotations_at(frame) == b.rotations_at(frame);
        assert!(same, "frame {frame}, {} apart in all", difference(a, b));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_character_of_a_crowd_moves_as_alone() {
    const CROWD: usize = 20;
    let (client, pack) = shared().client().await;
    // Fewer than the crowd, so that a step takes several requests.
    let crowd_options = CrowdOptions {
        per_request: 8,
        ..CrowdOptions::default()
    };
    let crowd = Crowd::new(&client, &pack, crowd_options);
    let all: Vec<SessionOptions> = (0..CROWD).map(options).collect();
    let parts = dance(0).map(|(frames, _)| frames);
    let intent = |part: usize, nth: usize| dance(nth)[part].1.clone();
    let together = crowd::perform(crowd, &pack, &all, &parts, intent).await;
    for (nth, clip) in together.iter().enumerate() {
        let alone = solo(&client, &pack, &options(nth), &dance(nth)).await;
        assert_same(clip, &alone);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_character_walks_ahead_and_then_stands() {
    let (client, pack) = shared().client().await;
    let mut session = client.session(&pack, &SessionOptions::new()).await.unwrap();
    session.step(15).await.unwrap();
    session.walk(Vec3::Z * 1.2);
    let clip = perform(
        &mut session,
        &[(120, Locomotion::walk(Vec3::Z * 1.2)), (60, Locomotion::stand())],
    )
    .await;
    let gone = clip.root_positions[119] - clip.root_positions[0];
    assert!((3.6..5.2).contains(&gone.z) && gone.x.abs() < 0.4, "{gone}");
    let drift = clip.root_positions[179] - clip.root_positions[164];
    assert!(drift.length() < 0.1, "it stands: {drift}");
    let info = session.info().await.unwrap();
    assert_eq!((info.frame, info.last_sequence), (195, 2));
    let stats = info.stats.unwrap();
    assert!(
        stats.plans_for_command >= 2 && stats.plans_for_interval > 5,
        "{stats:?}"
    );
    assert_eq!((stats.underruns, stats.late_plans), (0, 0));
    session.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn commands_out_of_order_are_harmless() {
    let server = shared();
    let (client, pack) = server.client().await;
    let mut rpc = SessionsClient::new(server.channel().await);
    let ways = [
        (2, Vec3::Z),
        (5, Vec3::X),
        (3, Vec3::NEG_Z),
        (5, Vec3::X),
        (4, Vec3::NEG_X),
    ];
    let mut session = client.session(&pack, &options(1)).await.unwrap();
    let commands = ways.map(|(sequence, Vec3 { x, y, z })| v1::Command {
        session_id: session.id().to_owned(),
        sequence,
        at_frame: None,
        intent: Some(v1::command::Intent::Locomote(v1::Locomote {
            velocity: Some(v1::Vec3 { x, y, z }),
            ..v1::Locomote::default()
        })),
        priority: None,
    });
    let request = v1::CommandRequest {
        commands: commands.to_vec(),
    };
    let results = rpc.command(request).await.unwrap().into_inner().results;
    use v1::CommandStatus::{Accepted, Late, Repeated};
    let statuses = results.iter().map(v1::CommandResult::status).collect::<Vec<_>>();
    assert_eq!(statuses, [Accepted, Accepted, Late, Repeated, Late]);

    // The character moves as if only the newest command had come.
    let mut recording = Recording::of(&session);
    session
        .step(45)
        .await
        .unwrap()
        .iter()
        .for_each(|f| recording.push(f));
    let moved = recording.into_clip().unwrap();
    let direct = solo(&client, &pack, &options(1), &[(45, Locomotion::walk(Vec3::X))]).await;
    assert_same(&moved, &direct);

    // After `info` the library's next command is newer than all of them.
    session.info().await.unwrap();
    session.stand();
    session.send().await.unwrap();
    assert_eq!(session.info().await.unwrap().last_sequence, 6);
    session.close().await.unwrap();
}

#[tokio::test]
async fn a_session_without_calls_expires() {
    let (client, pack) = shared().client().await;
    let lives = SessionOptions::new().ttl(Duration::from_secs(1));
    let mut session = client.session(&pack, &lives).await.unwrap();
    let mut crowd = Crowd::new(&client, &pack, CrowdOptions::default());
    let members = crowd.add(&[lives, SessionOptions::new()]).await.unwrap();
    crowd.step(1).await.unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    let error = session.step(1).await.map(|_| ()).unwrap_err();
    assert!(error.is_session_expired(), "{error:?}");
    let step = crowd.step(1).await.unwrap();
    let [fault] = step.faults() else {
        panic!("{:?}", step.faults())
    };
    assert_eq!((fault.member, fault.left), (members[0], true));
    assert_eq!(fault.problem.kind, ProblemKind::SessionExpired);
    assert!(step.get(members[1]).is_some());
    let unknown = client.resume_session("missing").await.map(|_| ()).unwrap_err();
    assert_eq!(
        unknown.session_problem().unwrap().kind,
        ProblemKind::UnknownSession
    );
    crowd.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn conventions_encodings_and_rates_give_the_same_motion() {
    let (client, pack) = shared().client().await;
    let dance = [(40, Locomotion::walk(Vec3::new(0.5, 0.0, 1.0)).facing(0.4))];
    let native = solo(&client, &pack, &options(0), &dance).await;
    for convention in Convention::ALL {
        let at = convention.position_from_native(Vec3::new(0.0, 0.0, -0.5));
        let options = SessionOptions::new().convention(convention).at(at, 0.0);
        for encoding in [Encoding::F32, Encoding::Compact] {
            let mut session = client.session(&pack, &options).await.unwrap();
            session.set_frame_options(FrameOptions {
                encoding,
                positions: true,
                ..FrameOptions::default()
            });
            session.walk(convention.position_from_native(dance[0].1.velocity));
            session.face(convention.heading_from_native(0.4));
            let mut recording = Recording::of(&session);
            let frames = session.step(40).await.unwrap();
            frames.iter().for_each(|frame| recording.push(frame));
            let hips = frames.last().unwrap().positions[0];
            let unit = convention.units_per_metre();
            assert!(hips.distance(frames.last().unwrap().root) < 1e-3 * unit);
            let clip = recording.into_clip().unwrap();
            // Besides the error of the encoding, converting commands there and back rounds them,
            // which may change a plan a little.
            assert_near(
                &clip,
                &native,
                2.0 * MAX_ROOT_ERROR_M + 1e-3,
                MAX_ROTATION_ERROR_RAD + 1e-2,
            );
            session.close().await.unwrap();
        }
    }
    // At 60 Hz every second frame is one of those at 30 Hz.
    let mut session = client.session(&pack, &options(0)).await.unwrap();
    session.set_frame_options(FrameOptions {
        rate: Rate::Hz60,
        ..FrameOptions::default()
    });
    let double = perform(&mut session, &[(80, dance[0].1.clone())]).await;
    session.close().await.unwrap();
    let halved = double.slice(1..80).unwrap().resample(30.0).unwrap();
    assert_near(&halved, &native, 1e-4, 1e-3);
}

fn assert_near(a: &Clip, b: &Clip, metres: f32, radians: f32) {
    assert_eq!(a.frames(), b.frames());
    let places = a.root_positions.iter().zip(&b.root_positions);
    let place = places
        .map(|(p, q)| (*p - *q).abs().max_element())
        .fold(0.0, f32::max);
    let turns = a.rotations.iter().zip(&b.rotations);
    let turn = turns
        .map(|(p, q): (&Quat, &Quat)| angle_between(*p, *q))
        .fold(0.0, f32::max);
    assert!(
        place <= metres && turn <= radians,
        "{place} m and {turn} rad apart"
    );
}

/// A stream with new sessions, after the server has attached them all.
async fn stream(client: &Client, pack: &Pack, count: usize) -> Drive {
    let sessions = client
        .open_sessions(pack, &(0..count).map(options).collect::<Vec<_>>())
        .await
        .unwrap();
    let mut drive = client.drive(DriveOptions::default()).await.unwrap();
    drive.attach(sessions).await.unwrap();
    let mut attached = 0;
    while attached < count {
        let update = drive.next().await.unwrap().unwrap();
        for event in update.events {
            assert!(matches!(event, DriveEvent::Attached { .. }), "{event:?}");
            attached += 1;
        }
    }
    drive
}

/// Reads a stream for a time and returns the numbers of its ticks.
async fn watch(drive: &mut Drive, time: Duration) -> Vec<u64> {
    let until = tokio::time::Instant::now() + time;
    let mut numbers = Vec::new();
    while let Ok(update) = tokio::time::timeout_at(until, drive.next()).await {
        numbers.extend(update.unwrap().unwrap().tick.map(|t| t.number()));
    }
    numbers
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_moves_its_sessions() {
    let (client, pack) = shared().client().await;
    let mut drive = stream(&client, &pack, 3).await;
    let ids = drive.sessions().map(|s| s.id().to_owned()).collect::<Vec<_>>();
    for id in &ids {
        *drive.intent_mut(id).unwrap() = Locomotion::walk(Vec3::Z);
    }
    let numbers = watch(&mut drive, Duration::from_secs(3)).await;
    assert!(numbers.is_sorted() && numbers.len() > 30, "{numbers:?}");
    // No other connection can step a session that is on a stream.
    let mut other = client.resume_session(&ids[0]).await.unwrap();
    let busy = other.step(1).await.map(|_| ()).unwrap_err();
    assert_eq!(busy.session_problem().unwrap().kind, ProblemKind::SessionBusy);

    drive.detach([&ids[0]]).await.unwrap();
    let mut back = None;
    while back.is_none() {
        for event in drive.next().await.unwrap().unwrap().events {
            if let DriveEvent::Left { session, problem, .. } = event {
                assert_eq!(problem.kind, ProblemKind::Detached);
                back = session;
            }
        }
    }
    let mut back = *back.unwrap();
    let place = back.step(1).await.unwrap().last().unwrap().root;
    assert!(place.z > 0.5, "it has walked: {place}");
    let rest = drive.close().await.unwrap();
    assert_eq!(rest.len(), 2);
    for mut session in rest {
        session.step(1).await.unwrap();
        session.close().await.unwrap();
    }
    back.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_dies_mid_stream_disturbs_no_other() {
    let server = shared();
    let (client, pack) = server.client().await;
    let mut stays = stream(&client, &pack, 2).await;
    let mut ids = Vec::new();
    for _ in 0..3 {
        // A connection of its own, so that dropping it closes everything at once.
        let dying = Client::connect(server.url()).await.unwrap();
        let mut drive = stream(&dying, &pack, 2).await;
        ids.extend(drive.sessions().map(|s| s.id().to_owned()));
        watch(&mut drive, Duration::from_millis(300)).await;
        drop(drive);
        drop(dying);
    }
    let before = watch(&mut stays, Duration::from_secs(1)).await;
    let after = watch(&mut stays, Duration::from_secs(1)).await;
    assert!(
        before.len() > 10 && after.len() > 10,
        "{} {}",
        before.len(),
        after.len()
    );
    // The sessions are free again, and other clients can resume them.
    for id in ids {
        let mut session = client.resume_session(&id).await.unwrap();
        let freed = async {
            while let Err(error) = session.step(1).await.map(|_| ()) {
                assert_eq!(error.session_problem().unwrap().kind, ProblemKind::SessionBusy);
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        };
        tokio::time::timeout(Duration::from_secs(10), freed)
            .await
            .expect("the stream has freed the session");
        session.close().await.unwrap();
    }
    for session in stays.close().await.unwrap() {
        session.close().await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stopping_server_gives_its_streams_a_reason() {
    let server = Server::start_with(|config| config.drain_timeout_ms = 5_000).await;
    let (client, pack) = server.client().await;
    let mut drive = stream(&client, &pack, 1).await;
    let stopping = tokio::spawn(server.stop());
    let end = async {
        loop {
            match drive.next().await {
                Ok(Some(_)) => {}
                Ok(None) => panic!("it ended without a reason"),
                Err(error) => return error,
            }
        }
    };
    let error = tokio::time::timeout(Duration::from_secs(20), end)
        .await
        .expect("an end");
    assert!(
        matches!(&error, ClientError::StreamEnded(why) if why.kind == ProblemKind::Draining),
        "{error}"
    );
    drop((drive, client));
    stopping.await.unwrap();
}

/// The file of a path in `examples/paths`.
fn path(name: &str) -> String {
    format!("{}/../examples/paths/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

#[tokio::test]
async fn a_square_ends_where_it_began_and_is_the_same_each_time() {
    let folder = Folder::new("square");
    let mut files = Vec::new();
    for name in ["a.bvh", "b.bvh"] {
        let out = folder.file(name);
        let output = troupe([
            "drive",
            "--json",
            "--seed",
            "4",
            "--path",
            &path("square"),
            "--out",
            out.to_str().unwrap(),
        ])
        .await;
        let summary: Value = serde_json::from_str(&printed(&output)).unwrap();
        let number = |key: &str| summary[key].as_f64().unwrap();
        assert!(number("end_to_last_waypoint_m") < 0.6, "{summary:#}");
        assert!((13.0..19.0).contains(&number("distance_m")), "{summary:#}");
        assert!((0.9..1.45).contains(&number("mean_speed_mps")), "{summary:#}");
        assert_eq!(
            (&summary["stats"]["underruns"], &summary["stats"]["failed_plans"]),
            (&"0".into(), &"0".into())
        );
        files.push(std::fs::read(out).unwrap());
    }
    assert!(files[0] == files[1], "the same path and seed give the same file");
}

#[tokio::test]
async fn paths_without_a_scene_are_filmed() {
    let folder = Folder::new("film");
    for name in ["square", "figure-of-eight", "reversal", "style-changes"] {
        let out = folder.file(&format!("{name}.png"));
        let output = troupe([
            "film",
            "--width",
            "800",
            "--path",
            &path(name),
            "--out",
            out.to_str().unwrap(),
        ])
        .await;
        assert_eq!(printed(&output), "", "{name}");
        let png = std::fs::read(out).unwrap();
        assert!(
            png.starts_with(b"\x89PNG") && png.len() > 20_000,
            "{name}: {}",
            png.len()
        );
    }
}

#[tokio::test]
async fn mistakes_of_a_drive_are_errors() {
    let folder = Folder::new("drive-mistakes");
    let file = folder.file("wrong.toml");
    std::fs::write(&file, "[[command]]\ntime_s = 0\nspeed = 99\n").unwrap();
    let file = file.to_str().unwrap();
    failed(
        &troupe(["drive", "--path", file]).await,
        2,
        &["wrong.toml: line 3: speed is 99, but may be 0 to 20"],
    );
    failed(&troupe(["drive"]).await, 2, &["a terminal", "--path"]);
    failed(
        &troupe(["drive", "--path", &path("square"), "--out", "a.fbx"]).await,
        2,
        &[".bvh or .glb"],
    );
    failed(
        &troupe(["drive", "--path", &path("square"), "--style", "wlak"]).await,
        4,
        &["wlak"],
    );
    let open = printed(&troupe(["sessions", "--json"]).await);
    assert!(serde_json::from_str::<Value>(&open).unwrap().is_array(), "{open}");
}

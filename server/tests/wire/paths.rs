//! Packs of many bodies that plan by paths: sessions of several of them together, styles that are
//! words, and paths to follow.

use std::sync::Arc;
use std::time::Duration;

use reqwest::Method;
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_engine::generator::Generator;
use troupe_engine::pack::Pack;
use troupe_engine::toy::Toy;
use troupe_motion::model::{Body, BodyParts, Capabilities};
use troupe_motion::{ContactParams, Joint, Quat, Skeleton, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;
use troupe_proto::v1::drive_response::Message as Said;
use troupe_proto::v1::session_event::Kind;
use troupe_server::api::ErrorBody;
use troupe_server::config::Config;
use troupe_server::server::PackSource;

use crate::common::calls::{Client, frames_of, options, start_drive, step, walk};
use crate::common::scenes::{STOOL, YARD, put_scene, put_stool, scenes};
use crate::common::{self, TestServer};
use crate::restart::Folder;

const ZOO: &str = "zoo";

/// A chain of joints that stands on its last, `height_m` over it.
fn body(name: &str, joints: usize, height_m: f32, words: &[&str]) -> Arc<Body> {
    let bone = -height_m / (joints - 1) as f32;
    let joint = |index: usize| Joint {
        name: format!("j{index}"),
        parent: index.checked_sub(1),
        offset_m: Vec3::Y * if index == 0 { 0.0 } else { bone },
    };
    let contacts = ContactParams {
        joints: vec![joints - 1],
        max_height_m: vec![0.1],
        max_speed_mps: 0.3,
        clearance_m: vec![0.02],
    };
    let skeleton = Skeleton::new((0..joints).map(joint).collect(), Vec3::X, 0.0, Some(contacts)).unwrap();
    let parts = BodyParts {
        name: name.to_owned(),
        skeleton,
        neutral: vec![Quat::IDENTITY; joints],
        sides: vec![0; joints],
        height_m: None,
        size_m: None,
        words: words.iter().map(|word| (*word).to_owned()).collect(),
    };
    Arc::new(Body::new(parts, 30.0, &common::pack(ZOO).rig.dims).unwrap())
}

/// A pack of a person and a dog, whose family follows paths.
fn zoo() -> PackSource {
    let mut manifest = common::pack(ZOO).manifest;
    manifest.family = troupe_engine::toy::FAMILY.to_owned();
    manifest.capabilities = Capabilities {
        live: true,
        path: true,
        ..Capabilities::default()
    };
    let folder = std::path::Path::new(common::FOLDER);
    let mut pack = Pack::from_manifest(manifest, folder).unwrap();
    pack.bodies = vec![
        body("person", 4, 0.9, &["walk", "run", "sneak"]),
        body("dog", 3, 0.4, &["bark"]),
    ];
    pack.words = ["bark", "run", "sneak", "walk"].map(str::to_owned).to_vec();
    PackSource {
        pack,
        workers: 1,
        generator: Box::new(|pack, max_batch| {
            Ok(Box::new(Toy::new(pack.rig.dims, max_batch)) as Box<dyn Generator>)
        }),
        decision: None,
    }
}

async fn server_with(change: impl FnOnce(&mut Config)) -> TestServer {
    let mut server = TestServer::start_also(change, Duration::ZERO, |_| vec![zoo()]).await;
    server.handle.ready().await.unwrap();
    server
}

fn of(id: &str, body: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        pack: ZOO.into(),
        body: body.into(),
        ..options(id)
    }
}

async fn create(client: &mut Client, sessions: Vec<v1::SessionOptions>) -> Vec<v1::Session> {
    let request = v1::CreateSessionsRequest { sessions };
    client
        .create_sessions(request)
        .await
        .unwrap()
        .into_inner()
        .sessions
}

fn point(x: f32, z: f32) -> v1::PathPoint {
    v1::PathPoint {
        position: Some(v1::Vec3 { x, y: 0.0, z }),
        ..v1::PathPoint::default()
    }
}

fn follow(id: &str, sequence: u64, path: v1::FollowPath) -> v1::Command {
    v1::Command {
        intent: Some(Intent::FollowPath(path)),
        ..walk(id, sequence, (0.0, 0.0))
    }
}

/// Three metres ahead, then two to the left.
fn corner() -> v1::FollowPath {
    v1::FollowPath {
        points: vec![point(0.0, 0.0), point(0.0, 3.0), point(2.0, 3.0)],
        speed: Some(1.0),
        ..v1::FollowPath::default()
    }
}

/// Steps until the session has arrived: the event, its frame, and where the session stands two
/// seconds later.
async fn arrives(client: &mut Client, id: &str, command: v1::Command) -> (v1::PathArrived, u64, v1::Session) {
    let mut commands = vec![command];
    for _ in 0..20 {
        let request = step(&[id], 30, std::mem::take(&mut commands));
        let answer = client.step(request).await.unwrap().into_inner();
        assert!(
            answer
                .command_results
                .iter()
                .all(|result| result.problem.is_none()),
            "{answer:?}"
        );
        let Some(event) = answer.events.first().and_then(|events| events.events.first()) else {
            continue;
        };
        let Some(Kind::Arrived(arrived)) = event.kind else {
            panic!("{event:?}")
        };
        let frame = event.frame;
        client.step(step(&[id], 60, Vec::new())).await.unwrap();
        let get = v1::GetSessionRequest { id: id.into() };
        let session = client.get_session(get).await.unwrap().into_inner();
        return (arrived, frame, session);
    }
    panic!("{id} never arrived")
}

#[tokio::test]
async fn bodies_of_one_pack_go_together_each_in_its_own_block() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    let opened = create(&mut client, vec![of("p", ""), of("d", "dog"), of("q", "person")]).await;
    let names: Vec<_> = opened
        .iter()
        .map(|session| {
            (
                session.pack.as_str(),
                session.body.as_str(),
                session.style.as_str(),
            )
        })
        .collect();
    assert_eq!(
        names,
        [
            (ZOO, "person", "walk"),
            (ZOO, "dog", "plain"),
            (ZOO, "person", "walk")
        ]
    );
    let heights: Vec<f32> = opened.iter().map(|session| session.position.unwrap().y).collect();
    assert!(
        (heights[0] - 0.92).abs() < 1e-4 && (heights[1] - 0.42).abs() < 1e-4,
        "{heights:?}"
    );

    let commands = ["p", "d", "q"].map(|id| walk(id, 1, (0.0, 1.0))).to_vec();
    let answer = client.step(step(&["p", "d", "q"], 60, commands)).await.unwrap();
    let blocks = answer.into_inner().blocks;
    let found: Vec<_> = blocks
        .iter()
        .map(|block| (block.pack.as_str(), block.body.as_str(), block.slots.clone()))
        .collect();
    assert_eq!(found, [(ZOO, "person", vec![0, 2]), (ZOO, "dog", vec![1])]);
    assert_eq!(blocks[0].rotations.len(), 2 * 60 * 4 * 4);
    assert_eq!(blocks[1].rotations.len(), 60 * 3 * 4);
    for (block, index) in [(&blocks[0], 0), (&blocks[0], 1), (&blocks[1], 0)] {
        let (roots, _) = frames_of(block, index);
        let z = roots[roots.len() - 1];
        assert!((0.8..2.0).contains(&z), "{} at {z}", block.body);
    }

    let (ask, mut said) = start_drive(&mut client).await;
    for message in [
        Ask::Open(v1::DriveOpen::default()),
        Ask::Attach(v1::DriveAttach {
            session_ids: vec!["p".into(), "d".into()],
        }),
    ] {
        let message = Some(message);
        ask.send(v1::DriveRequest { message }).await.unwrap();
    }
    loop {
        let Some(Said::Frames(frames)) = said.message().await.unwrap().unwrap().message else {
            continue;
        };
        if frames.blocks.len() == 2 {
            let names: Vec<_> = frames.blocks.iter().map(|block| block.body.as_str()).collect();
            assert_eq!(names, ["person", "dog"]);
            break;
        }
    }
    // Metrics know packs, not skeletons.
    server.metric("troupe_sessions_active{model=\"zoo\"", "3").await;
}

#[tokio::test]
async fn a_body_moves_the_same_alone_and_in_company() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    create(&mut client, vec![of("alone", "dog")]).await;
    let command = |id: &str| follow(id, 1, corner());
    let alone = client
        .step(step(&["alone"], 90, vec![command("alone")]))
        .await
        .unwrap();
    let alone = alone.into_inner().blocks.remove(0);

    let mut names: Vec<String> = (0..8).map(|index| format!("p{index}")).collect();
    let mut sessions: Vec<_> = names.iter().map(|id| of(id, "person")).collect();
    names.push("d".into());
    sessions.push(of("d", "dog"));
    create(&mut client, sessions).await;
    let commands = names.iter().map(|id| command(id)).collect();
    let answer = client
        .step(step(&names, 90, commands))
        .await
        .unwrap()
        .into_inner();
    let dogs = answer.blocks.iter().find(|block| block.body == "dog").unwrap();
    assert_eq!(frames_of(dogs, 0), frames_of(&alone, 0));
}

#[tokio::test]
async fn bodies_that_a_pack_does_not_have_are_refused() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    let one = v1::SessionOptions {
        body: "dog".into(),
        ..options("a")
    };
    for (options, allowed) in [
        (of("a", "cat"), "person, dog"),
        (one, "none: the pack has one skeleton"),
    ] {
        let request = v1::CreateSessionsRequest {
            sessions: vec![options],
        };
        let status = client.create_sessions(request).await.unwrap_err();
        let info = status.get_details_error_info().unwrap();
        assert_eq!(
            (status.code(), info.reason.as_str()),
            (Code::InvalidArgument, "UNKNOWN_BODY")
        );
        assert_eq!(info.metadata["field"], "sessions[0].body");
        assert_eq!(info.metadata["allowed"], allowed);
    }
    let answer = server.get("/v1/packs/zoo/styles?body=cat").await;
    let error: ErrorBody = answer.json().await.unwrap();
    assert_eq!(error.error.field.as_deref(), Some("body"));
}

#[tokio::test]
async fn styles_are_the_words_of_the_body_and_blends_of_them() {
    let server = server_with(|_| {}).await;
    let list = async |body: &str| -> v1::ListStylesResponse {
        let path = format!("/v1/packs/zoo/styles?body={body}");
        server.get(&path).await.json().await.unwrap()
    };
    let persons = list("").await;
    let names: Vec<_> = persons.styles.iter().map(|style| style.name.as_str()).collect();
    assert_eq!(names, ["plain", "run", "sneak", "walk"]);
    assert_eq!(
        (persons.body.as_str(), persons.default_style.as_str()),
        ("person", "walk")
    );
    assert!(
        persons
            .styles
            .iter()
            .all(|style| style.gaits.is_empty() && style.built_in)
    );
    assert_eq!(list("dog").await.default_style, "plain");

    let word = |word: &str, weight| v1::StyleWord {
        word: word.into(),
        weight: Some(weight),
    };
    let blend = v1::Style {
        default_speed: 1.0,
        replan_interval_frames: 9,
        words: vec![word("walk", 0.5), word("sneak", 0.5)],
        ..v1::Style::default()
    };
    let put = async |style: &v1::Style, query: &str| {
        server
            .send(Method::PUT, &format!("/v1/packs/zoo/styles/creep{query}"), style)
            .await
    };
    let made: v1::Style = put(&blend, "").await.json().await.unwrap();
    assert_eq!((made.name.as_str(), &made.words), ("creep", &blend.words));
    let mut client = server.sessions().await;
    let creeping = v1::SessionOptions {
        style: "creep".into(),
        ..of("c", "person")
    };
    assert_eq!(create(&mut client, vec![creeping]).await[0].style, "creep");
    // A dog does not know these words.
    for (style, query, field) in [
        (blend.clone(), "?body=dog", "style.words[0].word"),
        (
            v1::Style {
                words: vec![word("walk", 2.0)],
                ..blend.clone()
            },
            "",
            "style.words[0].weight",
        ),
        (
            v1::Style {
                words: vec![word("walk", 0.5); 2],
                ..blend.clone()
            },
            "",
            "style.words[1].word",
        ),
        (
            v1::Style {
                gaits: vec![v1::Gait::default()],
                ..blend.clone()
            },
            "",
            "style.gaits",
        ),
    ] {
        let error: ErrorBody = put(&style, query).await.json().await.unwrap();
        assert_eq!(error.error.field.as_deref(), Some(field));
    }
    // Nor does a pack of keyframes know any.
    let answer = server
        .send(Method::PUT, "/v1/packs/toy/styles/creep", &blend)
        .await;
    let error: ErrorBody = answer.json().await.unwrap();
    assert_eq!(error.error.field.as_deref(), Some("style.words"));
}

#[tokio::test]
async fn a_path_is_followed_by_packs_of_both_kinds() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    create(
        &mut client,
        vec![of("dog", "dog"), of("person", ""), options("toy")],
    )
    .await;
    for id in ["dog", "person", "toy"] {
        let (arrived, frame, session) = arrives(&mut client, id, follow(id, 1, corner())).await;
        let place = session.position.unwrap();
        assert!(arrived.late < 0.5 && arrived.off < 0.3, "{id}: {arrived:?}");
        assert!((150..200).contains(&frame), "{id} at {frame}");
        assert!((place.x - 2.0).hypot(place.z - 3.0) < 0.1, "{id}: {place:?}");
        // The engine of the pack of keyframes never turns.
        let off = (session.heading - std::f32::consts::FRAC_PI_2).abs();
        assert!(id == "toy" || off < 0.2, "{id}: {}", session.heading);
        assert!(session.speed < 0.1, "{id}: {}", session.speed);
    }
}

#[tokio::test]
async fn a_path_in_another_convention_and_over_http_is_the_same() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    let unreal = v1::SessionOptions {
        convention: v1::Convention::Unreal.into(),
        ..of("u", "dog")
    };
    create(&mut client, vec![unreal]).await;
    // Unreal: centimetres, X ahead, Y to the right, Z up.
    let body = serde_json::json!({"session_ids": ["u"], "frames": 100, "commands": [{
        "session_id": "u", "sequence": 1, "follow_path": {"speed": 150, "points": [
            {"position": {"x": 0, "y": 0, "z": 55}}, {"position": {"x": 200, "y": 0}}]}}]});
    let answer = server.send(Method::POST, "/v1/step", &body).await;
    let answer: v1::StepResponse = answer.json().await.unwrap();
    assert_eq!(answer.command_results[0].problem, None, "{answer:?}");
    let Some(Kind::Arrived(arrived)) = answer.events[0].events[0].kind else {
        panic!("{:?}", answer.events)
    };
    assert!(arrived.off < 5.0, "{arrived:?}");
    let roots = &answer.blocks[0].root_positions;
    let [x, y, _] = roots[roots.len() - 3..] else {
        unreachable!()
    };
    assert!((x - 200.0).hypot(y) < 5.0, "{x} {y}");
}

#[tokio::test]
async fn paths_that_cannot_be_are_refused_by_their_field() {
    let server = server_with(|_| {}).await;
    let mut client = server.sessions().await;
    create(&mut client, vec![of("d", "dog")]).await;
    let timed = |times: [f32; 2]| v1::FollowPath {
        points: [point(0.0, 0.0), point(0.0, 40.0)]
            .iter()
            .zip(times)
            .map(|(point, time)| v1::PathPoint {
                time: Some(time),
                ..*point
            })
            .collect(),
        ..v1::FollowPath::default()
    };
    let through = |points: Vec<v1::PathPoint>| v1::FollowPath { points, ..corner() };
    let nan = v1::FollowPath {
        speed: Some(f32::NAN),
        ..corner()
    };
    let facing = v1::PathPoint {
        heading: Some(f32::INFINITY),
        ..point(0.0, 0.0)
    };
    for (path, field, reason) in [
        (through(vec![point(0.0, 0.0)]), "points", "INVALID_FIELD"),
        (
            through(vec![point(0.0, f32::NAN), point(0.0, 1.0)]),
            "points[0].position.z",
            "INVALID_FIELD",
        ),
        (
            through(vec![v1::PathPoint::default(); 2]),
            "points[0].position",
            "INVALID_FIELD",
        ),
        (
            through(vec![facing, point(0.0, 1.0)]),
            "points[0].heading",
            "INVALID_FIELD",
        ),
        (timed([1.0, 1.0]), "points[1].time", "INVALID_FIELD"),
        (timed([0.0, 1.0]), "points[1].time", "INVALID_FIELD"),
        (nan, "speed", "INVALID_FIELD"),
        (
            v1::FollowPath {
                style: "fly".into(),
                ..corner()
            },
            "style",
            "UNKNOWN_STYLE",
        ),
        (
            through(vec![point(0.0, 6.0), point(0.0, 7.0)]),
            "points[0].position",
            "PATH_TOO_FAR",
        ),
    ] {
        let commands = vec![follow("d", 1, path)];
        let answer = client
            .command(v1::CommandRequest { commands })
            .await
            .unwrap()
            .into_inner();
        let problem = answer.results[0].problem.clone().unwrap();
        let found = (problem.field.as_str(), problem.reason.as_str());
        assert_eq!(
            found,
            (format!("commands[0].follow_path.{field}").as_str(), reason)
        );
        assert!(!problem.allowed.is_empty(), "{problem:?}");
    }
    // So many points that they are not even read.
    let commands = vec![follow("d", 1, through(vec![point(0.0, 0.0); 1025]))];
    let status = client.command(v1::CommandRequest { commands }).await.unwrap_err();
    let info = status.get_details_error_info().unwrap();
    assert_eq!(info.metadata["field"], "commands[0].follow_path.points");
}

#[tokio::test]
async fn a_path_goes_on_after_a_restart() {
    let folder = Folder::new("paths");
    let start = || {
        server_with(|config| {
            config.store = Some(folder.path().to_owned());
            config.fixed.snapshot_interval = Duration::from_millis(20);
        })
    };
    let server = start().await;
    let mut client = server.sessions().await;
    create(&mut client, vec![of("d", "dog")]).await;
    client
        .step(step(&["d"], 60, vec![follow("d", 1, corner())]))
        .await
        .unwrap();
    assert!(server.handle.shut_down().await);

    let server = start().await;
    let mut client = server.sessions().await;
    let get = v1::GetSessionRequest { id: "d".into() };
    let session = client.get_session(get).await.unwrap().into_inner();
    assert_eq!((session.body.as_str(), session.frame), ("dog", 60));
    let priority = v1::Command {
        intent: None,
        priority: Some(0.5),
        ..walk("d", 2, (0.0, 0.0))
    };
    let (arrived, frame, session) = arrives(&mut client, "d", priority).await;
    let place = session.position.unwrap();
    assert!(
        arrived.late < 0.5 && (150..200).contains(&frame),
        "{arrived:?} at {frame}"
    );
    assert!((place.x - 2.0).hypot(place.z - 3.0) < 0.1, "{place:?}");
}

#[tokio::test]
async fn in_a_scene_they_walk_and_do_not_use_objects() {
    let server = server_with(|_| {}).await;
    let mut world = scenes(&server).await;
    put_stool(&mut world, STOOL).await.unwrap();
    put_scene(&mut world, YARD).await.unwrap();
    let mut client = server.sessions().await;
    let inside = v1::SessionOptions {
        scene: "yard".into(),
        ..of("d", "dog")
    };
    create(&mut client, vec![inside]).await;
    let sit = v1::Command {
        intent: Some(Intent::Interact(v1::Interact {
            instance: "stool".into(),
            ..v1::Interact::default()
        })),
        ..walk("d", 1, (0.0, 0.0))
    };
    let request = v1::CommandRequest { commands: vec![sit] };
    let answer = client.command(request).await.unwrap().into_inner();
    let problem = answer.results[0].problem.clone().unwrap();
    assert_eq!(
        (problem.reason.as_str(), problem.field.as_str()),
        ("PACK_CANNOT", "commands[0].interact.instance")
    );
    let (arrived, ..) = arrives(&mut client, "d", follow("d", 1, corner())).await;
    assert!(arrived.off < 0.3, "{arrived:?}");
}

//! A server that is started again: sessions, uploads and the objects of scenes are there, and
//! clients go on from what they saw.

use std::path::{Path, PathBuf};
use std::time::Duration;

use reqwest::StatusCode;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::attacks::create;
use crate::common::calls::{frames_of, ids, open, options, step, stepped, walk};
use crate::common::scenes::{STOOL, YARD, put_scene, put_stool, scenes};
use crate::common::{JOINTS, TestServer};

/// A folder that goes with its test.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("troupe-restart-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        Self(folder)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    async fn server(&self) -> TestServer {
        let store = self.0.clone();
        TestServer::start_with(move |config| {
            config.store = Some(store);
            config.fixed.snapshot_interval = Duration::from_millis(20);
        })
        .await
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn resume(sessions: Vec<v1::SessionResume>) -> v1::ResumeSessionsRequest {
    v1::ResumeSessionsRequest { sessions }
}

/// The last frame of a step, as its client saw it.
fn seen(id: &str, block: &v1::FrameBlock, index: usize) -> v1::SessionResume {
    let (roots, rotations) = frames_of(block, index);
    let [x, y, z] = roots[roots.len() - 3..] else {
        unreachable!()
    };
    v1::SessionResume {
        session_id: id.to_owned(),
        frame: Some(block.first_frames[index] + u64::from(block.frame_count) - 1),
        pose: Some(v1::Keyframe {
            root: Some(v1::Root {
                position: Some(v1::Vec3 { x, y, z }),
                heading: None,
            }),
            pose: Some(v1::Pose {
                rotations: rotations[rotations.len() - 4 * JOINTS..].to_vec(),
                root_height: None,
            }),
            ..v1::Keyframe::default()
        }),
    }
}

/// The same six frames later and 0.3 m ahead, with the place of the root.
fn seen_ahead(id: &str, block: &v1::FrameBlock, index: usize) -> (v1::SessionResume, v1::Vec3) {
    let mut ahead = seen(id, block, index);
    ahead.frame = ahead.frame.map(|frame| frame + 6);
    let root = ahead.pose.as_mut().unwrap().root.as_mut().unwrap();
    root.position.as_mut().unwrap().z += 0.3;
    let place = root.position.unwrap();
    (ahead, place)
}

#[tokio::test]
async fn sessions_go_on_as_if_the_server_had_never_stopped() {
    let (folder, other) = (Folder::new("same"), Folder::new("other"));
    let names = ids("s", 5);
    let mut all = Vec::new();
    // The same steps with a restart in the middle, and without.
    for (folder, restarts) in [(&folder, true), (&other, false)] {
        let mut server = folder.server().await;
        let mut client = server.sessions().await;
        open(&mut client, &names).await;
        let commands = names.iter().map(|id| walk(id, 3, (0.4, 1.1))).collect();
        stepped(&mut client, step(&names, 45, commands)).await;
        if restarts {
            assert!(server.handle.shut_down().await);
            server = folder.server().await;
            client = server.sessions().await;
        }
        let block = stepped(&mut client, step(&names, 60, vec![])).await;
        assert_eq!(block.first_frames, [46; 5]);
        all.push(block);
        server.metric("troupe_store_failures_total", "0").await;
    }
    assert_eq!(all[0].root_positions, all[1].root_positions);
    assert_eq!(all[0].rotations, all[1].rotations);
}

#[tokio::test]
async fn a_client_goes_on_from_what_it_saw() {
    let folder = Folder::new("seen");
    let server = folder.server().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    let first = stepped(&mut client, step(&["a", "b"], 40, vec![walk("a", 1, (0.0, 1.2))])).await;
    server.handle.shut_down().await;

    let server = folder.server().await;
    let mut client = server.sessions().await;
    // One saw more than the server knows, the other less.
    let (ahead, met) = seen_ahead("a", &first, 0);
    let mut behind = seen("b", &first, 1);
    behind.frame = Some(5);
    let unknown = v1::SessionResume {
        session_id: "c".into(),
        ..v1::SessionResume::default()
    };
    let request = resume(vec![ahead.clone(), behind, unknown]);
    let answer = client.resume_sessions(request).await.unwrap().into_inner();
    let of = |index: usize| {
        let one = &answer.sessions[index];
        let session = one.session.as_ref().unwrap();
        (
            one.restored,
            one.restored_frame,
            session.frame,
            session.last_sequence,
        )
    };
    assert_eq!((of(0), of(1)), ((true, 40, 46, 1), (true, 40, 40, 0)));
    let problem = answer.problems[0].problem.as_ref().unwrap();
    assert_eq!(
        (answer.problems[0].slot, &*problem.reason),
        (2, "UNKNOWN_SESSION")
    );
    let there = answer.sessions[0].session.as_ref().unwrap().position.unwrap();
    assert!(
        (there.z - met.z).abs() < 1e-3 && (there.x - met.x).abs() < 1e-3,
        "{there:?} {met:?}"
    );

    let block = stepped(&mut client, step(&["a", "b"], 10, vec![])).await;
    assert_eq!(block.first_frames, [47, 41]);
    let (roots, _) = frames_of(&block, 0);
    let (step_m, mut before) = (1.5 / 30.0, met);
    for root in roots.chunks(3) {
        let way = ((root[0] - before.x).powi(2) + (root[2] - before.z).powi(2)).sqrt();
        assert!(way < 2.0 * step_m, "{way} m in a frame");
        before = v1::Vec3 {
            x: root[0],
            y: root[1],
            z: root[2],
        };
    }

    // It is taken up once; a session that went on stays as it is.
    let again = client
        .resume_sessions(resume(vec![ahead]))
        .await
        .unwrap()
        .into_inner();
    let one = &again.sessions[0];
    assert_eq!((one.restored, one.session.as_ref().unwrap().frame), (false, 56));
}

#[tokio::test]
async fn a_call_without_a_frame_leaves_the_last_frame_to_a_later_call() {
    let folder = Folder::new("later");
    let server = folder.server().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    let first = stepped(&mut client, step(&["a", "b"], 40, vec![walk("a", 1, (0.0, 1.2))])).await;
    server.handle.shut_down().await;

    let server = folder.server().await;
    let mut client = server.sessions().await;
    let blind = |id: &str| v1::SessionResume {
        session_id: id.into(),
        ..v1::SessionResume::default()
    };
    let (ahead, met) = seen_ahead("a", &first, 0);
    let mut wrong = ahead.clone();
    wrong.frame = Some(500);
    // Neither a call without a frame nor one that is refused is the client's return.
    let asked = vec![blind("a"), blind("a"), wrong, ahead.clone(), ahead, blind("b")];
    let answer = client.resume_sessions(resume(asked)).await.unwrap().into_inner();
    let frames: Vec<_> = (answer.sessions.iter())
        .map(|one| (one.restored, one.session.as_ref().unwrap().frame))
        .collect();
    assert_eq!(
        frames,
        [(true, 40), (true, 40), (true, 46), (false, 46), (true, 40)]
    );
    assert_eq!(answer.problems.len(), 1);
    let there = answer.sessions[2].session.as_ref().unwrap().position.unwrap();
    assert!(
        (there.z - met.z).abs() < 1e-3 && (there.x - met.x).abs() < 1e-3,
        "{there:?} {met:?}"
    );

    // A session that a client has resumed and moved on does not go back to another's frame.
    stepped(&mut client, step(&["b"], 3, vec![])).await;
    let (ahead, _) = seen_ahead("b", &first, 1);
    let answer = client
        .resume_sessions(resume(vec![ahead]))
        .await
        .unwrap()
        .into_inner();
    let one = &answer.sessions[0];
    assert_eq!((one.restored, one.session.as_ref().unwrap().frame), (false, 43));
}

#[tokio::test]
async fn what_a_client_cannot_have_seen_is_refused() {
    let folder = Folder::new("wrong");
    let server = folder.server().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b", "c"]).await;
    let block = stepped(&mut client, step(&["a", "b", "c"], 10, vec![])).await;
    server.handle.shut_down().await;
    let server = folder.server().await;
    let mut far = seen("a", &block, 0);
    far.frame = Some(12);
    far.pose
        .as_mut()
        .unwrap()
        .root
        .as_mut()
        .unwrap()
        .position
        .as_mut()
        .unwrap()
        .x += 40.0;
    let mut later = seen("b", &block, 1);
    later.frame = Some(500);
    let mut nameless = seen("c", &block, 2);
    nameless.frame = None;
    let mut unfit = seen("c", &block, 2);
    unfit
        .pose
        .as_mut()
        .unwrap()
        .pose
        .as_mut()
        .unwrap()
        .rotations
        .pop();
    let body = resume(vec![far, later, nameless, unfit]);
    let response = server
        .send(reqwest::Method::POST, "/v1/sessions/resume", &body)
        .await;
    assert_eq!(response.status(), StatusCode::OK);
    let answer: v1::ResumeSessionsResponse = response.json().await.unwrap();
    let problems: Vec<_> = (answer.problems.iter())
        .map(|of| of.problem.as_ref().unwrap())
        .map(|problem| (&*problem.field, &*problem.allowed))
        .collect();
    assert_eq!(
        problems[..3],
        [
            ("sessions[0].pose", "at most 5 m"),
            ("sessions[1].frame", "at most 100"),
            ("sessions[2].frame", "the number of the frame that pose is of"),
        ]
    );
    assert!(
        problems[3].0.starts_with("sessions[3].pose.pose.rotations"),
        "{problems:?}"
    );
    let empty = server
        .send(reqwest::Method::POST, "/v1/sessions/resume", &resume(vec![]))
        .await;
    assert_eq!(empty.status(), StatusCode::BAD_REQUEST);
    let body: ErrorBody = empty.json().await.unwrap();
    assert_eq!(body.error.field.as_deref(), Some("sessions"));
}

#[tokio::test]
async fn uploads_and_objects_are_there_again() {
    let folder = Folder::new("uploads");
    let server = folder.server().await;
    let mut world = scenes(&server).await;
    let document = |text: &str| {
        Some(v1::Document {
            text: text.into(),
            format: 0,
        })
    };
    let stool = v1::PutObjectDefinitionRequest {
        document: document(STOOL),
        ..v1::PutObjectDefinitionRequest::default()
    };
    world.put_object_definition(stool).await.unwrap();
    let yard = v1::PutSceneRequest {
        document: document(YARD),
        ..v1::PutSceneRequest::default()
    };
    world.put_scene(yard).await.unwrap();
    let mut client = server.sessions().await;
    let sits = v1::SessionOptions {
        scene: "yard".into(),
        ..options("sits")
    };
    let request = v1::CreateSessionsRequest { sessions: vec![sits] };
    client.create_sessions(request).await.unwrap();
    let interact = v1::Command {
        session_id: "sits".into(),
        sequence: 1,
        intent: Some(v1::command::Intent::Interact(v1::Interact {
            instance: "stool-1".into(),
            ..v1::Interact::default()
        })),
        ..v1::Command::default()
    };
    client.step(step(&["sits"], 100, vec![interact])).await.unwrap();
    client.step(step(&["sits"], 120, vec![])).await.unwrap();
    let activity = |session: &v1::Session| session.activity.clone().unwrap();
    let get = || v1::GetSessionRequest { id: "sits".into() };
    let before = client.get_session(get()).await.unwrap().into_inner();
    let moved = v1::MoveObjectsRequest {
        scene: "yard".into(),
        moves: vec![v1::ObjectMove {
            id: "stool-2".into(),
            position: Some(v1::Vec3 {
                x: 3.0,
                y: 0.0,
                z: -1.0,
            }),
            ..v1::ObjectMove::default()
        }],
        ..v1::MoveObjectsRequest::default()
    };
    world.move_objects(moved).await.unwrap();
    assert!(server.handle.shut_down().await);

    let server = folder.server().await;
    let mut client = server.sessions().await;
    let after = client.get_session(get()).await.unwrap().into_inner();
    assert_eq!(activity(&before), activity(&after));
    assert_eq!((before.position, before.frame), (after.position, after.frame));
    let get_yard = v1::GetSceneRequest {
        name: "yard".into(),
        ..v1::GetSceneRequest::default()
    };
    let scene = scenes(&server)
        .await
        .get_scene(get_yard)
        .await
        .unwrap()
        .into_inner();
    let object = |id: &str| scene.objects.iter().find(|object| object.id == id).unwrap();
    assert_eq!(object("stool-1").holder, "sits");
    assert_eq!(
        object("stool-2").position,
        Some(v1::Vec3 {
            x: 3.0,
            y: 0.0,
            z: -1.0
        })
    );
    // It leaves the stool as it would have.
    let end = v1::Command {
        session_id: "sits".into(),
        sequence: 2,
        intent: Some(v1::command::Intent::EndInteraction(v1::EndInteraction {})),
        ..v1::Command::default()
    };
    client.step(step(&["sits"], 120, vec![end])).await.unwrap();
    let done = client.get_session(get()).await.unwrap().into_inner();
    assert_ne!(activity(&done), activity(&after));
}

#[tokio::test]
async fn sessions_that_are_gone_stay_gone() {
    let folder = Folder::new("gone");
    let server = folder.server().await;
    let mut client = server.sessions().await;
    open(&mut client, &["a", "b"]).await;
    tokio::time::sleep(Duration::from_millis(60)).await;
    let close = v1::CloseSessionsRequest {
        ids: vec!["a".into()],
    };
    client.close_sessions(close).await.unwrap();
    server.handle.shut_down().await;
    let server = folder.server().await;
    let list = server
        .sessions()
        .await
        .list_sessions(v1::ListSessionsRequest::default())
        .await;
    let list = list.unwrap().into_inner();
    let names: Vec<&str> = list.sessions.iter().map(|session| &*session.id).collect();
    assert_eq!(names, ["b"]);
    // A session has its whole time to live from the start on.
    server.clock.pass(Duration::from_millis(59_000));
    assert_eq!(server.get("/v1/sessions/b").await.status(), StatusCode::OK);
    server.clock.pass(Duration::from_millis(61_000));
    assert_eq!(server.get("/v1/sessions/b").await.status(), StatusCode::GONE);
}

#[tokio::test]
async fn a_session_whose_scene_is_gone_is_left_out() {
    let folder = Folder::new("no-scene");
    let server = folder.server().await;
    let mut world = scenes(&server).await;
    put_stool(&mut world, STOOL).await.unwrap();
    put_scene(&mut world, YARD).await.unwrap();
    let mut client = server.sessions().await;
    let inside = v1::SessionOptions {
        scene: "yard".into(),
        ..options("inside")
    };
    create(&mut client, vec![inside, options("outside")]).await;
    assert!(server.handle.shut_down().await);
    std::fs::remove_file(folder.path().join("scenes/yard.toml")).unwrap();

    let server = folder.server().await;
    for (result, count) in [("restored", "1"), ("left_out", "1")] {
        let name = format!("troupe_store_sessions_total{{result=\"{result}\"}}");
        server.metric(&name, count).await;
    }
    assert_eq!(server.get("/v1/sessions/outside").await.status(), StatusCode::OK);
}

#[tokio::test]
async fn one_server_at_a_time_has_a_store() {
    let folder = Folder::new("taken");
    let server = folder.server().await;
    let store = folder.0.clone();
    let mut second =
        TestServer::start_unready(move |config| config.store = Some(store), Duration::ZERO).await;
    let error = second.handle.ready().await.unwrap_err().to_string();
    assert!(error.starts_with("store: another server uses "), "{error}");
    server.handle.shut_down().await;
}

/// Records of another time, or that somebody has broken, cost their sessions and nothing else.
#[tokio::test]
async fn records_that_do_not_fit_are_left_out() {
    use troupe_live::records::{Changes, Kind, Records};
    let folder = Folder::new("broken");
    let server = folder.server().await;
    let mut client = server.sessions().await;
    open(&mut client, &ids("s", 3)).await;
    server.handle.shut_down().await;
    let edit = |path: &Path| {
        let mut records = Records::open(path).unwrap();
        let all = records.all(Kind::Session).unwrap();
        let mut changes = Changes::default();
        for (nth, (name, mut record)) in all.into_iter().enumerate() {
            match nth {
                0 => record[0] = 99,
                1 => {
                    let middle = record.len() / 2;
                    record[middle] ^= 1;
                }
                _ => continue,
            }
            changes.put(Kind::Session, name, record);
        }
        records.write(&changes).unwrap();
    };
    edit(&folder.0);
    let server = folder.server().await;
    server
        .metric("troupe_store_sessions_total{result=\"restored\"}", "1")
        .await;
    server
        .metric("troupe_store_sessions_total{result=\"left_out\"}", "2")
        .await;
    assert_eq!(server.get("/v1/sessions/s-2").await.status(), StatusCode::OK);
    tokio::time::sleep(Duration::from_millis(100)).await;
    server.handle.shut_down().await;
    let mut records = Records::open(&folder.0).unwrap();
    assert_eq!(records.all(Kind::Session).unwrap().len(), 1);
}

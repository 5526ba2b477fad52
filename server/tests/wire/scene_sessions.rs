//! Sessions in scenes: living there while they change, and seeing what is in reach; folders of
//! scenes.

use serde_json::Value;
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_proto::v1;

use crate::common::TestServer;
use crate::common::calls::{options, step, walk};
use crate::common::scenes::{STOOL, YARD, put_scene, put_stool, scenes};

/// A session that lives in the yard.
fn inside(id: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        scene: "yard".into(),
        ..options(id)
    }
}

async fn create(
    server: &TestServer,
    sessions: Vec<v1::SessionOptions>,
) -> Result<Vec<v1::Session>, tonic::Status> {
    let request = v1::CreateSessionsRequest { sessions };
    let answer = server.sessions().await.create_sessions(request).await?;
    Ok(answer.into_inner().sessions)
}

fn reason(status: &tonic::Status) -> (Code, String) {
    (status.code(), status.get_details_error_info().unwrap().reason)
}

#[tokio::test]
async fn sessions_live_in_a_scene_that_changes_under_them() {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, YARD).await.unwrap();
    let unknown = v1::SessionOptions {
        scene: "park".into(),
        ..options("b")
    };
    let refused = create(&server, vec![inside("a"), unknown]).await.unwrap_err();
    assert_eq!(reason(&refused), (Code::NotFound, "UNKNOWN_SCENE".into()));
    assert_eq!(
        refused.get_details_error_info().unwrap().metadata["field"],
        "sessions[1].scene"
    );
    let opened = create(&server, vec![inside("a"), inside("b"), options("c")])
        .await
        .unwrap();
    let scenes_of_sessions: Vec<&str> = opened.iter().map(|session| session.scene.as_str()).collect();
    assert_eq!(scenes_of_sessions, ["yard", "yard", ""]);
    assert_eq!(
        opened[0].activity.as_ref().unwrap().kind(),
        v1::ActivityKind::Locomotion
    );

    let asked = || v1::GetSceneRequest {
        name: "yard".into(),
        ..v1::GetSceneRequest::default()
    };
    assert_eq!(client.get_scene(asked()).await.unwrap().into_inner().sessions, 2);
    let delete = || v1::DeleteSceneRequest { name: "yard".into() };
    let in_use = client.delete_scene(delete()).await.unwrap_err();
    assert_eq!(reason(&in_use), (Code::FailedPrecondition, "SCENE_IN_USE".into()));
    assert!(
        in_use.message().starts_with("2 sessions are in scene"),
        "{}",
        in_use.message()
    );

    // They go on while it is replaced.
    let mut sessions = server.sessions().await;
    let commands = vec![walk("a", 1, (0.0, 1.0))];
    let first = sessions
        .step(step(&["a", "b"], 20, commands))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(first.blocks[0].slots.len(), 2);
    let moved = YARD.replace("position_m = [0.0, 0.0, 2.0]", "position_m = [0.0, 0.0, 3.0]");
    let summary = put_scene(&mut client, &moved).await.unwrap();
    assert_eq!(summary.sessions, 2);
    let then = sessions
        .step(step(&["a", "b"], 20, vec![]))
        .await
        .unwrap()
        .into_inner();
    assert_eq!((then.problems.len(), then.blocks[0].frame_count), (0, 20));

    let close = v1::CloseSessionsRequest {
        ids: vec!["a".into(), "b".into()],
    };
    sessions.close_sessions(close).await.unwrap();
    client.delete_scene(delete()).await.unwrap();
}

#[tokio::test]
async fn what_is_in_reach_is_detected() {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, YARD).await.unwrap();
    create(&server, vec![inside("a"), options("outside")])
        .await
        .unwrap();
    let ahead = |ahead| v1::DetectRequest {
        session_id: "a".into(),
        ahead,
        ..v1::DetectRequest::default()
    };
    let mut detect = async |request| client.detect(request).await.map(|answer| answer.into_inner());
    // It stands at the origin and faces +Z; the stool is 2 m ahead and reaches 0.8 m, the character
    // 0.25 m.
    assert!(detect(ahead(0.0)).await.unwrap().objects.is_empty());
    let found = detect(ahead(2.0)).await.unwrap();
    assert_eq!((found.scene.as_str(), found.objects.len()), ("yard", 1));
    let stool = &found.objects[0];
    assert_eq!(stool.object.as_ref().unwrap().id, "stool-1");
    assert!((stool.share - 0.475).abs() < 1e-3, "{stool:?}");
    assert!((stool.distance - 2.1).abs() < 0.2, "{stool:?}");
    // It is turned around: it faces the character, which comes from its front.
    assert!(stool.side.abs() < 1e-3 && stool.off == 0.0, "{stool:?}");
    assert_eq!(
        (stool.approach.as_str(), stool.variants[0].name.as_str()),
        ("front", "sit")
    );
    assert!(stool.free && stool.usable);

    let from_the_left = |convention: v1::Convention, unit: f32, center, half| v1::DetectRequest {
        r#box: Some(v1::DetectBox {
            scene: "yard".into(),
            center: Some(center),
            half_extents: Some(half),
            ..v1::DetectBox::default()
        }),
        convention: convention.into(),
        ahead: unit,
        ..v1::DetectRequest::default()
    };
    let vec3 = |x, y, z| v1::Vec3 { x, y, z };
    let native = from_the_left(
        v1::Convention::Native,
        0.0,
        vec3(0.9, 0.5, 2.0),
        vec3(0.2, 0.2, 0.3),
    );
    let unreal = from_the_left(
        v1::Convention::Unreal,
        0.0,
        vec3(200.0, -90.0, 50.0),
        vec3(30.0, 20.0, 20.0),
    );
    let (native, unreal) = (detect(native).await.unwrap(), detect(unreal).await.unwrap());
    let (native, unreal) = (&native.objects[0], &unreal.objects[0]);
    // The world's left is the right of what faces back: a quarter turn, the other way round for
    // Unreal.
    assert!(
        (native.side + std::f32::consts::FRAC_PI_2).abs() < 1e-3,
        "{native:?}"
    );
    assert!(
        (native.off - std::f32::consts::FRAC_PI_4).abs() < 1e-3,
        "{native:?}"
    );
    assert!(
        (unreal.side + native.side).abs() < 1e-3 && (unreal.distance - 100.0 * native.distance).abs() < 0.01
    );

    for (request, code, reason) in [
        (
            v1::DetectRequest {
                session_id: "outside".into(),
                ..v1::DetectRequest::default()
            },
            Code::FailedPrecondition,
            "NO_SCENE",
        ),
        (ahead(101.0), Code::InvalidArgument, "INVALID_FIELD"),
    ] {
        let status = detect(request).await.unwrap_err();
        assert_eq!(self::reason(&status), (code, reason.to_owned()));
    }
}

#[tokio::test]
async fn folders_are_read_at_start_and_keep_what_is_uploaded() {
    let folder = std::env::temp_dir().join(format!("troupe-scenes-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let (objects, kept) = (folder.join("objects"), folder.join("scenes"));
    std::fs::create_dir_all(objects.join("toy")).unwrap();
    std::fs::write(objects.join("toy/stool.toml"), STOOL).unwrap();
    let start = || {
        let (objects, kept) = (objects.clone(), kept.clone());
        TestServer::start_unready(
            move |config| (config.objects, config.scenes) = (Some(objects), Some(kept)),
            std::time::Duration::ZERO,
        )
    };
    let mut server = start().await;
    server.handle.ready().await.unwrap();
    put_scene(&mut scenes(&server).await, YARD).await.unwrap();
    server.handle.shut_down().await;
    let mut server = start().await;
    server.handle.ready().await.unwrap();
    let list: Value = server.get("/v1/scenes").await.json().await.unwrap();
    assert_eq!(list["scenes"][0]["objects"], 2);
    server.handle.shut_down().await;
    std::fs::write(kept.join("park.toml"), YARD).unwrap();
    let mut server = start().await;
    // A file that is not named for what is in it does not keep the server from starting.
    server.handle.ready().await.unwrap();
    let list: Value = server.get("/v1/scenes").await.json().await.unwrap();
    assert_eq!(list["scenes"][0]["name"], "yard");
    assert_eq!(list["scenes"].as_array().unwrap().len(), 1);
    server.handle.shut_down().await;
    std::fs::remove_dir_all(&folder).unwrap();
}

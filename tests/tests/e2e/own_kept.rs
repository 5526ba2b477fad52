//! Characters on a skeleton of the user's own over time: at every frame rate, and over a restart.

use std::path::Path;

use troupe_client::{Key, Pack};
use troupe_motion::Vec3;
use troupe_motion::clip::Clip;
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;
use troupe_proto::v1::sessions_client::SessionsClient;

use crate::cli::Folder;
use crate::motion::walk;
use crate::own_skeleton::{SCALE, hero, joints, put};
use crate::server::{Server, shared};

/// A session that begins in a walk of the hero, as floats.
struct Worn {
    rpc: SessionsClient<tonic::transport::Channel>,
    id: String,
}

impl Worn {
    async fn start(server: &Server, id: &str, name: &str, clip: &Clip) -> Self {
        let mut rpc = SessionsClient::new(server.channel().await);
        let context = (37..41).map(|frame| Key::from_clip(clip, frame).unwrap().to_message());
        let options = v1::SessionOptions {
            id: id.to_owned(),
            seed: 5,
            skeleton: name.to_owned(),
            context: context.collect(),
            ..v1::SessionOptions::default()
        };
        let request = v1::CreateSessionsRequest {
            sessions: vec![options],
        };
        rpc.create_sessions(request).await.unwrap();
        let id = id.to_owned();
        Self { rpc, id }
    }

    /// The next frames: roots, and rotations of all joints.
    async fn step(&mut self, frames: u32, rate_hz: u32, velocity: Option<(u64, Vec3)>) -> Vec<Vec<f32>> {
        let command = |(sequence, Vec3 { x, y, z })| v1::Command {
            session_id: self.id.clone(),
            sequence,
            intent: Some(v1::command::Intent::Locomote(v1::Locomote {
                velocity: Some(v1::Vec3 { x, y, z }),
                ..v1::Locomote::default()
            })),
            ..v1::Command::default()
        };
        let request = v1::StepRequest {
            session_ids: vec![self.id.clone()],
            commands: velocity.map(command).into_iter().collect(),
            frames,
            rate_hz,
            ..v1::StepRequest::default()
        };
        let answer = self.rpc.step(request).await.unwrap().into_inner();
        assert!(answer.problems.is_empty(), "{:?}", answer.problems);
        let block = &answer.blocks[0];
        let joints = block.rotations.len() / block.root_positions.len() * 3;
        let roots = block.root_positions.chunks(3);
        let poses = block.rotations.chunks(joints);
        roots
            .zip(poses)
            .map(|(root, pose)| [root, pose].concat())
            .collect()
    }
}

/// The example's walk on the hero.
fn own_walk(pack: &Pack, worn: &Pack) -> Clip {
    let clip = walk(pack);
    let roots = clip.root_positions.iter().map(|root| SCALE * *root).collect();
    let skeleton = worn.skeleton().clone();
    Clip::new(skeleton, clip.fps, roots, clip.rotations).unwrap()
}

#[tokio::test]
async fn a_restart_changes_no_bit_of_the_frames_that_follow() {
    let folder = Folder::new("own-restart");
    let kept = folder.file("store");
    let start = async || {
        let store = kept.clone();
        Server::start_with(move |config| config.store = Some(store)).await
    };
    let server = start().await;
    let (_, pack, worn) = hero(&server, "hero").await;
    let clip = own_walk(&pack, &worn);
    let mut one = Worn::start(&server, "one", "hero", &clip).await;
    let mut other = Worn::start(&server, "other", "hero", &clip).await;
    let go = Some((1, SCALE * Vec3::new(0.8, 0.0, 0.8)));
    // The way from the given pose has not ended.
    assert_eq!(one.step(7, 60, go).await, other.step(7, 60, go).await);
    let through = one.step(80, 60, None).await;
    assert!(server.stop().await);
    let server = start().await;
    other.rpc = SessionsClient::new(server.channel().await);
    let after = other.step(80, 60, None).await;
    let differ = through.iter().zip(&after).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "of {}", through.len());
    assert!(server.stop().await);
}

#[tokio::test]
async fn frames_of_a_moment_are_the_same_at_every_rate() {
    let server = shared();
    let (_, pack, worn) = hero(server, "rates").await;
    let clip = own_walk(&pack, &worn);
    let mut walks = Vec::new();
    for (rate_hz, every) in [(30, 3), (50, 5), (60, 6)] {
        let id = format!("rate-{rate_hz}");
        let mut session = Worn::start(server, &id, "rates", &clip).await;
        let go = Some((1, SCALE * Vec3::new(0.8, 0.0, 0.8)));
        let frames = session.step(every * 20, rate_hz, go).await;
        let tenths = frames.into_iter().skip(every as usize - 1);
        walks.push(tenths.step_by(every as usize).collect::<Vec<_>>());
    }
    for walk in &walks[1..] {
        let pairs = walks[0].iter().flatten().zip(walk.iter().flatten());
        let apart = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("{apart}");
        assert!(apart < 0.02, "{apart}");
    }
}

#[tokio::test]
async fn a_file_goes_up_as_it_is_and_survives_a_restart() {
    let folder = Folder::new("own-skeleton");
    let kept = folder.file("store");
    let start = async || {
        let store = kept.clone();
        Server::start_with(move |config| config.store = Some(store)).await
    };
    let server = start().await;
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/walk.bvh");
    let bvh = std::fs::read(example).unwrap();
    let send = |server: &Server| {
        let url = format!("{}/v1/skeletons/hero?file=hero.bvh", server.url());
        let request = reqwest::Client::new().put(url);
        request
            .header("content-type", "application/octet-stream")
            .body(bvh.clone())
    };
    let answer = send(&server).send().await.unwrap();
    assert_eq!(answer.status(), 200, "{}", answer.text().await.unwrap());
    assert!(server.stop().await);
    let server = start().await;
    let (client, pack) = server.client().await;
    let own = client.skeleton("hero", &pack).await.unwrap();
    assert_eq!(own.joints.len(), pack.skeleton().joint_count());
    // The same upload again changes nothing.
    assert_eq!(send(&server).send().await.unwrap().status(), 200);
    let url = format!("{}/v1/skeletons/hero", server.url());
    let text = reqwest::Client::new()
        .put(url)
        .header("content-type", "text/plain");
    let answer = text.body("a hero").send().await.unwrap();
    assert_eq!(answer.status(), 415);
    let error = answer.text().await.unwrap();
    for kind in ["json", "octet-stream", "xml"] {
        assert!(error.contains(&format!("application/{kind}")), "{error}");
    }
    assert!(error.contains("model/gltf-binary"), "{error}");
    server.stop().await;
}

#[tokio::test]
async fn a_skeleton_that_cannot_be_kept_is_not_there() {
    let folder = Folder::new("own-full");
    let kept = folder.file("store");
    let store = kept.clone();
    let server = Server::start_with(move |config| config.store = Some(store)).await;
    let (client, pack) = server.client().await;
    let request = v1::PutSkeletonRequest {
        name: "lost".to_owned(),
        source: Some(Source::Joints(joints(&client, &pack).await)),
        ..v1::PutSkeletonRequest::default()
    };
    // Nothing can be written into a file.
    let skeletons = kept.join("skeletons");
    let _ = std::fs::remove_dir_all(&skeletons);
    std::fs::write(&skeletons, "").unwrap();
    let error = put(&server, request.clone()).await.unwrap_err().to_string();
    assert!(error.contains("cannot be written to its folder"), "{error}");
    assert_eq!(client.skeletons().await.unwrap().len(), 0);
    std::fs::remove_file(&skeletons).unwrap();
    put(&server, request).await.unwrap();
    assert_eq!(client.skeletons().await.unwrap().len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn a_session_whose_skeleton_has_changed_is_not_restored() {
    let folder = Folder::new("own-changed");
    let kept = folder.file("store");
    let start = async || {
        let store = kept.clone();
        Server::start_with(move |config| config.store = Some(store)).await
    };
    let server = start().await;
    let (_, pack, worn) = hero(&server, "hero").await;
    let clip = own_walk(&pack, &worn);
    Worn::start(&server, "one", "hero", &clip)
        .await
        .step(3, 30, None)
        .await;
    assert!(server.stop().await);
    // The skeleton in another size.
    let file = kept.join("skeletons").join("hero.json");
    let mut doc: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    let body = &mut doc["body"]["joints"];
    let larger = |number: &mut serde_json::Value| *number = (1.1 * number.as_f64().unwrap()).into();
    larger(&mut body["root_y_m"]);
    for joint in body["joints"].as_array_mut().unwrap() {
        joint["offset_m"]
            .as_array_mut()
            .unwrap()
            .iter_mut()
            .for_each(larger);
    }
    std::fs::write(&file, doc.to_string()).unwrap();
    let server = start().await;
    let (client, _) = server.client().await;
    let error = client.session_info("one").await.unwrap_err().to_string();
    assert!(error.contains("no session has the id"), "{error}");
    server.stop().await;
}

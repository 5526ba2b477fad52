//! Characters on a skeleton of the user's own: sessions, in-betweens and paths in its size.

use std::path::Path;

use troupe_client::{Client, FollowPath, InBetween, Key, Locomotion, Pack, SessionOptions};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::rotation::angle_between;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_proto::v1::skeletons_client::SkeletonsClient;

use crate::cli::Folder;
use crate::motion::walk;
use crate::server::{Server, shared};

/// Size of the hero by that of the pack's body.
const SCALE: f32 = 1.5;

/// The pack's skeleton in another size and with other names, in the pose in which a character
/// stands at first.
async fn joints(client: &Client, pack: &Pack) -> v1::BodySkeleton {
    let skeleton = pack.skeleton();
    let name = |index: usize| format!("hero_{}", skeleton.joints[index].name);
    let joint = |index: usize| {
        let joint = &skeleton.joints[index];
        let Vec3 { x, y, z } = SCALE * joint.offset_m;
        v1::BodyJoint {
            name: name(index),
            parent: joint.parent.map(name).unwrap_or_default(),
            offset: Some(v1::Vec3 { x, y, z }),
        }
    };
    let mut joints: Vec<_> = (0..skeleton.joint_count()).map(joint).collect();
    // The root's offset has no meaning.
    joints[0].offset = Some(v1::Vec3 {
        x: 0.0,
        y: 1.0,
        z: 0.0,
    });
    let mut session = client.session(pack, &SessionOptions::new()).await.unwrap();
    let mut standing = troupe_client::Recording::of(&session);
    let frames = session.step(1).await.unwrap();
    frames.iter().for_each(|frame| standing.push(frame));
    session.close().await.unwrap();
    let standing = WorldMotion::from_clip(&standing.into_clip().unwrap());
    let quat = |turn: Quat| {
        let [x, y, z, w] = turn.to_array();
        v1::Quat { w, x, y, z }
    };
    v1::BodySkeleton {
        joints,
        neutral: standing.rotations_at(0).iter().copied().map(quat).collect(),
        ..v1::BodySkeleton::default()
    }
}

async fn put(server: &Server, request: v1::PutSkeletonRequest) -> Result<v1::OwnSkeleton, tonic::Status> {
    let mut rpc = SkeletonsClient::new(server.channel().await);
    rpc.put_skeleton(request).await.map(tonic::Response::into_inner)
}

/// The hero on a server, and the pack that wears it.
async fn hero(server: &Server, name: &str) -> (Client, Pack, Pack) {
    let (client, pack) = server.client().await;
    let request = v1::PutSkeletonRequest {
        name: name.to_owned(),
        source: Some(Source::Joints(joints(&client, &pack).await)),
        ..v1::PutSkeletonRequest::default()
    };
    let own = put(server, request).await.unwrap();
    let fit = own.fit.as_ref().unwrap();
    assert!((fit.scale - SCALE).abs() < 0.02, "{}", fit.scale);
    assert!(
        fit.faults.is_empty() && !fit.trials.is_empty(),
        "{:?}",
        fit.faults
    );
    let worn = pack.wearing(&own).unwrap();
    (client, pack, worn)
}

/// World positions of a clip's joints.
fn places(clip: &Clip) -> Vec<Vec3> {
    let world = WorldMotion::from_clip(clip);
    (0..clip.frames())
        .flat_map(|frame| world.positions_at(frame).to_vec())
        .collect()
}

/// The mean distance between the hero's joints and the pack's, in the hero's size. The hero's
/// neutral pose is another than the pack's, so that they differ by some degrees.
fn apart_m(hero: &Clip, pack: &Clip) -> f32 {
    let (own, other) = (places(hero), places(pack));
    assert_eq!(own.len(), other.len());
    let pairs = own.iter().zip(other);
    pairs.map(|(own, other)| own.distance(SCALE * other)).sum::<f32>() / own.len() as f32
}

/// The largest distance between the hero's root and the pack's, in the hero's size.
fn roots_apart_m(hero: &Clip, pack: &Clip) -> f32 {
    let pairs = hero.root_positions.iter().zip(&pack.root_positions);
    pairs
        .map(|(own, other)| own.distance(SCALE * *other))
        .fold(0.0, f32::max)
}

async fn walked(client: &Client, pack: &Pack, scale: f32) -> Clip {
    let options = SessionOptions::new().seed(3).at(Vec3::new(scale, 0.0, 0.0), 0.4);
    let mut session = client.session(pack, &options).await.unwrap();
    let mut recording = troupe_client::Recording::of(&session);
    for velocity in [Vec3::Z, Vec3::new(0.7, 0.0, 0.7)] {
        session.set_intent(Locomotion::walk(scale * 1.2 * velocity));
        let frames = session.step(45).await.unwrap();
        frames.iter().for_each(|frame| recording.push(frame));
    }
    session.close().await.unwrap();
    recording.into_clip().unwrap()
}

#[tokio::test]
async fn a_session_walks_in_the_size_of_its_skeleton() {
    let server = shared();
    let (client, pack, worn) = hero(server, "walker").await;
    let (own, other) = (
        walked(&client, &worn, SCALE).await,
        walked(&client, &pack, 1.0).await,
    );
    let (apart, roots) = (apart_m(&own, &other), roots_apart_m(&own, &other));
    assert!(apart < 0.07 && roots < 0.07, "{apart} m, roots {roots} m");
    let listed = client.skeletons().await.unwrap();
    let walker = listed.iter().find(|own| own.name == "walker").unwrap();
    assert_eq!(walker.joint_count as usize, pack.skeleton().joint_count());
}

#[tokio::test]
async fn a_worn_skeleton_is_named_and_stays_until_no_one_wears_it() {
    let server = shared();
    let (client, pack, worn) = hero(server, "keeper").await;
    let mut session = client
        .session(&worn, &SessionOptions::new().seed(1))
        .await
        .unwrap();
    let info = client.session_info(session.id()).await.unwrap();
    assert_eq!(info.skeleton, "keeper");
    let error = client.delete_skeleton("keeper").await.unwrap_err().to_string();
    assert!(error.contains("1 sessions wear skeleton"), "{error}");
    let other = v1::PutSkeletonRequest {
        name: "keeper".to_owned(),
        source: Some(Source::Joints(v1::BodySkeleton {
            contact_joints: Vec::new(),
            ..joints(&client, &pack).await
        })),
        force: true,
        ..v1::PutSkeletonRequest::default()
    };
    let error = put(server, other).await.unwrap_err();
    assert_eq!(error.code(), tonic::Code::FailedPrecondition, "{error}");
    // A client that comes back finds its skeleton.
    let again = client.resume_session(session.id()).await.unwrap();
    assert_eq!(again.pack().worn(), "keeper");
    session.step(3).await.unwrap();
    session.close().await.unwrap();
    client.delete_skeleton("keeper").await.unwrap();
    let error = client
        .session(&worn, &SessionOptions::new())
        .await
        .unwrap_err()
        .to_string();
    assert!(error.contains("there is no skeleton \"keeper\""), "{error}");
}

#[tokio::test]
async fn a_gap_is_filled_between_the_keyframes_of_the_skeleton() {
    let server = shared();
    let (client, pack, worn) = hero(server, "filler").await;
    let of_pack = walk(&pack);
    let roots = of_pack.root_positions.iter().map(|root| SCALE * *root).collect();
    let own = Clip::new(
        worn.skeleton().clone(),
        of_pack.fps,
        roots,
        of_pack.rotations.clone(),
    )
    .unwrap();
    let fill = async |pack: &Pack, clip: &Clip| {
        let gap = InBetween::from_clip(clip, 40, 66).unwrap();
        client.in_between(pack, &gap).await.unwrap().clip
    };
    let (filled, other) = (fill(&worn, &own).await, fill(&pack, &of_pack).await);
    let (apart, roots) = (apart_m(&filled, &other), roots_apart_m(&filled, &other));
    assert!(apart < 0.12 && roots < 0.12, "{apart} m, roots {roots} m");
    for (frame, source) in [(0, 37), (3, 40), (filled.frames() - 1, 66)] {
        let off = filled.root_positions[frame].distance(own.root_positions[source]);
        let pairs = filled.rotations_at(frame).iter().zip(own.rotations_at(source));
        let turned = pairs
            .map(|(a, b): (&Quat, &Quat)| angle_between(*a, *b))
            .fold(0.0, f32::max);
        assert!(
            off < 1e-4 && turned < 2e-3,
            "frame {frame}: {off} m, {turned} rad"
        );
    }
    let steps = filled
        .root_positions
        .windows(2)
        .map(|pair| pair[0].distance(pair[1]));
    assert!(steps.fold(0.0, f32::max) < SCALE * 0.12);
}

#[tokio::test]
async fn a_path_is_walked_in_the_size_of_the_skeleton() {
    let server = shared();
    let (client, pack, worn) = hero(server, "path").await;
    let points = |scale: f32| [Vec3::ZERO, Vec3::new(0.5, 0.0, 3.0)].map(|point| scale * point);
    let make = async |pack: &Pack, scale: f32| {
        let path = FollowPath::along(points(scale)).seconds(3.0).seed(2);
        client
            .follow(pack, &path)
            .await
            .unwrap()
            .whole()
            .await
            .unwrap()
            .clip
    };
    let (own, other) = (make(&worn, SCALE).await, make(&pack, 1.0).await);
    assert_eq!(own.frames(), other.frames());
    let (apart, roots) = (apart_m(&own, &other), roots_apart_m(&own, &other));
    assert!(apart < 0.07 && roots < 0.07, "{apart} m, roots {roots} m");
}

#[tokio::test]
async fn errors_and_notes_say_lengths_in_the_size_of_the_skeleton() {
    let server = shared();
    let (client, pack, worn) = hero(server, "sized").await;
    let mut session = client
        .session(&worn, &SessionOptions::new().seed(1))
        .await
        .unwrap();
    let path = |points: [Vec3; 2], speed: f32| v1::FollowPath {
        points: points
            .map(|Vec3 { x, y, z }| v1::PathPoint {
                position: Some(v1::Vec3 { x, y, z }),
                ..v1::PathPoint::default()
            })
            .to_vec(),
        speed: Some(speed),
        ..v1::FollowPath::default()
    };
    let mut rpc = SessionsClient::new(server.channel().await);
    let mut refused = async |sequence: u64, path: v1::FollowPath| {
        let command = v1::Command {
            session_id: session.id().to_owned(),
            sequence,
            intent: Some(v1::command::Intent::FollowPath(path)),
            ..v1::Command::default()
        };
        let request = v1::StepRequest {
            session_ids: vec![session.id().to_owned()],
            commands: vec![command],
            ..v1::StepRequest::default()
        };
        let answer = rpc.step(request).await.unwrap().into_inner();
        answer.commands[0].problem.as_ref().map(|found| format!("{}; {}", found.message, found.allowed))
    };
    let fast = refused(1, path([Vec3::ZERO, Vec3::Z], 30.0)).await.unwrap();
    assert!(fast.contains("is 30 m/s; allowed: 0.075 to 22.5 m/s"), "{fast}");
    let far = refused(2, path([30.0 * Vec3::X, Vec3::Z], 1.0)).await.unwrap();
    assert!(far.contains("the path begins 30.0") && far.contains("at most 7.5 m"), "{far}");
    session.close().await.unwrap();

    let follow = async |seconds: f32, is_strict: bool| {
        let path = FollowPath::along([Vec3::ZERO, 30.0 * Vec3::Z]).seconds(seconds);
        client.follow(&worn, &path.strict(is_strict)).await
    };
    let error = follow(0.5, false).await.unwrap_err().to_string();
    assert!(
        error.contains("is reached at 60.0 m/s; allowed: at most 22.5 m/s"),
        "{error}"
    );
    let slow = follow(3.0, true).await.unwrap_err().to_string();
    assert!(slow.contains("moves the root at 10."), "{slow}");
    let made = follow(3.0, false).await.unwrap().whole().await.unwrap();
    let note = made.notes.first().unwrap();
    assert!(note.contains("the path goes at 10.0 m/s"), "{note}");

    // A gap whose target is 30 m away.
    let of_pack = walk(&pack);
    let mut roots: Vec<Vec3> = of_pack.root_positions.iter().map(|root| SCALE * *root).collect();
    roots[66] = roots[40] + 30.0 * Vec3::X;
    let own = Clip::new(worn.skeleton().clone(), of_pack.fps, roots, of_pack.rotations.clone()).unwrap();
    let gap = InBetween::from_clip(&own, 40, 66).unwrap().strict(true);
    let error = client.in_between(&worn, &gap).await.unwrap_err().to_string();
    println!("{error}");
    assert!(error.contains("is 2") && error.contains(" m over the ground"), "{error}");
}

#[tokio::test]
async fn what_does_not_fit_is_refused_with_the_field() {
    let server = shared();
    let (client, pack) = server.client().await;
    let named = |name: &str, source| v1::PutSkeletonRequest {
        name: name.to_owned(),
        source,
        ..v1::PutSkeletonRequest::default()
    };
    let good = joints(&client, &pack).await;
    let file = |name: &str, data: &[u8]| {
        Some(Source::File(v1::SkeletonFile {
            name: name.to_owned(),
            data: data.to_vec(),
        }))
    };
    let fits = put(server, named("fits", Some(Source::Joints(good.clone()))))
        .await
        .unwrap();
    // Left is right.
    let swapped = fits
        .parts
        .replace("_L\"", "_#\"")
        .replace("_R\"", "_L\"")
        .replace("_#\"", "_R\"");
    for (request, field) in [
        (named("../up", Some(Source::Joints(good.clone()))), "name"),
        (named("a", None), "source"),
        (named("a", file("hero.fbx", b"")), "file.name"),
        (named("a", file("hero.glb", b"glTF")), "file.data"),
        (named("a", file("robot.urdf", b"<robot/>")), "file.data"),
        (
            v1::PutSkeletonRequest {
                parts: "[left_leg".to_owned(),
                ..named("a", Some(Source::Joints(good.clone())))
            },
            "parts",
        ),
        (
            v1::PutSkeletonRequest {
                parts: swapped,
                ..named("a", Some(Source::Joints(good.clone())))
            },
            "source",
        ),
        (
            named("a", Some(Source::Joints(v1::BodySkeleton::default()))),
            "joints",
        ),
    ] {
        let error = put(server, request).await.unwrap_err();
        let found = crate::server::ErrorAnswer::from_status(&error);
        assert_eq!(error.code(), tonic::Code::InvalidArgument, "{error}");
        assert!(
            found
                .field
                .as_deref()
                .is_some_and(|found| found.starts_with(field)),
            "{field}: {error:?}"
        );
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
    let text = reqwest::Client::new().put(url).header("content-type", "text/plain");
    let answer = text.body("a hero").send().await.unwrap();
    assert_eq!(answer.status(), 415);
    let error = answer.text().await.unwrap();
    for kind in ["json", "octet-stream", "xml"] {
        assert!(error.contains(&format!("application/{kind}")), "{error}");
    }
    assert!(error.contains("model/gltf-binary"), "{error}");
    server.stop().await;
}

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
        roots.zip(poses).map(|(root, pose)| [root, pose].concat()).collect()
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

//! Characters on a skeleton of the user's own: sessions, in-betweens and paths in its size.

use troupe_client::{Client, FollowPath, InBetween, Locomotion, Pack, SessionOptions};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::rotation::angle_between;
use troupe_motion::{Joint, Quat, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;
use troupe_proto::v1::sessions_client::SessionsClient;
use troupe_proto::v1::skeletons_client::SkeletonsClient;

use crate::motion::walk;
use crate::server::{Server, shared};

/// Size of the hero by that of the pack's body.
pub const SCALE: f32 = 1.5;

/// The pack's skeleton in another size and with other names, in the pose in which a character
/// stands at first.
pub async fn joints(client: &Client, pack: &Pack) -> v1::BodySkeleton {
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

pub async fn put(server: &Server, request: v1::PutSkeletonRequest) -> Result<v1::OwnSkeleton, tonic::Status> {
    let mut rpc = SkeletonsClient::new(server.channel().await);
    rpc.put_skeleton(request).await.map(tonic::Response::into_inner)
}

/// The hero on a server, and the pack that wears it.
pub async fn hero(server: &Server, name: &str) -> (Client, Pack, Pack) {
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
    // Nothing says how far soles are below the joints, and the server takes the hero's to be
    // nearer.
    let lower = Vec3::Y * 0.032;
    let roots = of_pack.root_positions.iter();
    let roots = roots.map(|root| SCALE * *root - lower).collect();
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
    // Feet do not dip into the ground, nor where the given poses end.
    let lowest = |clip: &Clip| {
        let toe = |joint: &Joint| joint.name.contains("Toes");
        let joints = clip.skeleton.joints.iter();
        let toes: Vec<usize> = joints
            .enumerate()
            .filter(|(_, of)| toe(of))
            .map(|(toe, _)| toe)
            .collect();
        let world = WorldMotion::from_clip(clip);
        let heights = (0..clip.frames()).flat_map(|frame| toes.iter().map(move |&toe| (frame, toe)));
        let heights = heights.map(|(frame, toe)| world.positions_at(frame)[toe].y);
        heights.fold(f32::INFINITY, f32::min)
    };
    let (low, given) = (lowest(&filled), lowest(&own));
    assert!(low > given - 0.01, "{low} m, and {given} m in the walk");
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
    let session = client
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
        answer.command_results[0]
            .problem
            .as_ref()
            .map(|found| format!("{}; {}", found.message, found.allowed))
    };
    let fast = refused(1, path([Vec3::ZERO, Vec3::Z], 30.0)).await.unwrap();
    assert!(fast.contains("is 30 m/s; allowed: 0.075 to 22.5 m/s"), "{fast}");
    let far = refused(2, path([30.0 * Vec3::X, Vec3::Z], 1.0)).await.unwrap();
    assert!(
        far.contains("the path begins 30.0") && far.contains("at most 7.5 m"),
        "{far}"
    );
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
    let own = Clip::new(
        worn.skeleton().clone(),
        of_pack.fps,
        roots,
        of_pack.rotations.clone(),
    )
    .unwrap();
    let gap = InBetween::from_clip(&own, 40, 66).unwrap().strict(true);
    let error = client.in_between(&worn, &gap).await.unwrap_err().to_string();
    println!("{error}");
    assert!(
        error.contains("is 2") && error.contains(" m over the ground"),
        "{error}"
    );
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
    let forced = v1::PutSkeletonRequest {
        parts: swapped.clone(),
        force: true,
        ..named("forced", Some(Source::Joints(good.clone())))
    };
    let forced = put(server, forced).await.unwrap();
    assert!(forced.forced && !forced.fit.as_ref().unwrap().faults.is_empty());
    let worn = pack.wearing(&forced).unwrap();
    let session = client.session(&worn, &SessionOptions::new()).await.unwrap();
    session.close().await.unwrap();
    // Not even by force.
    let mut tiny = good.clone();
    let offsets = tiny.joints.iter_mut().filter_map(|joint| joint.offset.as_mut());
    for offset in offsets {
        (offset.x, offset.y, offset.z) = (0.02 * offset.x, 0.02 * offset.y, 0.02 * offset.z);
    }
    let tiny = v1::PutSkeletonRequest {
        force: true,
        ..named("tiny", Some(Source::Joints(tiny)))
    };
    let error = put(server, tiny).await.unwrap_err().to_string();
    assert!(
        error.contains("its legs are 0.03") && error.contains("0.05 to 20"),
        "{error}"
    );
    // A neck of 5 m.
    let mut giraffe = good.clone();
    let is_head = |joint: &&mut v1::BodyJoint| joint.name == "hero_Head";
    let neck = giraffe.joints.iter_mut().find(is_head).unwrap().offset.as_mut();
    let neck = neck.unwrap();
    let by = 9.0 / Vec3::new(neck.x, neck.y, neck.z).length();
    (neck.x, neck.y, neck.z) = (by * neck.x, by * neck.y, by * neck.z);
    let error = put(server, named("giraffe", Some(Source::Joints(giraffe))))
        .await
        .unwrap_err();
    let said = crate::server::ErrorAnswer::from_status(&error).message;
    assert!(
        said.contains("the neck is 9.") && said.contains("m of it to hero_Head; allowed: 0.00 to "),
        "{said}"
    );
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
                parts: swapped.clone(),
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
async fn a_session_begins_with_the_first_joint_of_its_skeleton() {
    let server = shared();
    let (client, pack) = server.client().await;
    // A first joint half a metre beside the hips.
    let mut beside = joints(&client, &pack).await;
    beside.joints[0].parent = "beside".to_owned();
    beside.joints[0].offset = Some(v1::Vec3 {
        x: 0.5,
        y: 0.0,
        z: 0.0,
    });
    beside.joints.insert(
        0,
        v1::BodyJoint {
            name: "beside".to_owned(),
            ..v1::BodyJoint::default()
        },
    );
    let still = v1::Quat {
        w: 1.0,
        ..v1::Quat::default()
    };
    beside.neutral.insert(0, still);
    let request = v1::PutSkeletonRequest {
        name: "beside".to_owned(),
        source: Some(Source::Joints(beside)),
        ..v1::PutSkeletonRequest::default()
    };
    let own = put(server, request).await.unwrap();
    let worn = pack.wearing(&own).unwrap();
    let place = Vec3::new(2.0, 0.0, 1.0);
    let options = SessionOptions::new().seed(1).at(place, 0.7);
    let mut session = client.session(&worn, &options).await.unwrap();
    let mut recording = troupe_client::Recording::of(&session);
    session
        .step(1)
        .await
        .unwrap()
        .iter()
        .for_each(|frame| recording.push(frame));
    let info = client.session_info(session.id()).await.unwrap();
    session.close().await.unwrap();
    let root = recording.into_clip().unwrap().root_positions[0];
    assert!((root - place).with_y(0.0).length() < 0.1, "{root}");
    let said = info.position.unwrap();
    assert!(
        root.distance(Vec3::new(said.x, said.y, said.z)) < 1e-4,
        "{root} {said:?}"
    );
}

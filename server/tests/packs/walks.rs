//! Generate along a path with packs that go from keyframe to keyframe: they walk.

use std::path::Path;

use futures_util::future::join_all;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;
use troupe_server::server::ServerHandle;

use super::{Client, served};

async fn start(pack: &str) -> (ServerHandle, Client) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models").join(pack);
    served(&folder).await
}

fn point(x: f32, z: f32, time: f32) -> v1::PathPoint {
    v1::PathPoint {
        position: Some(v1::Vec3 { x, y: 0.0, z }),
        heading: None,
        time: Some(time),
    }
}

/// Five metres ahead, at 1 m/s.
fn ahead() -> v1::PathGoal {
    v1::PathGoal {
        points: vec![point(0.0, 0.0, 0.0), point(0.0, 5.0, 5.0)],
        ..v1::PathGoal::default()
    }
}

fn asking(goal: v1::PathGoal, seed: u64) -> v1::GenerateRequest {
    v1::GenerateRequest {
        goal: Some(Goal::Path(goal)),
        seed,
        ..v1::GenerateRequest::default()
    }
}

async fn answer(client: &Client, request: v1::GenerateRequest) -> Result<Vec<v1::GenerateResponse>, Status> {
    let mut stream = client.clone().generate(request).await?.into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await? {
        parts.push(part);
    }
    Ok(parts)
}

/// All frames of an answer as one.
fn whole(parts: &[v1::GenerateResponse]) -> v1::Frames {
    let mut whole = v1::Frames::default();
    for part in parts {
        let Some(Part::Frames(frames)) = &part.part else {
            panic!("{part:?}")
        };
        whole.frame_count += frames.frame_count;
        whole.root_positions.extend(&frames.root_positions);
        whole.rotations.extend(&frames.rotations);
        whole.contacts.extend(&frames.contacts);
        whole.qpos.extend(&frames.qpos);
    }
    whole
}

/// A frame of an answer as a keyframe, moved over the ground.
fn key(frames: &v1::Frames, frame: usize, (x, z): (f32, f32)) -> v1::Keyframe {
    let joints = frames.rotations.len() / 4 / frames.frame_count as usize;
    let root = &frames.root_positions[frame * 3..frame * 3 + 3];
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x: root[0] + x,
                y: root[1],
                z: root[2] + z,
            }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: frames.rotations[frame * joints * 4..(frame + 1) * joints * 4].to_vec(),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

/// How far a frame is from a keyframe: its root in metres, its farthest joint in radians.
fn off(frames: &v1::Frames, frame: usize, wanted: &v1::Keyframe) -> (f32, f32) {
    let found = key(frames, frame, (0.0, 0.0));
    let place = |key: &v1::Keyframe| key.root.and_then(|root| root.position).unwrap();
    let (a, b) = (place(&found), place(wanted));
    let root = ((a.x - b.x).powi(2) + (a.y - b.y).powi(2) + (a.z - b.z).powi(2)).sqrt();
    let [found, wanted] = [&found, wanted].map(|key| key.pose.clone().unwrap().rotations);
    let joints = found.chunks_exact(4).zip(wanted.chunks_exact(4));
    let angles = joints.map(|(a, b)| {
        let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        2.0 * dot.abs().min(1.0).acos()
    });
    (root, angles.fold(0.0, f32::max))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pack_of_keyframes_walks_along_a_path_part_by_part() {
    for (pack, most_off_m) in [("human", 0.1), ("g1", 0.05)] {
        let (server, client) = start(pack).await;
        let parts = answer(&client, asking(ahead(), 3)).await.unwrap();
        assert!(parts.len() > 4, "{pack}: {} parts", parts.len());
        let last = parts.iter().rposition(|part| !part.is_last);
        assert_eq!(last, Some(parts.len() - 2), "{pack}");
        assert!(parts.iter().all(|part| part.notes.is_empty()), "{pack}");
        let frames = whole(&parts);
        assert_eq!(frames.frame_count, 151, "{pack}");
        for (frame, root) in frames.root_positions.chunks_exact(3).enumerate() {
            let wanted = frame as f32 / 30.0;
            let off = root[0].hypot(root[2] - wanted);
            assert!(off < most_off_m, "{pack}: {off} m off in frame {frame}");
        }
        for part in &parts {
            let verdict = part.feasibility.as_ref().unwrap();
            assert!(verdict.feasible, "{pack}: {verdict:?}");
        }
        let sizes = 151
            * client_pack(&client)
                .await
                .robot
                .map_or(0, |robot| robot.qpos_size as usize);
        assert_eq!(frames.qpos.len(), sizes, "{pack}");

        // The same alone and in company, and another motion for another seed.
        let company =
            (0..8).map(|index| answer(&client, asking(ahead(), if index == 5 { 3 } else { 40 + index })));
        let company = join_all(company).await;
        assert_eq!(company[5].as_ref().unwrap(), &parts, "{pack}");
        assert_ne!(company[4].as_ref().unwrap(), &parts, "{pack}");
        assert!(server.shut_down().await);
    }
}

async fn client_pack(client: &Client) -> v1::Pack {
    let get = v1::GetPackRequest::default();
    client.clone().get_pack(get).await.unwrap().into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn past_keyframes_and_targets_are_met() {
    for pack in ["human", "g1"] {
        let (server, client) = start(pack).await;
        let before = whole(&answer(&client, asking(ahead(), 3)).await.unwrap());
        // It goes on from frame 100, at 3.33 m.
        let from = before.root_positions[100 * 3 + 2];
        let keyframe = key(&before, 60, (0.3, from));
        let goal = v1::PathGoal {
            points: vec![point(0.0, from, 0.0), point(0.5, from + 4.0, 4.0)],
            keyframes: vec![v1::PathKeyframe {
                time: 2.0,
                keyframe: Some(keyframe.clone()),
            }],
            targets: (120..124)
                .map(|frame| key(&before, frame, (0.4, from + 4.0 - 4.1)))
                .collect(),
            ..v1::PathGoal::default()
        };
        let request = v1::GenerateRequest {
            past: (97..101).map(|frame| key(&before, frame, (0.0, 0.0))).collect(),
            ..asking(goal.clone(), 8)
        };
        let frames = whole(&answer(&client, request).await.unwrap());
        assert_eq!(frames.frame_count, 120, "{pack}");
        // Time 0 is the last frame of the past.
        let met = off(&frames, 59, &keyframe);
        assert!(met.0 < 1e-3 && met.1 < 2e-2, "{pack}: {met:?}");
        for (nth, target) in goal.targets.iter().enumerate() {
            let met = off(&frames, 116 + nth, target);
            assert!(met.0 < 1e-3 && met.1 < 2e-2, "{pack}, target {nth}: {met:?}");
        }
        let joined = off(&frames, 0, &key(&before, 100, (0.0, 0.0)));
        assert!(joined.0 < 0.1, "{pack}: {joined:?}");
        let steps = frames.root_positions.windows(6).step_by(3);
        let fastest = steps
            .map(|pair| (pair[3] - pair[0]).hypot(pair[5] - pair[2]))
            .fold(0.0, f32::max);
        assert!(fastest * 30.0 < 3.0, "{pack}: nothing jumps, {fastest}");
        assert!(server.shut_down().await);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_path_too_fast_for_a_style_has_a_note_and_is_refused_if_strict() {
    let (server, client) = start("human").await;
    let fast = v1::PathGoal {
        points: vec![point(0.0, 0.0, 0.0), point(0.0, 30.0, 4.0)],
        ..v1::PathGoal::default()
    };
    let parts = answer(&client, asking(fast.clone(), 1)).await.unwrap();
    assert!(parts[0].notes[0].contains("falls behind"), "{:?}", parts[0].notes);
    let strict = v1::PathGoal { strict: true, ..fast };
    let status = answer(&client, asking(strict, 1)).await.unwrap_err();
    let info = status.get_details_error_info().unwrap();
    assert_eq!(
        (
            status.code(),
            info.reason.as_str(),
            info.metadata["field"].as_str()
        ),
        (Code::InvalidArgument, "NOT_FEASIBLE", "path.points")
    );
    let strict = v1::PathGoal {
        strict: true,
        ..ahead()
    };
    assert!(answer(&client, asking(strict, 1)).await.is_ok());

    let steps = v1::PathGoal {
        steps: Some(4),
        ..ahead()
    };
    let status = answer(&client, asking(steps, 1)).await.unwrap_err();
    assert_eq!(
        status.message(),
        "path.steps: is given; allowed: none: the pack human has no sampler"
    );
    assert!(server.shut_down().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_that_leaves_takes_its_windows_along() {
    let (server, client) = start("human").await;
    let long = v1::PathGoal {
        points: vec![point(0.0, 0.0, 0.0), point(0.0, 300.0, 290.0)],
        ..v1::PathGoal::default()
    };
    let mut stream = client
        .clone()
        .generate(asking(long, 1))
        .await
        .unwrap()
        .into_inner();
    assert!(stream.message().await.unwrap().is_some());
    drop(stream);
    let parts = answer(&client, asking(ahead(), 3)).await.unwrap();
    assert!(parts.last().unwrap().is_last);
    assert!(server.shut_down().await, "nothing is left to wait for");
}

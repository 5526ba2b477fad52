//! Paths of a UniMoGen pack's bodies on two legs that a pack of keyframes plans.

use std::os::unix::fs::symlink;
use std::path::Path;

use tempfile::TempDir;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;
use troupe_motion::fk::world_transforms;
use troupe_motion::{Joint, Quat, Skeleton, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::PathPlanner;
use troupe_proto::v1::generate_request::Goal;
use troupe_proto::v1::generate_response::Part;
use troupe_server::server::ServerHandle;

use super::{Client, served};

/// A server with these packs of `models/`.
async fn start(packs: &[&str]) -> (ServerHandle, Client, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models");
    for pack in packs {
        symlink(models.join(pack), folder.path().join(pack)).unwrap();
    }
    let (server, client) = served(folder.path()).await;
    (server, client, folder)
}

fn point(x: f32, z: f32, time: f32) -> v1::PathPoint {
    v1::PathPoint {
        position: Some(v1::Vec3 { x, y: 0.0, z }),
        heading: None,
        time: Some(time),
    }
}

/// Five metres ahead at 1 m/s, as `word` says.
fn ahead(body: &str, word: &str, planner: PathPlanner) -> v1::PathGoal {
    v1::PathGoal {
        body: body.to_owned(),
        points: vec![point(0.0, 0.0, 0.0), point(0.0, 5.0, 5.0)],
        style: vec![v1::StyleWord {
            word: word.to_owned(),
            weight: None,
        }],
        planner: planner.into(),
        ..v1::PathGoal::default()
    }
}

async fn answer(
    client: &Client,
    pack: &str,
    goal: v1::PathGoal,
) -> Result<Vec<v1::GenerateResponse>, Status> {
    let request = v1::GenerateRequest {
        pack: pack.to_owned(),
        goal: Some(Goal::Path(goal)),
        seed: 3,
        ..v1::GenerateRequest::default()
    };
    let mut stream = client.clone().generate(request).await?.into_inner();
    let mut parts = Vec::new();
    while let Some(part) = stream.message().await? {
        parts.push(part);
    }
    Ok(parts)
}

/// Frames and notes of an answer.
fn whole(parts: &[v1::GenerateResponse]) -> (v1::Frames, Vec<String>) {
    let (mut whole, mut notes) = (v1::Frames::default(), Vec::new());
    for part in parts {
        let Some(Part::Frames(frames)) = &part.part else {
            panic!("{part:?}")
        };
        whole.frame_count += frames.frame_count;
        whole.root_positions.extend(&frames.root_positions);
        whole.rotations.extend(&frames.rotations);
        whole.contacts.extend(&frames.contacts);
        whole.qpos.extend(&frames.qpos);
        notes.extend(part.notes.iter().cloned());
    }
    (whole, notes)
}

async fn body(client: &Client, name: &str) -> v1::PackBody {
    let get = v1::GetPackRequest {
        name: "unimogen".to_owned(),
    };
    let pack = client.clone().get_pack(get).await.unwrap().into_inner();
    pack.bodies.into_iter().find(|body| body.name == name).unwrap()
}

/// Mean way over the ground of the toe that moves less, mm a frame, and whether one is in the
/// ground.
fn toes(frames: &v1::Frames, body: &v1::PackBody) -> (f32, bool) {
    let joints = body.joints.iter().map(|joint| {
        let v1::Vec3 { x, y, z } = joint.offset.unwrap_or_default();
        Joint {
            name: joint.name.clone(),
            parent: usize::try_from(joint.parent).ok(),
            offset_m: Vec3::new(x, y, z),
        }
    });
    let skeleton = Skeleton::new(joints.collect(), Vec3::X, 0.0, None).unwrap();
    let toes = ["left_toe", "right_toe"];
    let toes = toes.map(|toe| {
        skeleton
            .joints
            .iter()
            .position(|joint| joint.name == toe)
            .unwrap()
    });
    let count = skeleton.joint_count();
    let mut world = (vec![Vec3::ZERO; count], vec![Quat::IDENTITY; count]);
    let roots = frames.root_positions.as_chunks::<3>().0;
    let poses = frames.rotations.chunks_exact(4 * count);
    let places = roots.iter().zip(poses).map(|(&root, pose)| {
        let pose = pose.as_chunks::<4>().0.iter();
        let pose: Vec<Quat> = pose.map(|&[w, x, y, z]| Quat::from_xyzw(x, y, z, w)).collect();
        world_transforms(
            &skeleton,
            Vec3::from_array(root),
            &pose,
            &mut world.0,
            &mut world.1,
        );
        toes.map(|toe| world.0[toe])
    });
    let places: Vec<[Vec3; 2]> = places.collect();
    let least = |pair: &[[Vec3; 2]]| {
        let step = |toe: usize| (pair[1][toe] - pair[0][toe]).with_y(0.0).length();
        step(0).min(step(1))
    };
    let ways: f32 = places.windows(2).map(least).sum();
    let is_sunk = places.iter().flatten().any(|toe| toe.y < -0.015);
    (1e3 * ways / (places.len() - 1) as f32, is_sunk)
}

fn says_who_planned(notes: &[String]) -> bool {
    notes.iter().any(|note| note.starts_with("planned by"))
}

/// What is wrong with a refused request.
fn refused(found: Result<Vec<v1::GenerateResponse>, Status>) -> (String, String) {
    let status = found.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let info = status.get_details_error_info().unwrap();
    (info.metadata["field"].clone(), info.metadata["allowed"].clone())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_walks_as_another_robots_pack_plans() {
    let (server, client, _folder) = start(&["g1", "human", "unimogen"]).await;
    for name in ["h1", "h1_2"] {
        let goal = ahead(name, "walk", PathPlanner::Auto);
        let parts = answer(&client, "unimogen", goal.clone()).await.unwrap();
        assert!(
            parts.len() > 3,
            "{name}: frames come as they are final, in {}",
            parts.len()
        );
        let (frames, notes) = whole(&parts);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(
            notes[0].starts_with("planned by g1 ")
                && notes[0].ends_with(&format!("in its style normal, and carried over to {name}")),
            "{notes:?}"
        );
        assert_eq!(frames.frame_count, 151);
        for (frame, root) in frames.root_positions.chunks_exact(3).enumerate() {
            let off = root[0].hypot(root[2] - frame as f32 / 30.0);
            assert!(off < 0.04, "{name}: {off} m off the path in frame {frame}");
        }
        let body = body(&client, name).await;
        let robot = body.robot.as_ref().unwrap();
        assert_eq!(frames.qpos.len(), 151 * robot.qpos_size as usize);
        for qpos in frames.qpos.chunks_exact(robot.qpos_size as usize) {
            for (angle, hinge) in qpos[7..].iter().zip(&robot.hinges) {
                let within = hinge.lower - 1e-4..=hinge.upper + 1e-4;
                assert!(within.contains(angle), "{name}, {}: {angle}", hinge.joint);
            }
        }
        let (standing_mm, is_sunk) = toes(&frames, &body);
        assert!(
            standing_mm < 1.5 && !is_sunk,
            "{name}: {standing_mm} mm, {is_sunk}"
        );
        assert_eq!(frames.contacts.len(), 151 * body.contact_joints.len());
        let stands = frames
            .contacts
            .chunks_exact(4)
            .filter(|row| row.iter().any(|bit| *bit > 0.5));
        assert!(stands.count() > 75, "{name}: a foot stands in most frames");
        assert_eq!(answer(&client, "unimogen", goal.clone()).await.unwrap(), parts);

        let own = ahead(name, "walk", PathPlanner::Own);
        let (own, notes) = whole(&answer(&client, "unimogen", own).await.unwrap());
        assert!(!says_who_planned(&notes), "{notes:?}");
        assert_ne!(own.rotations, frames.rotations, "{name}");
    }
    assert!(server.shut_down().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_body_moves_as_in_the_pack_that_plans() {
    let (server, client, _folder) = start(&["g1", "human", "unimogen"]).await;
    for (name, style) in [("human", "walk"), ("g1", "normal")] {
        let carried = ahead(name, "walk", PathPlanner::Carried);
        let (carried, notes) = whole(&answer(&client, "unimogen", carried).await.unwrap());
        assert!(notes[0].contains(&format!("in its style {style}")), "{notes:?}");
        assert!(!notes[0].contains("carried over"), "{notes:?}");
        let itself = ahead("", style, PathPlanner::Auto);
        let (itself, notes) = whole(&answer(&client, name, itself).await.unwrap());
        assert_eq!((carried, notes), (itself, Vec::new()), "{name}");
    }
    assert!(server.shut_down().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pack_plans_itself_what_no_other_can() {
    let (server, client, _folder) = start(&["g1", "human", "unimogen"]).await;
    let fast = v1::PathGoal {
        points: vec![point(0.0, 0.0, 0.0), point(0.0, 12.0, 1.5)],
        ..ahead("g1", "walk", PathPlanner::Auto)
    };
    let steps = v1::PathGoal {
        steps: Some(4),
        ..ahead("g1", "walk", PathPlanner::Auto)
    };
    let blend = v1::PathGoal {
        style: ["walk", "run"]
            .map(|word| v1::StyleWord {
                word: word.to_owned(),
                weight: Some(0.5),
            })
            .to_vec(),
        ..ahead("g1", "walk", PathPlanner::Auto)
    };
    for (goal, why) in [
        (
            ahead("g1", "dance", PathPlanner::Auto),
            "no pack that walks has the style \"dance\"",
        ),
        (fast, "g1 in the style normal is slower than the path"),
        (
            steps,
            "path.steps: is given; allowed: none: the pack g1 has no sampler",
        ),
        (
            blend,
            "path.style: has 2 entries; allowed: at most 1: the pack g1 walks in one style",
        ),
    ] {
        let own = v1::PathGoal {
            planner: PathPlanner::Own.into(),
            ..goal.clone()
        };
        let own = whole(&answer(&client, "unimogen", own).await.unwrap()).0;
        let (frames, notes) = whole(&answer(&client, "unimogen", goal).await.unwrap());
        assert_eq!(frames, own, "{why}");
        let note = notes.last().unwrap();
        assert!(
            note.starts_with("planned by unimogen ") && note.ends_with(&format!(" itself: {why}")),
            "{notes:?}"
        );
    }
    // A fox has no other choice, so nothing is said about it.
    let fox = ahead("fox", "walk", PathPlanner::Auto);
    let (_, notes) = whole(&answer(&client, "unimogen", fox).await.unwrap());
    assert!(!says_who_planned(&notes), "{notes:?}");
    assert!(server.shut_down().await);
}

/// Figures of docs/unimogen.md: people plan themselves, even beside a pack of their body, and
/// `human` is worse for an H1 than the pack itself.
#[tokio::test(flavor = "multi_thread")]
async fn a_pack_that_plans_no_better_must_be_asked_for() {
    for (carrier, name) in [("open", "human"), ("human", "human"), ("human", "h1")] {
        let (server, client, _folder) = start(&[carrier, "unimogen"]).await;
        let made = async |planner| {
            let goal = ahead(name, "walk", planner);
            whole(&answer(&client, "unimogen", goal).await.unwrap())
        };
        let (auto, own) = (made(PathPlanner::Auto).await, made(PathPlanner::Own).await);
        assert_eq!(auto, own, "{carrier}, {name}");
        let (_, notes) = made(PathPlanner::Carried).await;
        assert!(
            notes[0].starts_with(&format!("planned by {carrier} ")),
            "{notes:?}"
        );
        assert!(server.shut_down().await);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_carried_is_refused_with_a_way_on() {
    let (server, client, folder) = start(&["g1", "human", "unimogen"]).await;
    let carried = |body: &str, word: &str| ahead(body, word, PathPlanner::Carried);
    let (field, allowed) = refused(answer(&client, "unimogen", carried("h1", "dance")).await);
    assert_eq!(field, "path.style[0].word");
    assert!(
        allowed.starts_with("a style of g1: carry, ") && allowed.ends_with("; or planner PATH_PLANNER_OWN"),
        "{allowed}"
    );
    let (field, allowed) = refused(answer(&client, "unimogen", carried("fox", "walk")).await);
    assert_eq!(
        (field.as_str(), allowed.as_str()),
        ("path.planner", "PATH_PLANNER_OWN; or a body on two legs")
    );
    let steps = v1::PathGoal {
        steps: Some(4),
        ..carried("human", "walk")
    };
    let (field, allowed) = refused(answer(&client, "unimogen", steps).await);
    assert_eq!(field, "path.steps");
    assert!(allowed.ends_with("; or planner PATH_PLANNER_OWN"), "{allowed}");
    let (field, allowed) = refused(answer(&client, "human", carried("", "walk")).await);
    assert_eq!(field, "path.planner");
    assert!(
        allowed.ends_with("the pack human plans its paths itself"),
        "{allowed}"
    );
    assert!(server.shut_down().await);
    drop(folder);

    let (server, client, _folder) = start(&["unimogen"]).await;
    let (field, allowed) = refused(answer(&client, "unimogen", carried("human", "walk")).await);
    assert_eq!(field, "path.planner");
    assert!(
        allowed.starts_with("PATH_PLANNER_OWN; or a server with"),
        "{allowed}"
    );
    let alone = ahead("human", "walk", PathPlanner::Auto);
    let (_, notes) = whole(&answer(&client, "unimogen", alone).await.unwrap());
    assert!(!says_who_planned(&notes), "{notes:?}");
    assert!(server.shut_down().await);
}

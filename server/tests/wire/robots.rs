//! A robot's pack: frames on the hinges and within their limits however they leave, MuJoCo's qpos
//! both ways, and refusals.

use std::path::Path;

use serde_json::{Value, json};
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_motion::conventions::Convention;
use troupe_motion::fk::world_transforms;
use troupe_motion::rotation::{angle_between, from_wxyz, six_d, to_wxyz};
use troupe_motion::{Quat, Skeleton, Vec3};
use troupe_proto::v1;

use crate::common::calls::{Client, options, step, stepped, walk};
use crate::common::robot::{self, Folder, G1, JOINTS, QPOS, STAND_M, standing};
use crate::common::scenes::{put_scene, scenes};
use crate::common::{TestServer, character};

fn skeleton() -> std::sync::Arc<Skeleton> {
    robot::pack(Path::new("unused")).rig.skeleton.clone()
}

/// A session of the G1.
fn g1(id: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        pack: G1.into(),
        ..options(id)
    }
}

async fn open(client: &mut Client, sessions: Vec<v1::SessionOptions>) {
    let request = v1::CreateSessionsRequest { sessions };
    client.create_sessions(request).await.unwrap();
}

/// A step that asks for all columns of the G1.
fn full_step(id: &str, frames: u32, commands: Vec<v1::Command>) -> v1::StepRequest {
    v1::StepRequest {
        encoding: v1::Encoding::Qpos.into(),
        return_positions: true,
        return_six_d: true,
        ..step(&[id], frames, commands)
    }
}

/// Columns of frames of the G1, one of each kind.
struct Columns<'a> {
    qpos: &'a [f32],
    positions: &'a [f32],
    six_d: &'a [f32],
}

/// Checks that all columns say the same poses, in the native convention, within the limits. Gives
/// the rotations.
fn check(skeleton: &Skeleton, columns: &Columns<'_>) -> Vec<Quat> {
    let robot = robot::robot(skeleton);
    let frames = columns.qpos.len() / QPOS;
    assert_eq!(columns.qpos.len(), frames * QPOS);
    assert_eq!(columns.positions.len(), frames * JOINTS * 3);
    assert_eq!(columns.six_d.len(), frames * JOINTS * 6);
    let mut all = Vec::new();
    let mut pose = vec![Quat::IDENTITY; JOINTS];
    let (mut places, mut world) = (vec![Vec3::ZERO; JOINTS], pose.clone());
    for frame in 0..frames {
        let (root, rotation, angles) = robot.read_qpos(&columns.qpos[frame * QPOS..(frame + 1) * QPOS]);
        for (hinge, angle) in robot.hinges().iter().zip(angles) {
            let limits = hinge.lower_rad..=hinge.upper_rad;
            assert!(
                limits.contains(angle),
                "frame {frame}: {angle} is not in {limits:?}"
            );
        }
        robot.pose(rotation, angles, &mut pose);
        world_transforms(skeleton, root, &pose, &mut places, &mut world);
        for joint in 0..JOINTS {
            let at = frame * JOINTS + joint;
            let place = Vec3::from_slice(&columns.positions[at * 3..]);
            assert!(
                place.distance(places[joint]) < 1e-4,
                "frame {frame}: {place} {}",
                places[joint]
            );
            for (a, b) in columns.six_d[at * 6..at * 6 + 6].iter().zip(six_d(world[joint])) {
                assert!((a - b).abs() < 1e-4, "frame {frame} joint {joint}");
            }
        }
        all.extend_from_slice(&pose);
    }
    all
}

fn reason(status: &tonic::Status) -> (Code, String, String) {
    let info = status.get_details_error_info().unwrap();
    let field = info.metadata.get("field").cloned().unwrap_or_default();
    (status.code(), info.reason, field)
}

#[tokio::test]
async fn packs_tell_of_their_robots() {
    let folder = Folder::new("packs");
    let server = robot::start(&folder).await;
    let ask = |name: &str| v1::GetPackRequest { name: name.into() };
    let mut client = server.grpc().await;
    let pack = client.get_pack(ask(G1)).await.unwrap().into_inner();
    let robot = pack.robot.unwrap();
    assert_eq!((robot.name.as_str(), robot.qpos_size), ("g1_29dof_rev_1_0", 36));
    assert_eq!(robot.hinges.len(), 29);
    let knee = &robot.hinges[3];
    assert_eq!(
        (knee.joint.as_str(), knee.lower, knee.upper),
        ("left_knee", -0.087267, 2.8798)
    );
    assert_eq!((knee.max_speed, knee.axis.unwrap().x), (20.0, 1.0));
    assert!((knee.rest.unwrap().x - 0.087338).abs() < 1e-5);
    assert!(
        client
            .get_pack(ask("toy"))
            .await
            .unwrap()
            .into_inner()
            .robot
            .is_none()
    );

    let packs: Value = server.get("/v1/packs").await.json().await.unwrap();
    let packs = packs["packs"].as_array().unwrap();
    let by_name = |name: &str| packs.iter().find(|pack| pack["name"] == name).unwrap();
    assert_eq!(by_name(G1)["robot"]["hinges"][28]["joint"], "right_wrist_yaw");
    assert_eq!(by_name("toy").get("robot"), None);
}

/// Stands, and is asked to be two metres ahead.
fn task(skeleton: &Skeleton) -> v1::Character {
    let key = |qpos: Vec<f32>| v1::Keyframe {
        qpos,
        ..v1::Keyframe::default()
    };
    v1::Character {
        context: (0..4).map(|_| key(standing(skeleton, 1.0, 0.0))).collect(),
        targets: vec![key(standing(skeleton, 1.0, 2.0))],
        frame_count: Some(40),
        return_positions: true,
        return_six_d: true,
        return_qpos: true,
        ..v1::Character::default()
    }
}

/// Checks the speeds of hinges in a session's first block by its `qpos`.
fn check_speeds(skeleton: &Skeleton, block: &v1::FrameBlock, fps: f32) {
    let hinges = robot::robot(skeleton).hinges();
    let frames: Vec<&[f32]> = block.qpos.chunks(QPOS).map(|row| &row[7..]).collect();
    let speed = |frame: usize, hinge: usize| (frames[frame][hinge] - frames[frame - 1][hinge]) * fps;
    assert_eq!(block.hinge_speed_ratios.len(), frames.len());
    assert_eq!(
        (block.hinge_speed_ratios[0], block.hinge_accelerations[0]),
        (0.0, 0.0)
    );
    for frame in 1..frames.len() {
        let ratio = |hinge: usize| speed(frame, hinge).abs() / hinges[hinge].max_speed_rad_per_s;
        let most = (0..hinges.len()).map(ratio).fold(0.0, f32::max);
        let (found, fastest) = (block.hinge_speed_ratios[frame], block.fastest_hinges[frame]);
        assert!((found - most).abs() < 1e-4, "frame {frame}: {found}, not {most}");
        assert!(
            (ratio(fastest as usize) - most).abs() < 1e-4,
            "frame {frame}: {fastest}"
        );
    }
    for frame in 2..frames.len() {
        let change = |hinge: usize| (speed(frame, hinge) - speed(frame - 1, hinge)).abs() * fps;
        let most = (0..hinges.len()).map(change).fold(0.0, f32::max);
        let found = block.hinge_accelerations[frame];
        assert!(
            (found - most).abs() < 0.05 + 1e-3 * most,
            "frame {frame}: {found}, not {most}"
        );
    }
    assert!(block.hinge_speed_ratios.iter().any(|&ratio| ratio > 0.01));
}

async fn fill(server: &TestServer, character: v1::Character) -> Result<v1::Frames, tonic::Status> {
    let request = v1::InBetweenRequest {
        pack: G1.into(),
        characters: vec![character],
        skeleton: String::new(),
    };
    let answer = server.grpc().await.in_between(request).await?.into_inner();
    Ok(answer.characters.into_iter().next().unwrap().frames.unwrap())
}

#[tokio::test]
async fn a_gap_is_filled_on_the_hinges_and_returned_as_qpos() {
    let folder = Folder::new("gap");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    let frames = fill(&server, task(&skeleton)).await.unwrap();
    let columns = Columns {
        qpos: &frames.qpos,
        positions: &frames.positions,
        six_d: &frames.six_d,
    };
    let rotations = check(&skeleton, &columns);
    assert_eq!(frames.rotations.len(), rotations.len() * 4);
    for (wxyz, rotation) in frames.rotations.as_chunks::<4>().0.iter().zip(&rotations) {
        assert!(angle_between(from_wxyz(*wxyz), *rotation) < 1e-4);
    }
    // Keyframes are met, whatever the networks made.
    for (frame, z) in [(0, 0.0), (3, 0.0), (39, 2.0)] {
        let given = standing(&skeleton, 1.0, z);
        let row = &frames.qpos[frame * QPOS..(frame + 1) * QPOS];
        let off = row
            .iter()
            .zip(&given)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(off < 1e-4, "frame {frame} is off by {off}");
        assert!(frames.hinge_residuals[frame] < 1e-4 && frames.clamped_hinges[frame] == 0);
    }
    // No hinge can make the networks' poses, and some frames bend a knee the wrong way. The answer
    // reports both.
    assert_eq!(frames.hinge_residuals.len(), 40);
    assert!(frames.hinge_residuals[20] > 0.02, "{:?}", frames.hinge_residuals);
    assert!(frames.clamped_hinges[24] >= 1, "{:?}", frames.clamped_hinges);
    let knee = |frame: usize| frames.qpos[frame * QPOS + 7 + 3];
    assert_eq!(knee(24), -0.087267);
    // The poses of a test's networks jump, and the answer says by which hinge.
    let block = v1::FrameBlock {
        qpos: frames.qpos.clone(),
        hinge_speed_ratios: frames.hinge_speed_ratios.clone(),
        fastest_hinges: frames.fastest_hinges.clone(),
        hinge_accelerations: frames.hinge_accelerations.clone(),
        ..v1::FrameBlock::default()
    };
    check_speeds(&skeleton, &block, 30.0);

    // The same without qpos, and with rotations for keyframes.
    let mut plain = task(&skeleton);
    plain.return_qpos = false;
    let key = |qpos: &[f32]| {
        let (root, rotation, angles) = robot::robot(&skeleton).read_qpos(qpos);
        let mut pose = vec![Quat::IDENTITY; JOINTS];
        robot::robot(&skeleton).pose(rotation, angles, &mut pose);
        v1::Keyframe {
            root: Some(v1::Root {
                position: Some(v1::Vec3 {
                    x: root.x,
                    y: root.y,
                    z: root.z,
                }),
                heading: None,
            }),
            pose: Some(v1::Pose {
                rotations: pose.into_iter().flat_map(to_wxyz).collect(),
                root_height: None,
            }),
            ..v1::Keyframe::default()
        }
    };
    for keys in [&mut plain.context, &mut plain.targets] {
        for given in keys.iter_mut() {
            *given = key(&given.qpos);
        }
    }
    let same = fill(&server, plain).await.unwrap();
    assert!(same.qpos.is_empty() && same.clamped_hinges == frames.clamped_hinges);
    for (a, b) in same.rotations.iter().zip(&frames.rotations) {
        assert!((a - b).abs() < 1e-5);
    }
}

#[tokio::test]
async fn errors_of_a_qpos_name_place_and_range() {
    let folder = Folder::new("wrong");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    type Change = fn(&mut v1::Keyframe);
    let cases: [(Change, &str, &str); 9] = [
        (
            |key| key.qpos.truncate(35),
            "qpos",
            "exactly 36: x, y, z, the root's rotation",
        ),
        (|key| key.qpos[12] = f32::NAN, "qpos[12]", "a finite number"),
        (|key| key.qpos[3] = 1.1, "qpos[3]", "unit length, 0.999 to 1.001"),
        (|key| key.qpos[10] = -0.2, "qpos[10]", "-0.087267 to 2.8798"),
        (|key| key.qpos[2] = 101.0, "qpos[2]", "-100 to 100"),
        (|key| key.qpos[0] = 2e4, "root.position", "at most 10000 m"),
        (
            |key| key.root = Some(v1::Root::default()),
            "qpos",
            "qpos, or root and pose",
        ),
        (
            |key| key.pose = Some(v1::Pose::default()),
            "qpos",
            "qpos, or root and pose",
        ),
        (
            |key| {
                let height = Some(0.8);
                key.velocity = Some(v1::RootVelocity {
                    height,
                    ..v1::RootVelocity::default()
                });
            },
            "velocity.height",
            "within 0.001 m of 0.78",
        ),
    ];
    for (change, field, allowed) in cases {
        let mut wrong = task(&skeleton);
        change(&mut wrong.targets[0]);
        let status = fill(&server, wrong).await.unwrap_err();
        assert_eq!(
            reason(&status),
            (
                Code::InvalidArgument,
                "INVALID_FIELD".into(),
                format!("characters[0].targets[0].{field}")
            )
        );
        assert!(status.message().contains(allowed), "{}", status.message());
    }
    // A hundredth of a radian outside is rounding, and is held at the limit.
    let mut near = task(&skeleton);
    near.targets[0].qpos[10] = -0.09;
    let frames = fill(&server, near).await.unwrap();
    assert_eq!(frames.qpos[39 * QPOS + 10], -0.087267);
}

#[tokio::test]
async fn packs_without_a_robot_refuse_qpos() {
    let folder = Folder::new("human");
    let server = robot::start(&folder).await;
    let mut client = server.grpc().await;
    let mut asked = v1::InBetweenRequest {
        pack: "toy".into(),
        characters: vec![character(0.0)],
        skeleton: String::new(),
    };
    asked.characters[0].return_qpos = true;
    let status = client.in_between(asked.clone()).await.unwrap_err();
    assert_eq!(reason(&status).2, "characters[0].return_qpos");
    assert!(
        status.message().contains("pack toy has no robot"),
        "{}",
        status.message()
    );
    asked.characters[0].return_qpos = false;
    asked.characters[0].targets[0].qpos = vec![0.0; 8];
    let status = client.in_between(asked).await.unwrap_err();
    assert_eq!(reason(&status).2, "characters[0].targets[0].qpos");

    let mut client = server.sessions().await;
    open(&mut client, vec![g1("robot"), options("human")]).await;
    let as_qpos = |ids: &[&str]| v1::StepRequest {
        encoding: v1::Encoding::Qpos.into(),
        ..step(ids, 2, Vec::new())
    };
    let status = client.step(as_qpos(&["human"])).await.unwrap_err();
    assert_eq!(
        reason(&status),
        (Code::InvalidArgument, "INVALID_FIELD".into(), "encoding".into())
    );
    assert!(
        status.message().contains("pack toy has no robot"),
        "{}",
        status.message()
    );
    // Beside a robot the others are served.
    let answer = client
        .step(as_qpos(&["human", "robot"]))
        .await
        .unwrap()
        .into_inner();
    assert_eq!((answer.blocks.len(), answer.problems.len()), (1, 1));
    assert_eq!(
        (answer.blocks[0].pack.as_str(), answer.blocks[0].qpos.len()),
        (G1, 2 * QPOS)
    );
    assert_eq!(
        (answer.problems[0].slot, answer.problems[0].session_id.as_str()),
        (0, "human")
    );
    // The one that was refused has not moved, and its clock is free.
    let human = stepped(&mut client, step(&["human"], 1, Vec::new())).await;
    assert_eq!((human.first_frames, human.qpos.len()), (vec![1], 0));
}

#[tokio::test]
async fn a_robot_walks_on_its_hinges_the_same_in_every_form() {
    let folder = Folder::new("walk");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    let mut client = server.sessions().await;
    let names = ["qpos", "floats", "compact", "again", "sixty"];
    open(&mut client, names.map(g1).into()).await;
    let go = |id: &str| vec![walk(id, 1, (0.0, 0.8))];

    let full = stepped(&mut client, full_step("qpos", 75, go("qpos"))).await;
    assert!(full.root_positions.is_empty() && full.rotations.is_empty() && full.packed_roots.is_empty());
    assert_eq!((full.hinge_residuals.len(), full.clamped_hinges.len()), (75, 75));
    let columns = Columns {
        qpos: &full.qpos,
        positions: &full.positions,
        six_d: &full.six_d,
    };
    let rotations = check(&skeleton, &columns);
    // It goes forward, along MuJoCo's X.
    let (first, last) = (&full.qpos[..QPOS], &full.qpos[74 * QPOS..]);
    assert!(
        last[0] - first[0] > 1.0 && last[1].abs() < 0.2,
        "{:?}",
        &last[..3]
    );
    // Poses that no hinge can make are reported. The knees that the networks bend the wrong way are
    // not: feet are held, within the limits.
    assert!(full.hinge_residuals.iter().any(|&residual| residual > 0.02));
    assert!(full.clamped_hinges.iter().all(|&clamped| clamped == 0));

    let floats = stepped(&mut client, step(&["floats"], 75, go("floats"))).await;
    for (frame, root) in floats.root_positions.as_chunks::<3>().0.iter().enumerate() {
        let qpos = &full.qpos[frame * QPOS..];
        assert_eq!(*root, [qpos[1], qpos[2], qpos[0]], "native axes");
    }
    for (wxyz, rotation) in floats.rotations.as_chunks::<4>().0.iter().zip(&rotations) {
        assert!(angle_between(from_wxyz(*wxyz), *rotation) < 1e-5);
    }
    assert!(floats.qpos.is_empty() && floats.hinge_residuals.is_empty());

    let compact = v1::StepRequest {
        encoding: v1::Encoding::Compact.into(),
        return_positions: true,
        ..step(&["compact"], 75, go("compact"))
    };
    let compact = stepped(&mut client, compact).await;
    assert_eq!(compact.positions, full.positions, "bit for bit");
    assert_eq!(compact.packed_rotations.len(), 75 * JOINTS * 6);

    // In single steps, bit for bit the same.
    let (mut rows, mut ratios) = (Vec::new(), Vec::new());
    for frame in 0..75 {
        let commands = if frame == 0 { go("again") } else { Vec::new() };
        let request = v1::StepRequest {
            encoding: v1::Encoding::Qpos.into(),
            ..step(&["again"], 1, commands)
        };
        let block = stepped(&mut client, request).await;
        rows.extend(block.qpos);
        ratios.extend(block.hinge_speed_ratios);
    }
    assert_eq!(rows, full.qpos);
    // Speeds are measured from one call to the next.
    assert_eq!(ratios, full.hinge_speed_ratios);
    check_speeds(&skeleton, &full, 30.0);

    // Between frames too.
    let sixty = v1::StepRequest {
        rate_hz: 60,
        ..full_step("sixty", 120, go("sixty"))
    };
    let sixty = stepped(&mut client, sixty).await;
    check_speeds(&skeleton, &sixty, 60.0);
    let columns = Columns {
        qpos: &sixty.qpos,
        positions: &sixty.positions,
        six_d: &sixty.six_d,
    };
    check(&skeleton, &columns);
    let seed = v1::PeekRequest {
        session_id: "sixty".into(),
        frames: 10,
    };
    // A plan that is on its way may change what comes next.
    let mut peek = client.peek(seed.clone()).await.unwrap().into_inner();
    for _ in 0..30 {
        if !peek.in_flight {
            break;
        }
        stepped(&mut client, step(&["sixty"], 1, Vec::new())).await;
        peek = client.peek(seed.clone()).await.unwrap().into_inner();
    }
    assert!(!peek.in_flight);
    let future = peek.future.unwrap();
    let next = stepped(&mut client, step(&["sixty"], 3, Vec::new())).await;
    assert_eq!(
        future.rotations[..next.rotations.len()],
        next.rotations[..],
        "as it will be shown"
    );
}

#[tokio::test]
async fn qpos_is_mujocos_in_every_convention() {
    let folder = Folder::new("conventions");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    let mut client = server.sessions().await;
    let key = |qpos: Vec<f32>| v1::Keyframe {
        qpos,
        ..v1::Keyframe::default()
    };
    let start = |convention: v1::Convention| v1::SessionOptions {
        convention: convention.into(),
        context: (0..4).map(|_| key(standing(&skeleton, 0.5, 1.0))).collect(),
        ..g1(&format!("of-{}", i32::from(convention)))
    };
    let conventions = [
        v1::Convention::Native,
        v1::Convention::Unreal,
        v1::Convention::Ros,
    ];
    open(&mut client, conventions.map(start).into()).await;
    let mut all = Vec::new();
    for (convention, of) in conventions
        .iter()
        .zip([Convention::Native, Convention::Unreal, Convention::Ros])
    {
        let id = format!("of-{}", i32::from(*convention));
        let answer = stepped(&mut client, full_step(&id, 5, Vec::new())).await;
        // The root's place beside it, in the session's convention.
        let root = of.position_to_native(Vec3::from_slice(&answer.positions));
        let (place, _, _) = robot::robot(&skeleton).read_qpos(&answer.qpos[..QPOS]);
        assert!(root.distance(place) < 1e-4, "{root} {place}");
        assert!((place.x - 0.5).abs() < 0.05 && (place.z - 1.0).abs() < 0.05 && place.y > 0.7);
        all.push(answer.qpos);
    }
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0], all[2]);

    // What is wrong with one says nothing of conventions.
    let mut wrong = start(v1::Convention::Unreal);
    wrong.id = "wrong".into();
    wrong.context[1].qpos[10] = 3.0;
    let request = v1::CreateSessionsRequest {
        sessions: vec![wrong],
    };
    let status = client.create_sessions(request).await.unwrap_err();
    assert_eq!(reason(&status).2, "sessions[0].context[1].qpos[10]");
    assert!(!status.message().contains("convention"), "{}", status.message());
}

#[tokio::test]
async fn http_speaks_qpos() {
    let folder = Folder::new("http");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    let key = |z: f32| json!({"qpos": standing(&skeleton, 0.0, z)});
    let body = json!({"pack": G1, "characters": [{
        "context": [key(0.0), key(0.0), key(0.0), key(0.0)], "targets": [key(1.5)],
        "frame_count": 30, "return_qpos": true,
    }]});
    let post = reqwest::Method::POST;
    let answer = server.send(post.clone(), "/v1/inbetween", &body).await;
    assert_eq!(answer.status(), 200);
    let answer: Value = answer.json().await.unwrap();
    let frames = &answer["characters"][0]["frames"];
    assert_eq!(frames["qpos"].as_array().unwrap().len(), 30 * QPOS);
    assert_eq!(frames["clamped_hinges"].as_array().unwrap().len(), 30);
    assert_eq!(frames["six_d"], json!([]), "not asked for");

    let body = json!({"sessions": [{"id": "web", "pack": G1}, {"id": "toy"}]});
    assert_eq!(
        server.send(post.clone(), "/v1/sessions", &body).await.status(),
        200
    );
    let body = json!({"session_ids": ["web"], "frames": 2, "encoding": "qpos"});
    let answer: Value = server
        .send(post.clone(), "/v1/step", &body)
        .await
        .json()
        .await
        .unwrap();
    let block = &answer["blocks"][0];
    let height = block["qpos"][2].as_f64().unwrap();
    assert!((height - f64::from(STAND_M)).abs() < 0.05, "{block}");
    assert_eq!(block["qpos"].as_array().unwrap().len(), 2 * QPOS);
    let body = json!({"session_ids": ["toy"], "encoding": "qpos"});
    let answer = server.send(post.clone(), "/v1/step", &body).await;
    assert_eq!(answer.status(), 400);
    let error: Value = answer.json().await.unwrap();
    assert_eq!(error["error"]["field"], "encoding", "{error}");
    let body = json!({"session_ids": ["web"], "encoding": "mujoco"});
    let text = server.send(post, "/v1/step", &body).await.text().await.unwrap();
    assert!(
        text.contains("`ENCODING_F32`, `ENCODING_COMPACT`, `ENCODING_QPOS`"),
        "{text}"
    );
}

/// A step of 12 cm ahead of the origin, and a stage of a metre to fall from beside it.
const STAGE: &str = r#"
format = 1
name = "stage"
ground_m = 0.0

[[colliders]]
id = "step"
position_m = [0.0, 0.06, 2.0]
shape = { box = { half_extents_m = [1.0, 0.06, 1.4] } }

[[colliders]]
id = "stage"
position_m = [6.0, 0.5, 0.0]
shape = { box = { half_extents_m = [1.0, 0.5, 1.0] } }
"#;

#[tokio::test]
async fn a_robot_steps_up_and_falls_within_its_limits() {
    let folder = Folder::new("stage");
    let server = robot::start(&folder).await;
    let skeleton = skeleton();
    put_scene(&mut scenes(&server).await, STAGE).await.unwrap();
    let mut client = server.sessions().await;
    let at = |id: &str, x: f32, y: f32| v1::SessionOptions {
        scene: "stage".into(),
        position: Some(v1::Vec3 { x, y, z: 0.0 }),
        ..g1(id)
    };
    open(&mut client, vec![at("climbs", 0.0, 0.0), at("falls", 6.0, 1.2)]).await;
    let mut fell = false;
    for (id, lifted) in [("climbs", 0.12), ("falls", -1.0)] {
        let (mut heights, mut commands) = (Vec::new(), vec![walk(id, 1, (0.0, 0.8))]);
        for _ in 0..3 {
            let request = full_step(id, 40, std::mem::take(&mut commands));
            let mut answer = client.step(request).await.unwrap().into_inner();
            let block = answer.blocks.remove(0);
            let columns = Columns {
                qpos: &block.qpos,
                positions: &block.positions,
                six_d: &block.six_d,
            };
            check(&skeleton, &columns);
            heights.extend(block.qpos.chunks_exact(QPOS).map(|qpos| qpos[2]));
            let events = answer.events.iter().flat_map(|of| &of.events);
            fell |= events
                .filter_map(|event| event.kind.as_ref())
                .any(|kind| matches!(kind, v1::session_event::Kind::Fell(_)));
        }
        let last = heights[heights.len() - 1] - heights[0];
        assert!((last - lifted).abs() < 0.06, "{id}: {last}");
    }
    assert!(fell);
}

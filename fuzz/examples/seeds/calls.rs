//! Seeds of the target `calls`: each call over HTTP and over gRPC.

use prost::Message;
use serde::Serialize;
use troupe_fuzz::{Call, STOOL, YARD, options};
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source;

use super::{Problem, drive, keyframe, sit, vec3, walk, write};

pub(super) fn write_all() -> Result<(), Problem> {
    motion()?;
    sessions()?;
    scenes()
}

fn motion() -> Result<(), Problem> {
    let character = v1::Character {
        id: "a".to_owned(),
        context: (0..4u8).map(|frame| keyframe(f32::from(frame) * 0.1)).collect(),
        targets: vec![keyframe(3.0)],
        frame_count: Some(40),
        seed: 7,
        return_positions: true,
        ..v1::Character::default()
    };
    both(
        "InBetween",
        &v1::InBetweenRequest {
            pack: "toy".to_owned(),
            characters: vec![character],
            skeleton: String::new(),
        },
    )?;
    words()?;
    text("ListPacks", "txt", b"")?;
    text("GetPack", "txt", b"toy")?;
    grpc(
        "GetPack",
        &v1::GetPackRequest {
            name: "toy".to_owned(),
        }
        .encode_to_vec(),
    )
}

/// The calls between words and motion, in both directions.
fn words() -> Result<(), Problem> {
    let sampling = v1::Sampling {
        temperature: Some(0.5),
        top_k: Some(40),
        top_p: Some(0.9),
        repetition: Some(1.1),
    };
    let prompt = v1::Prompt {
        text: "walk on".to_owned(),
        seconds: Some(0.3),
        ..v1::Prompt::default()
    };
    let request = v1::GenerateRequest {
        goal: Some(v1::generate_request::Goal::Prompt(prompt)),
        sampling: Some(sampling),
        ..v1::GenerateRequest::default()
    };
    both("Generate", &request)?;
    let request = v1::DescribeRequest {
        frames: (0..4u8).map(|frame| keyframe(f32::from(frame) * 0.1)).collect(),
        sampling: Some(sampling),
        ..v1::DescribeRequest::default()
    };
    both("Describe", &request)
}

fn sessions() -> Result<(), Problem> {
    let mut session = options("c", "yard");
    session.context = (0..4).map(|_| keyframe(0.0)).collect();
    session.ttl_ms = Some(60_000);
    session.convention = v1::Convention::Native.into();
    let placed = v1::SessionOptions {
        position: vec3(1.0, 0.0, 2.0),
        heading: 0.5,
        priority: Some(0.9),
        look_ahead_frames: Some(6),
        replan_interval_frames: Some(10),
        root_ratio: Some(0.5),
        convention: v1::Convention::Unreal.into(),
        ..options("d", "")
    };
    both(
        "CreateSessions",
        &v1::CreateSessionsRequest {
            sessions: vec![session, placed],
        },
    )?;
    let seen = v1::SessionResume {
        session_id: "a".to_owned(),
        frame: Some(3),
        pose: Some(keyframe(0.1)),
    };
    both(
        "ResumeSessions",
        &v1::ResumeSessionsRequest { sessions: vec![seen] },
    )?;
    text("GetSession", "txt", b"a")?;
    grpc(
        "GetSession",
        &v1::GetSessionRequest { id: "a".to_owned() }.encode_to_vec(),
    )?;
    text("ListSessions", "txt", b"?page_size=1&page_token=a")?;
    grpc(
        "ListSessions",
        &v1::ListSessionsRequest {
            page_size: 1,
            page_token: "a".to_owned(),
        }
        .encode_to_vec(),
    )?;
    text("CloseSessions", "txt", b"a")?;
    grpc(
        "CloseSessions",
        &v1::CloseSessionsRequest {
            ids: vec!["a".to_owned()],
        }
        .encode_to_vec(),
    )?;
    both(
        "Command",
        &v1::CommandRequest {
            commands: vec![walk("a", 1), sit("a", 2), walk("b", 1)],
        },
    )?;
    let step = v1::StepRequest {
        session_ids: vec!["a".to_owned(), "b".to_owned()],
        frames: 2,
        rate_hz: 60,
        commands: vec![walk("b", 1)],
        encoding: v1::Encoding::Compact.into(),
        return_positions: true,
        return_six_d: false,
    };
    both("Step", &step)?;
    let frames: Vec<u8> = drive()
        .iter()
        .flat_map(|ask| {
            let message = ask.encode_to_vec();
            let length = u32::try_from(message.len()).unwrap_or_default();
            [&[0], length.to_be_bytes().as_slice(), &message].concat()
        })
        .collect();
    grpc("Drive", &frames)?;
    text("Peek", "txt", b"?frames=5")?;
    grpc(
        "Peek",
        &v1::PeekRequest {
            session_id: "a".to_owned(),
            frames: 5,
        }
        .encode_to_vec(),
    )?;
    recordings()?;
    text("ListStyles", "txt", b"")?;
    text("GetStyle", "txt", b"normal")?;
    grpc(
        "GetStyle",
        &v1::GetStyleRequest {
            style: "normal".to_owned(),
            ..v1::GetStyleRequest::default()
        }
        .encode_to_vec(),
    )?;
    let still = include_str!("../../../server/tests/common/toy/styles/still.json");
    let style = v1::Style {
        name: "new".to_owned(),
        ..serde_json::from_str(still)?
    };
    text("PutStyle", "json", &serde_json::to_vec(&style)?)?;
    let put = v1::PutStyleRequest {
        body: String::new(),
        pack: "toy".to_owned(),
        style: Some(style),
    };
    grpc("PutStyle", &put.encode_to_vec())
}

fn recordings() -> Result<(), Problem> {
    text("GetRecording", "txt", b"")?;
    let request = v1::GetRecordingRequest {
        session_id: "a".to_owned(),
    };
    grpc("GetRecording", &request.encode_to_vec())?;
    both(
        "Replay",
        &v1::ReplayRequest {
            recording: include_str!("recording.jsonl").to_owned(),
            anyway: true,
        },
    )
}

fn scenes() -> Result<(), Problem> {
    let object = |id: &str| v1::SceneObject {
        id: id.to_owned(),
        definition: "stool".to_owned(),
        position: vec3(1.0, 0.0, 2.0),
        heading: Some(0.5),
        ..v1::SceneObject::default()
    };
    let shape = v1::ColliderShape {
        r#box: Some(v1::BoxShape {
            center: None,
            half_extents: vec3(1.0, 0.5, 0.1),
        }),
        ..v1::ColliderShape::default()
    };
    let field = v1::ColliderShape {
        heightfield: Some(v1::HeightfieldShape {
            rows: 2,
            columns: 2,
            width: 4.0,
            depth: 4.0,
            heights: vec![0.0, 0.1, 0.2, 0.0],
        }),
        ..v1::ColliderShape::default()
    };
    let collider = |id: &str, shape| v1::Collider {
        id: id.to_owned(),
        position: vec3(0.0, 0.0, -5.0),
        shape: Some(shape),
        ..v1::Collider::default()
    };
    let scene = v1::Scene {
        name: "new".to_owned(),
        colliders: vec![collider("wall", shape), collider("hill", field)],
        objects: vec![object("one")],
        ..v1::Scene::default()
    };
    both(
        "PutScene",
        &v1::PutSceneRequest {
            scene: Some(scene),
            ..v1::PutSceneRequest::default()
        },
    )?;
    let put = v1::PutSceneRequest {
        document: toml(YARD),
        ..v1::PutSceneRequest::default()
    };
    text("PutScene", "toml.json", &serde_json::to_vec(&put)?)?;
    text("GetScene", "txt", b"?convention=unreal&without_colliders=true")?;
    grpc(
        "GetScene",
        &v1::GetSceneRequest {
            name: "yard".to_owned(),
            ..v1::GetSceneRequest::default()
        }
        .encode_to_vec(),
    )?;
    let put = v1::PutSkeletonRequest {
        source: Some(Source::Joints(v1::BodySkeleton {
            joints: ["hips", "left_leg"]
                .map(|name| v1::BodyJoint {
                    name: name.to_owned(),
                    parent: if name == "hips" { "" } else { "hips" }.to_owned(),
                    offset: Some(v1::Vec3 {
                        x: 0.1,
                        y: -0.8,
                        z: 0.0,
                    }),
                })
                .to_vec(),
            ..v1::BodySkeleton::default()
        })),
        name: "new".to_owned(),
        ..v1::PutSkeletonRequest::default()
    };
    both("PutSkeleton", &put)?;
    text("GetSkeleton", "txt", b"new")?;
    text("ListSkeletons", "txt", b"")?;
    text("DeleteSkeleton", "txt", b"new")?;
    text("ListScenes", "txt", b"")?;
    text("DeleteScene", "txt", b"yard")?;
    grpc(
        "DeleteScene",
        &v1::DeleteSceneRequest {
            name: "yard".to_owned(),
        }
        .encode_to_vec(),
    )?;
    let add = v1::AddObjectsRequest {
        scene: "yard".to_owned(),
        objects: vec![object("three")],
        ..v1::AddObjectsRequest::default()
    };
    both("AddObjects", &add)?;
    let moved = v1::ObjectMove {
        id: "stool-1".to_owned(),
        position: vec3(3.0, 0.0, 1.0),
        heading: Some(1.0),
        rotation: None,
    };
    both(
        "MoveObjects",
        &v1::MoveObjectsRequest {
            scene: "yard".to_owned(),
            moves: vec![moved],
            ..v1::MoveObjectsRequest::default()
        },
    )?;
    both(
        "RemoveObjects",
        &v1::RemoveObjectsRequest {
            scene: "yard".to_owned(),
            ids: vec!["stool-2".to_owned()],
        },
    )?;
    let stool = STOOL.replace("\"stool\"", "\"new\"");
    let put = v1::PutObjectDefinitionRequest {
        document: toml(&stool),
        check_only: false,
        ..v1::PutObjectDefinitionRequest::default()
    };
    both("PutObjectDefinition", &put)?;
    text("GetObjectDefinition", "txt", b"?format=json")?;
    grpc(
        "GetObjectDefinition",
        &v1::GetObjectDefinitionRequest {
            name: "stool".to_owned(),
            format: 1,
        }
        .encode_to_vec(),
    )?;
    text("ListObjectDefinitions", "txt", b"")?;
    text("DeleteObjectDefinition", "txt", b"stool")?;
    grpc(
        "DeleteObjectDefinition",
        &v1::DeleteObjectDefinitionRequest {
            name: "stool".to_owned(),
        }
        .encode_to_vec(),
    )?;
    let detect = v1::DetectRequest {
        session_id: "a".to_owned(),
        ahead: 3.0,
        only_free: true,
        ..v1::DetectRequest::default()
    };
    both("Detect", &detect)?;
    let asked = v1::DetectBox {
        scene: "yard".to_owned(),
        half_extents: vec3(1.0, 1.0, 1.0),
        sweep: vec3(0.0, 0.0, 3.0),
        ..v1::DetectBox::default()
    };
    text(
        "Detect",
        "box.json",
        &serde_json::to_vec(&v1::DetectRequest {
            r#box: Some(asked),
            ..v1::DetectRequest::default()
        })?,
    )?;
    text("CreateTicket", "txt", b"")
}

/// Writes a seed of the call over HTTP and one over gRPC.
fn both<T: Message + Serialize>(rpc: &str, request: &T) -> Result<(), Problem> {
    let json = serde_json::to_vec(request)?;
    text(rpc, "json", &json)?;
    grpc(rpc, &request.encode_to_vec())
}

/// Writes a seed of the call over HTTP: a body, or the rest of a path.
fn text(rpc: &str, kind: &str, bytes: &[u8]) -> Result<(), Problem> {
    let first = Call::byte(rpc, true).ok_or("no such call")?;
    Ok(write(
        "calls",
        &format!("{rpc}.{kind}"),
        &[&[first], bytes].concat(),
    )?)
}

fn grpc(rpc: &str, bytes: &[u8]) -> Result<(), Problem> {
    let first = Call::byte(rpc, false).ok_or("no such call")?;
    Ok(write(
        "calls",
        &format!("{rpc}.bin"),
        &[&[first], bytes].concat(),
    )?)
}

fn toml(text: &str) -> Option<v1::Document> {
    Some(v1::Document {
        format: v1::DocumentFormat::Toml.into(),
        text: text.to_owned(),
    })
}

//! Rewrites the seeds of the targets `calls`, `glb`, `gltf`, `npy`, `npz`, `snapshot`, `sonic` and
//! `websocket`: `cargo run -p troupe-fuzz --example seeds`. Run it after a change of a call or of a
//! record in the store.

mod calls;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prost::Message as _;
use troupe_base::turns::Turns;
use troupe_fuzz::{HEAD_BYTES, Local, SEPARATOR, robot, two_joints};
use troupe_live::records::{Kind, Records};
use troupe_motion::files::{write_beyond_mimic, write_npz, write_qpos};
use troupe_motion::glb::write_glb;
use troupe_motion::robot::{reference, sonic_files};
use troupe_motion::{Clip, Quat, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::command::Intent;
use troupe_proto::v1::drive_request::Message as Ask;

/// A session's record in the store of the server: format, pack, body, skeleton and its scale,
/// convention, seed, scene, time to live, priority, style, character.
type Record<'a> = (
    u32,
    &'a str,
    &'a str,
    &'a str,
    f32,
    u32,
    u64,
    Option<&'a str>,
    u64,
    f32,
    &'a str,
    &'a [u8],
);

type Problem = Box<dyn std::error::Error>;

fn main() -> Result<(), Problem> {
    calls::write_all()?;
    clips()?;
    websocket()?;
    snapshot()
}

fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target)
}

fn write(target: &str, name: &str, bytes: &[u8]) -> io::Result<()> {
    fs::write(folder(target).join(name), bytes)
}

/// Two joints that turn for three frames, as a file of each format that has no text.
fn clips() -> Result<(), Problem> {
    let skeleton = Arc::new(two_joints());
    let roots = (0..3).map(|frame| Vec3::new(0.0, 1.0, 0.5 * frame as f32));
    let turns = (0..6).map(|nth| Quat::from_rotation_x(0.1 * nth as f32));
    let clip = Clip::new(skeleton, 2.0, roots.collect(), turns.collect())?;
    write("glb", "two-joints.glb", &write_glb(&clip)?)?;
    write("npz", "two-joints.npz", &write_npz(&clip)?)?;
    write("gltf", "two-joints.bin", &as_text(&write_glb(&clip)?)?)?;
    robots()
}

/// A glb as text that points to a file beside it, and that file.
fn as_text(glb: &[u8]) -> Result<Vec<u8>, Problem> {
    let length = u32::from_le_bytes(glb[12..16].try_into()?) as usize;
    let (text, rest) = glb[20..].split_at(length);
    let mut document: serde_json::Value = serde_json::from_slice(text)?;
    document["buffers"][0]["uri"] = "walk.bin".into();
    Ok([&serde_json::to_vec(&document)?, &rest[8..]].join(&SEPARATOR))
}

/// A robot that stands for two frames, in the layouts for robots.
fn robots() -> Result<(), Problem> {
    let skeleton = robot();
    let joints = skeleton.joint_count();
    let roots = vec![Vec3::new(0.0, 0.8, 0.1), Vec3::new(0.0, 0.8, 0.2)];
    let clip = Clip::new(skeleton, 50.0, roots, vec![Quat::IDENTITY; 2 * joints])?;
    write("npy", "two-rows.npy", &write_qpos(&clip)?)?;
    write(
        "npz",
        "beyond-mimic.npz",
        &write_beyond_mimic(&clip.slice(0..1)?)?,
    )?;
    let files = sonic_files(&reference(&clip)?, "stand");
    let text = |wanted: &str| {
        let found = files.iter().find(|file| file.0 == wanted);
        found.map_or(&b""[..], |file| file.1.as_bytes())
    };
    let whole = ["joint_pos.csv", "body_pos.csv", "body_quat.csv"].map(text);
    write("sonic", "stand.bin", &whole.join(&SEPARATOR))?;
    Ok(())
}

fn vec3(x: f32, y: f32, z: f32) -> Option<v1::Vec3> {
    Some(v1::Vec3 { x, y, z })
}

/// A keyframe of the two joints.
fn keyframe(z: f32) -> v1::Keyframe {
    v1::Keyframe {
        root: Some(v1::Root {
            position: vec3(0.0, 0.9, z),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: [1.0, 0.0, 0.0, 0.0].repeat(2),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

fn walk(id: &str, sequence: u64) -> v1::Command {
    let locomote = v1::Locomote {
        velocity: vec3(0.3, 0.0, 1.1),
        facing: Some(0.5),
        style: "normal".to_owned(),
        gait: "walk".to_owned(),
        height: Some(0.9),
    };
    v1::Command {
        session_id: id.to_owned(),
        sequence,
        at_frame: Some(3),
        priority: Some(0.5),
        intent: Some(Intent::Locomote(locomote)),
    }
}

fn sit(id: &str, sequence: u64) -> v1::Command {
    let interact = v1::Interact {
        instance: "stool-1".to_owned(),
        variant: "sit".to_owned(),
        approach: "front".to_owned(),
    };
    v1::Command {
        session_id: id.to_owned(),
        sequence,
        intent: Some(Intent::Interact(interact)),
        ..v1::Command::default()
    }
}

/// A stream that opens, takes a session, commands it and lets it go.
fn drive() -> Vec<v1::DriveRequest> {
    let open = v1::DriveOpen {
        rate_hz: 60,
        return_positions: true,
        ..v1::DriveOpen::default()
    };
    let session_ids = vec!["a".to_owned(), "b".to_owned()];
    [
        Ask::Open(open),
        Ask::Attach(v1::DriveAttach {
            session_ids: session_ids.clone(),
        }),
        Ask::Command(v1::CommandRequest {
            commands: vec![walk("a", 1), sit("a", 2)],
        }),
        Ask::Detach(v1::DriveDetach { session_ids }),
    ]
    .map(|message| v1::DriveRequest {
        message: Some(message),
    })
    .into()
}

fn websocket() -> Result<(), Problem> {
    let mut text = Vec::new();
    for ask in drive() {
        text.push(serde_json::to_vec(&ask)?);
    }
    write("websocket", "text.bin", &text.join(&SEPARATOR))?;
    let binary: Vec<_> = drive()
        .iter()
        .map(|ask| [&[0], ask.encode_to_vec().as_slice()].concat())
        .collect();
    write("websocket", "binary.bin", &binary.join(&SEPARATOR))?;
    // The first message and one more of each kind.
    for (name, second) in [("attach", 1), ("command", 2), ("detach", 3)] {
        let both = [text[0].as_slice(), text[second].as_slice()];
        write("websocket", &format!("{name}.bin"), &both.join(&SEPARATOR))?;
    }
    Ok(())
}

fn snapshot() -> Result<(), Problem> {
    kept("objects", false)?;
    kept("taken", true)
}

/// The records of a server. If `moves`, one session has used an object and another has walked.
fn kept(name: &str, moves: bool) -> Result<(), Problem> {
    let folder = std::env::temp_dir().join(format!("troupe-seeds-{}-{name}", std::process::id()));
    let local = Local::start(Some(folder.clone()));
    if moves {
        let request = v1::StepRequest {
            session_ids: vec!["a".to_owned(), "b".to_owned()],
            frames: 60,
            commands: vec![sit("a", 1), walk("b", 1)],
            ..v1::StepRequest::default()
        };
        let sessions = local.service().sessions();
        let plan = sessions.plan_step(&request)?;
        local.run(sessions.step(request, plan, Turns::endless()))?;
    }
    local.stop();
    let mut records = Records::open(&folder)?;
    for (_, record) in records.all(Kind::Scene)? {
        write(
            "snapshot",
            &format!("{name}.bin"),
            &[b"o".as_slice(), &record].concat(),
        )?;
    }
    for (id, record) in records.all(Kind::Session)? {
        let whole = [b"s".as_slice(), &record].concat();
        let (.., character): Record<'_> = postcard::from_bytes(&record)?;
        let body = character.get(HEAD_BYTES..).ok_or("no character")?;
        if moves {
            write(
                "snapshot",
                &format!("character-{id}.bin"),
                &[b"c".as_slice(), body].concat(),
            )?;
        } else {
            write("snapshot", &format!("session-{id}.bin"), &whole)?;
        }
    }
    drop(records);
    Ok(fs::remove_dir_all(folder)?)
}

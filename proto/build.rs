//! Generates the Rust types from `troupe/v1/*.proto`, and the gRPC services where the feature `grpc` is on, without a system
//! `protoc`.

use std::path::PathBuf;

use prost::Message as _;

const FILES: [&str; 4] = [
    "troupe/v1/motion.proto",
    "troupe/v1/event.proto",
    "troupe/v1/session.proto",
    "troupe/v1/scene.proto",
];

/// Messages that a client sends. An unknown JSON field there is a mistake worth reporting; in answers it must be
/// tolerated, so that an older client can read a newer server.
const REQUEST_MESSAGES: [&str; 59] = [
    "GenerateRequest",
    "Prompt",
    "Describe",
    "Vec3",
    "Quat",
    "Root",
    "RootVelocity",
    "Pose",
    "Keyframe",
    "Character",
    "InBetweenRequest",
    "ListPacksRequest",
    "GetPackRequest",
    "SessionOptions",
    "CreateSessionsRequest",
    "GetSessionRequest",
    "ListSessionsRequest",
    "CloseSessionsRequest",
    "Locomote",
    "Command",
    "CommandRequest",
    "StepRequest",
    "DriveOpen",
    "DriveAttach",
    "DriveDetach",
    "DriveRequest",
    "PeekRequest",
    "ListStylesRequest",
    "GetStyleRequest",
    "PutStyleRequest",
    "Style",
    "Gait",
    "GaitKey",
    "Interact",
    "EndInteraction",
    "Cancel",
    "DropHeld",
    "Document",
    "BoxShape",
    "ConvexShape",
    "HeightfieldShape",
    "ColliderShape",
    "Collider",
    "SceneObject",
    "Scene",
    "PutSceneRequest",
    "GetSceneRequest",
    "ListScenesRequest",
    "DeleteSceneRequest",
    "AddObjectsRequest",
    "ObjectMove",
    "MoveObjectsRequest",
    "RemoveObjectsRequest",
    "PutObjectDefinitionRequest",
    "GetObjectDefinitionRequest",
    "ListObjectDefinitionsRequest",
    "DeleteObjectDefinitionRequest",
    "DetectBox",
    "DetectRequest",
];

/// Optional fields, left out of the JSON where they are absent.
const OPTIONAL_FIELDS: [&str; 76] = [
    "Prompt.frame_count",
    "Root.position",
    "Root.heading",
    "RootVelocity.height",
    "Pose.root_height",
    "Keyframe.root",
    "Keyframe.velocity",
    "Keyframe.pose",
    "Character.frame_count",
    "Character.pose_steps",
    "CharacterResult.frames",
    "CharacterResult.intermediates",
    "InBetweenResponse.timing",
    "Joint.offset",
    "Pack.left_axis",
    "Pack.contact_rules",
    "Pack.robot",
    "Hinge.axis",
    "Hinge.rest",
    "SessionOptions.position",
    "SessionOptions.ttl_ms",
    "SessionOptions.look_ahead_frames",
    "SessionOptions.replan_interval_frames",
    "SessionOptions.root_ratio",
    "SessionOptions.priority",
    "Session.position",
    "Session.stats",
    "Locomote.velocity",
    "Locomote.facing",
    "Locomote.height",
    "Command.at_frame",
    "Command.priority",
    "CommandResult.problem",
    "SessionProblem.problem",
    "DriveClosing.reason",
    "PlanView.root_r_g1",
    "PeekResponse.session",
    "PeekResponse.future",
    "PeekResponse.plan",
    "PeekResponse.waiting",
    "Session.activity",
    "Session.held",
    "HeldObject.position",
    "HeldObject.rotation",
    "KeyframeReached.before",
    "KeyframeReached.after",
    "ObjectReleased.position",
    "ObjectReleased.rotation",
    "CharacterFell.height",
    "BoxShape.center",
    "BoxShape.half_extents",
    "ColliderShape.box",
    "ColliderShape.convex",
    "ColliderShape.heightfield",
    "Collider.position",
    "Collider.heading",
    "Collider.rotation",
    "Collider.shape",
    "SceneObject.position",
    "SceneObject.heading",
    "SceneObject.rotation",
    "PutSceneRequest.scene",
    "PutSceneRequest.document",
    "ObjectMove.position",
    "ObjectMove.heading",
    "ObjectMove.rotation",
    "ObjectResult.problem",
    "PutObjectDefinitionRequest.document",
    "PutObjectDefinitionResponse.definition",
    "GetObjectDefinitionResponse.definition",
    "GetObjectDefinitionResponse.document",
    "DetectBox.center",
    "DetectBox.half_extents",
    "DetectBox.sweep",
    "DetectRequest.box",
    "Detected.object",
];

/// Lists that most messages do not have, left out of the JSON where they are empty.
const SPARE_FIELDS: [&str; 9] = [
    "Keyframe.qpos",
    "Frames.six_d",
    "Frames.qpos",
    "Frames.hinge_residuals",
    "Frames.clamped_hinges",
    "FrameBlock.six_d",
    "FrameBlock.qpos",
    "FrameBlock.hinge_residuals",
    "FrameBlock.clamped_hinges",
];

/// Fields of an enumeration, the module of `proto/src/json.rs` that writes them as words, and the word of value 0.
const ENUM_FIELDS: [(&str, &str, &str); 15] = [
    ("SessionOptions.convention", "convention", "native"),
    ("Session.convention", "convention", "native"),
    ("Session.clock", "clock", "free"),
    ("CommandResult.status", "command_status", "accepted"),
    ("StepRequest.encoding", "encoding", "f32"),
    ("DriveOpen.encoding", "encoding", "f32"),
    ("Activity.kind", "activity_kind", "locomotion"),
    ("Document.format", "document_format", "toml"),
    ("SceneObject.state", "object_state", "free"),
    ("Scene.convention", "convention", "native"),
    ("GetSceneRequest.convention", "convention", "native"),
    ("AddObjectsRequest.convention", "convention", "native"),
    ("MoveObjectsRequest.convention", "convention", "native"),
    ("GetObjectDefinitionRequest.format", "document_format", "toml"),
    ("DetectRequest.convention", "convention", "native"),
];

/// Fields of bytes, base64 in JSON.
const BYTES_FIELDS: [&str; 3] = [
    "FrameBlock.packed_roots",
    "FrameBlock.packed_rotations",
    "FrameBlock.contacts",
];

/// Messages with a `oneof`, and its name among the schemas: in JSON it is an object with one member, named for the choice.
const ONE_OFS: [(&str, &str); 6] = [
    ("GenerateRequest.goal", "GenerateRequestGoal"),
    ("GenerateResponse.part", "GenerateResponsePart"),
    ("Command.intent", "CommandIntent"),
    ("SessionEvent.kind", "SessionEventKind"),
    ("DriveRequest.message", "DriveRequestMessage"),
    ("DriveResponse.message", "DriveResponseMessage"),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=troupe");
    let descriptors = protox::compile(FILES, ["."])?;

    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("troupe.v1.bin"), descriptors.encode_to_vec())?;

    let services = std::env::var_os("CARGO_FEATURE_GRPC").is_some();
    let mut config = tonic_prost_build::configure()
        .build_client(services)
        .build_server(services)
        .type_attribute(
            ".",
            "#[derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema)]",
        )
        .message_attribute(".", "#[serde(default)]");
    for message in REQUEST_MESSAGES {
        config = config.type_attribute(format!(".troupe.v1.{message}"), "#[serde(deny_unknown_fields)]");
    }
    for field in OPTIONAL_FIELDS {
        config = config.field_attribute(
            format!(".troupe.v1.{field}"),
            r#"#[serde(skip_serializing_if = "Option::is_none")]"#,
        );
    }
    for field in SPARE_FIELDS {
        config = config.field_attribute(
            format!(".troupe.v1.{field}"),
            r#"#[serde(skip_serializing_if = "Vec::is_empty")]"#,
        );
    }
    for (field, words, default) in ENUM_FIELDS {
        let attribute = format!(
            r#"#[serde(with = "crate::json::{words}")] #[schema(value_type = String, default = "{default}")]"#
        );
        config = config.field_attribute(format!(".troupe.v1.{field}"), attribute);
    }
    for field in BYTES_FIELDS {
        config = config.field_attribute(
            format!(".troupe.v1.{field}"),
            r#"#[serde(with = "crate::json::base64")] #[schema(value_type = String, format = Byte, default = "")]"#,
        );
    }
    for (field, schema) in ONE_OFS {
        config = config.type_attribute(
            format!(".troupe.v1.{field}"),
            format!(r#"#[serde(rename_all = "snake_case")] #[schema(as = {schema})]"#),
        );
    }
    config.compile_fds(descriptors)?;
    Ok(())
}

//! Generates the Rust types and the gRPC service from `troupe/v1/motion.proto`, without a system `protoc`.

use std::path::PathBuf;

use prost::Message as _;

/// Messages that a client sends. An unknown JSON field there is a mistake worth reporting; in answers it must be
/// tolerated, so that an older client can read a newer server.
const REQUEST_MESSAGES: [&str; 9] = [
    "Vec3",
    "Root",
    "RootVelocity",
    "Pose",
    "Keyframe",
    "Character",
    "InBetweenRequest",
    "ListPacksRequest",
    "GetPackRequest",
];

/// Optional fields, left out of the JSON where they are absent.
const OPTIONAL_FIELDS: [&str; 15] = [
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
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=troupe");
    let descriptors = protox::compile(["troupe/v1/motion.proto"], ["."])?;

    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("troupe.v1.bin"), descriptors.encode_to_vec())?;

    let mut config = tonic_prost_build::configure()
        .type_attribute(
            ".",
            "#[derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema)]",
        )
        .type_attribute(".", "#[serde(default)]");
    for message in REQUEST_MESSAGES {
        config = config.type_attribute(format!(".troupe.v1.{message}"), "#[serde(deny_unknown_fields)]");
    }
    for field in OPTIONAL_FIELDS {
        config = config.field_attribute(
            format!(".troupe.v1.{field}"),
            r#"#[serde(skip_serializing_if = "Option::is_none")]"#,
        );
    }
    config.compile_fds(descriptors)?;
    Ok(())
}

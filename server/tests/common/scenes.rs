//! Scenes and definitions as tests make them.

use tonic::transport::Channel;
use troupe_proto::v1;
use troupe_proto::v1::scenes_client::ScenesClient;

use super::TestServer;

/// A stool for the test packs.
pub const STOOL: &str = r#"
format = 1
name = "stool"
description = "A stool to sit down on."

[shape.box]
center_m = [0.0, 0.25, 0.0]
half_extents_m = [0.2, 0.25, 0.2]

[trigger]
reach_m = 0.6

[[approaches]]
name = "front"
directions_deg = [-45.0, 45.0]

[[variants]]
name = "sit"
entry = "sit"

[[sets]]
name = "sit"
hold_until_ended = true
keyframes = [{ height_m = 0.5, heading_deg = 0.0, from_ground = true }]
"#;

/// A yard with two stools.
pub const YARD: &str = r#"
format = 1
name = "yard"
ground_m = 0.0

[[colliders]]
id = "wall"
position_m = [0.0, 1.0, -5.0]
shape = { box = { half_extents_m = [5.0, 1.0, 0.1] } }

# Two metres ahead of the origin, and faces it.
[[objects]]
id = "stool-1"
definition = "stool"
position_m = [0.0, 0.0, 2.0]
heading_deg = 180.0

[[objects]]
id = "stool-2"
definition = "stool"
position_m = [8.0, 0.0, 0.0]
"#;

/// A client of the server's scenes.
pub async fn scenes(server: &TestServer) -> ScenesClient<Channel> {
    ScenesClient::new(server.channel().await).max_decoding_message_size(usize::MAX)
}

/// Puts a scene that is written as TOML.
pub async fn put_scene(
    client: &mut ScenesClient<Channel>,
    text: &str,
) -> Result<v1::SceneSummary, tonic::Status> {
    let request = v1::PutSceneRequest {
        document: Some(toml(text)),
        ..v1::PutSceneRequest::default()
    };
    Ok(client.put_scene(request).await?.into_inner())
}

/// Puts a definition that is written as TOML.
pub async fn put_stool(
    client: &mut ScenesClient<Channel>,
    text: &str,
) -> Result<v1::PutObjectDefinitionResponse, tonic::Status> {
    let request = v1::PutObjectDefinitionRequest {
        document: Some(toml(text)),
        ..v1::PutObjectDefinitionRequest::default()
    };
    Ok(client.put_object_definition(request).await?.into_inner())
}

fn toml(text: &str) -> v1::Document {
    v1::Document {
        format: v1::DocumentFormat::Toml.into(),
        text: text.to_owned(),
    }
}

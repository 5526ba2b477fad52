//! Adds a clip to a character's file as a further animation. Meshes, skins and all else stay.

use std::borrow::Cow;

use glam::{DQuat, DVec3, Quat};
use serde_json::{Value, json};

use super::document::{chunks, open};
use super::nodes::{Node, rest_nodes};
use super::{GlbError, GlbReadError};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::rotation::align_sign;

/// glTF's number for 32-bit floats.
const FLOAT: u32 = 5126;

/// Why a clip was not added to a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DressError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] GlbReadError),
    /// The file's bytes are in other files.
    #[error("its bytes are in other files; a .glb or .vrm file that holds all of its bytes is needed")]
    NotWhole,
    /// A joint of the clip is no node of the file, or several.
    #[error("joint {0:?} is not the name of one node of the file")]
    Node(String),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] GlbError),
}

/// Where the joints of a clip are in a file, and in which unit the file is.
#[derive(Clone, Debug, PartialEq)]
pub struct FileJoints {
    /// Metres a unit of the file.
    pub unit_m: f64,
    /// The number of each joint's node. Empty: joints are nodes by name.
    pub nodes: Vec<usize>,
}

impl Default for FileJoints {
    /// Nodes by name, in metres.
    fn default() -> Self {
        Self {
            unit_m: 1.0,
            nodes: Vec::new(),
        }
    }
}

/// The bytes of a binary glTF file with a clip on its skeleton as one more animation. The name gets
/// a number if the file has an animation of that name.
///
/// # Errors
/// [`DressError`], with the joint that is no node.
pub fn add_animation_at(
    bytes: &[u8],
    joints: &FileJoints,
    clip: &Clip,
    name: &str,
) -> Result<Vec<u8>, DressError> {
    if !bytes.starts_with(b"glTF") {
        return Err(DressError::NotWhole);
    }
    let nodes = rest_nodes(&open(bytes, &|_| None)?.gltf)?;
    let (text, blob) = chunks(bytes)?;
    let json_error = |error: serde_json::Error| GlbError::Json(error.to_string());
    let root: Value = serde_json::from_slice(&text).map_err(json_error)?;
    let tracks = tracks(&nodes, joints, clip)?;
    let mut file = File {
        bytes: blob.map_or_else(Vec::new, Cow::into_owned),
        root,
    };
    file.check()?;
    file.add(&tracks, clip, name);
    let json = serde_json::to_vec(&file.root).map_err(json_error)?;
    let made = gltf::Glb {
        header: gltf::binary::Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: json.into(),
        bin: Some(file.bytes.into()),
    };
    Ok(made.to_vec().map_err(|_| GlbError::TooLarge)?)
}

/// Values of one node: translations of the root, rotations of all.
struct Track {
    node: usize,
    path: &'static str,
    width: usize,
    values: Vec<f32>,
}

/// The node of each joint: by its number, or else by its name.
fn nodes_of(nodes: &[Node], at: &FileJoints, clip: &Clip) -> Result<Vec<usize>, DressError> {
    let by_name = |name: &str| {
        let named = |skinned: bool| {
            let found = (0..nodes.len()).filter(move |&node| !skinned || nodes[node].in_skin);
            let mut found = found.filter(|&node| nodes[node].name == name);
            (found.next(), found.next())
        };
        match (named(true), named(false)) {
            ((Some(node), None), _) | (_, (Some(node), None)) => Some(node),
            _ => None,
        }
    };
    let joints = clip.skeleton.joints.iter().enumerate().map(|(nth, joint)| {
        let node = match at.nodes.is_empty() {
            true => by_name(&joint.name),
            false => at.nodes.get(nth).copied().filter(|&node| node < nodes.len()),
        };
        node.ok_or_else(|| DressError::Node(joint.name.clone()))
    });
    joints.collect()
}

/// Local transforms of the joints' nodes, frame by frame.
fn tracks(nodes: &[Node], at: &FileJoints, clip: &Clip) -> Result<Vec<Track>, DressError> {
    let joints = nodes_of(nodes, at, clip)?;
    let mut joint_of = vec![None; nodes.len()];
    for (joint, &node) in joints.iter().enumerate() {
        joint_of[node] = Some(joint);
    }
    let base = nodes[joints[0]]
        .parent
        .map_or_else(Place::default, |parent| Place::of(nodes, parent));
    let world = WorldMotion::from_clip(clip);
    let mut translations = Vec::with_capacity(3 * clip.frames());
    let mut rotations: Vec<Vec<f32>> = vec![Vec::with_capacity(4 * clip.frames()); joints.len()];
    let mut before = vec![Quat::IDENTITY; joints.len()];
    for frame in 0..clip.frames() {
        let root = clip.root_positions[frame].as_dvec3() / at.unit_m;
        let local = base.turn.conjugate() * (root - base.at) / base.scale;
        translations.extend(local.as_vec3().to_array());
        let turns = world.rotations_at(frame);
        for (joint, &node) in joints.iter().enumerate() {
            let above = above(nodes, &joint_of, node, turns);
            let local = (above.conjugate() * turns[joint].as_dquat())
                .normalize()
                .as_quat();
            let local = align_sign(local, before[joint]);
            before[joint] = local;
            rotations[joint].extend(local.to_array());
        }
    }
    let mut tracks = vec![Track {
        node: joints[0],
        path: "translation",
        width: 3,
        values: translations,
    }];
    tracks.extend(joints.iter().zip(rotations).map(|(&node, values)| Track {
        node,
        path: "rotation",
        width: 4,
        values,
    }));
    Ok(tracks)
}

/// World rotation of a node's parent: a joint's as it is, other nodes at rest on it.
fn above(nodes: &[Node], joint_of: &[Option<usize>], node: usize, turns: &[Quat]) -> DQuat {
    let mut rest = DQuat::IDENTITY;
    let mut at = nodes[node].parent;
    // A circle ends after as many steps as there are nodes.
    for _ in 0..nodes.len() {
        let Some(parent) = at else { break };
        if let Some(joint) = joint_of[parent] {
            return turns[joint].as_dquat() * rest;
        }
        rest = nodes[parent].rotation * rest;
        at = nodes[parent].parent;
    }
    rest
}

/// A node at rest in the world.
struct Place {
    at: DVec3,
    turn: DQuat,
    scale: f64,
}

impl Default for Place {
    fn default() -> Self {
        Self {
            at: DVec3::ZERO,
            turn: DQuat::IDENTITY,
            scale: 1.0,
        }
    }
}

impl Place {
    fn of(nodes: &[Node], node: usize) -> Self {
        let line = std::iter::successors(Some(node), |&node| nodes[node].parent);
        let mut line: Vec<usize> = line.take(nodes.len()).collect();
        line.reverse();
        line.into_iter().fold(Self::default(), |above, node| {
            let node = &nodes[node];
            Self {
                at: above.at + above.turn * (node.translation * above.scale),
                turn: above.turn * node.rotation,
                scale: above.scale * node.scale.element_sum() / 3.0,
            }
        })
    }
}

/// A file while it grows.
struct File {
    root: Value,
    bytes: Vec<u8>,
}

impl File {
    /// Refuses a file whose first buffer is elsewhere.
    fn check(&self) -> Result<(), DressError> {
        let first = self.root.get("buffers").and_then(|buffers| buffers.get(0));
        match first.is_some_and(|buffer| buffer.get("uri").is_some()) {
            true => Err(DressError::NotWhole),
            false => Ok(()),
        }
    }

    fn add(&mut self, tracks: &[Track], clip: &Clip, name: &str) {
        let times: Vec<f32> = (0..clip.frames()).map(|frame| frame as f32 / clip.fps).collect();
        let last = times.last().copied().unwrap_or_default();
        let input = self.accessor(&times, 1, Some([0.0, last]));
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        for track in tracks {
            let output = self.accessor(&track.values, track.width, None);
            channels.push(json!({
                "sampler": samplers.len(),
                "target": { "node": track.node, "path": track.path },
            }));
            samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        }
        let name = self.unique(name);
        self.push(
            "animations",
            json!({ "name": name, "samplers": samplers, "channels": channels }),
        );
        let length = self.bytes.len();
        if self.root["buffers"].get(0).is_none() {
            self.push("buffers", json!({}));
        }
        self.root["buffers"][0]["byteLength"] = length.into();
    }

    /// Appends floats. Returns the index of their accessor.
    fn accessor(&mut self, values: &[f32], width: usize, range: Option<[f32; 2]>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes
            .extend(values.iter().flat_map(|value| value.to_le_bytes()));
        let view = self.push(
            "bufferViews",
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": 4 * values.len() }),
        );
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        let mut accessor = json!({
            "bufferView": view, "componentType": FLOAT, "count": values.len() / width, "type": kind,
        });
        if let Some([least, most]) = range {
            accessor["min"] = json!([least]);
            accessor["max"] = json!([most]);
        }
        self.push("accessors", accessor)
    }

    /// A name that no animation of the file has.
    fn unique(&self, name: &str) -> String {
        let animations = self.root["animations"].as_array().into_iter().flatten();
        let names: Vec<&str> = animations
            .filter_map(|animation| animation["name"].as_str())
            .collect();
        let mut made = name.to_owned();
        let mut number = 1;
        while names.contains(&&*made) {
            number += 1;
            made = format!("{name}_{number}");
        }
        made
    }

    /// Appends to a list of the file. Returns the index.
    fn push(&mut self, key: &str, value: Value) -> usize {
        let list = &mut self.root[key];
        if let Value::Array(items) = list {
            items.push(value);
            return items.len() - 1;
        }
        *list = Value::Array(vec![value]);
        0
    }
}

//! Reads an animation of a binary glTF file.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use gltf::json::validation::Checked;

use super::keys::{Keys, Track, read_track};
use crate::clip::{Clip, MAX_FRAMES};
use crate::convert::{self, ConvertError, Rules, Source, Transform};
use crate::skeleton::Skeleton;

/// Most nodes of a file.
pub const MAX_NODES: usize = 1 << 14;
/// Length of a file's header, bytes.
const HEADER_BYTES: usize = 12;
/// Rate of an animation whose keys do not show one, Hz.
const DEFAULT_FPS: f32 = 30.0;
/// Largest ratio between the axes of a scale. Beyond it, bones would change length as they turn.
const MAX_STRETCH: f64 = 1.01;
/// A node whose keys differ by less than this does not move, metres.
const STILL_M: f64 = 1e-4;

/// Options for turning an animation into a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct GlbOptions {
    /// Rate at which the animation is sampled, Hz. `None`: that of its keys.
    pub fps: Option<f32>,
    /// Name of the animation. `None`: the only one.
    pub animation: Option<String>,
    /// The character's left in the root joint's frame of reference, for clips with their own
    /// skeleton. `None`: found by the joints' names.
    pub left_axis: Option<Vec3>,
    /// Farthest that a joint may move in its parent, for clips with their own skeleton, metres;
    /// 0.001 by default.
    pub max_offset_variation_m: f32,
    /// Farthest that a joint may be from the given skeleton's offset, metres; 0.02 by default.
    pub max_offset_error_m: f32,
}

impl Default for GlbOptions {
    fn default() -> Self {
        Self {
            fps: None,
            animation: None,
            left_axis: None,
            max_offset_variation_m: 0.001,
            max_offset_error_m: 0.02,
        }
    }
}

/// Why a glTF file was not read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GlbReadError {
    /// The file is not glTF, or breaks its rules.
    #[error("no binary glTF: {0}")]
    Format(String),
    /// The file has more than [`MAX_NODES`] nodes.
    #[error("{0} nodes; at most {MAX_NODES} are read")]
    TooManyNodes(usize),
    /// A node has two parents, or is below itself.
    #[error("node {0:?} has more than one parent, or is its own")]
    Hierarchy(String),
    /// No animation moves a node.
    #[error("the file has no animation of its nodes")]
    NoAnimation,
    /// The file has several animations, and none is named.
    #[error("the file has {} animations; say which: {}", .0.len(), .0.join(", "))]
    SeveralAnimations(Vec<String>),
    /// No animation has this name.
    #[error("no animation {wanted:?}; the file has {}", .names.join(", "))]
    UnknownAnimation {
        /// The unknown name.
        wanted: String,
        /// The names in the file.
        names: Vec<String>,
    },
    /// A channel cannot be played.
    #[error("animation {animation:?}, node {node:?}: {reason}")]
    Channel {
        /// Name of the animation.
        animation: String,
        /// Name of the node.
        node: String,
        /// What is wrong with the channel.
        reason: String,
    },
    /// The frame rate is not finite and positive.
    #[error("the frame rate must be finite and positive, not {0}")]
    Rate(f32),
    /// The joints do not make a clip.
    #[error(transparent)]
    Convert(#[from] ConvertError),
}

/// A node that is a joint, or above one.
struct Node {
    name: String,
    parent: Option<usize>,
    is_joint: bool,
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
    translations: Option<Keys<DVec3>>,
    rotations: Option<Keys<DQuat>>,
    scales: Option<Keys<DVec3>>,
}

/// An animation of a file, with the nodes that it moves and those that are joints of skins.
pub struct GlbAnimation {
    /// Parents before children.
    nodes: Vec<Node>,
    start_s: f64,
    fps: f32,
    frames: usize,
}

/// Names of a file's animations, in its order. One without a name gets its number: `animation_0`.
///
/// # Errors
/// [`GlbReadError::Format`] if the file is not glTF.
pub fn animation_names(bytes: &[u8]) -> Result<Vec<String>, GlbReadError> {
    Ok(names(&open(bytes)?))
}

/// Reads an animation.
///
/// # Errors
/// [`GlbReadError`], with the names of animation and node.
pub fn parse(bytes: &[u8], options: &GlbOptions) -> Result<GlbAnimation, GlbReadError> {
    let file = open(bytes)?;
    let blob = file.blob.as_deref().unwrap_or_default();
    let names = names(&file);
    let nth = match (&options.animation, names.len()) {
        (_, 0) => return Err(GlbReadError::NoAnimation),
        (None, 1) => 0,
        (None, _) => return Err(GlbReadError::SeveralAnimations(names)),
        (Some(wanted), _) => match names.iter().position(|name| name == wanted) {
            Some(nth) => nth,
            None => {
                let wanted = wanted.clone();
                return Err(GlbReadError::UnknownAnimation { wanted, names });
            }
        },
    };
    let mut nodes = rest_nodes(&file)?;
    for animation in file.animations().skip(nth).take(1) {
        for channel in animation.channels() {
            let node = &mut nodes[channel.target().node().index()];
            let wrong = |node: &Node, reason| GlbReadError::Channel {
                animation: names[nth].clone(),
                node: node.name.clone(),
                reason,
            };
            match read_track(&channel, blob).map_err(|reason| wrong(node, reason))? {
                Track::Translation(keys) => node.translations = Some(keys),
                Track::Rotation(keys) => node.rotations = Some(keys),
                Track::Scale(keys) => node.scales = Some(keys),
                Track::Other => continue,
            }
            node.is_joint = true;
        }
    }
    GlbAnimation::new(joints(nodes)?, &names[nth], options.fps)
}

fn open(bytes: &[u8]) -> Result<gltf::Gltf, GlbReadError> {
    if !bytes.starts_with(b"glTF") {
        let reason = "it does not begin with \"glTF\" (text files, .gltf, are not read)";
        return Err(GlbReadError::Format(reason.to_owned()));
    }
    let wrong = |reason: &str| GlbReadError::Format(reason.to_owned());
    let length = bytes
        .get(8..HEADER_BYTES)
        .and_then(|length| length.try_into().ok());
    if length.is_none_or(|length| (u32::from_le_bytes(length) as usize) < HEADER_BYTES) {
        return Err(wrong("its header is cut, or tells a length that is none"));
    }
    let format_error = |e: gltf::Error| GlbReadError::Format(e.to_string());
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice_without_validation(bytes).map_err(format_error)?;
    let mut json = document.into_json();
    keep_motion(&mut json);
    // The library takes these for granted, and checks everything else.
    let mut channels = json.animations.iter().flat_map(|animation| &animation.channels);
    let is_wrong = |target: &gltf::json::animation::Target| {
        target.node.value() >= json.nodes.len() || matches!(target.path, Checked::Invalid)
    };
    if channels.any(|channel| is_wrong(&channel.target)) {
        return Err(wrong(
            "a channel of an animation names no node, or no property of one",
        ));
    }
    let document = gltf::Document::from_json(json).map_err(format_error)?;
    Ok(gltf::Gltf { document, blob })
}

/// Removes everything but motion, so that nothing else can make a file unreadable.
fn keep_motion(json: &mut gltf::json::Root) {
    json.meshes.clear();
    json.materials.clear();
    json.textures.clear();
    json.images.clear();
    json.samplers.clear();
    json.cameras.clear();
    json.scenes.clear();
    json.scene = None;
    for node in &mut json.nodes {
        (node.mesh, node.camera, node.skin) = (None, None, None);
    }
    for skin in &mut json.skins {
        skin.inverse_bind_matrices = None;
    }
}

fn names(file: &gltf::Gltf) -> Vec<String> {
    let name = |animation: gltf::Animation<'_>| match animation.name() {
        Some(name) => name.to_owned(),
        None => format!("animation_{}", animation.index()),
    };
    file.animations().map(name).collect()
}

/// All nodes in the file's order, at rest.
fn rest_nodes(file: &gltf::Gltf) -> Result<Vec<Node>, GlbReadError> {
    let count = file.nodes().count();
    if count > MAX_NODES {
        return Err(GlbReadError::TooManyNodes(count));
    }
    let mut nodes: Vec<Node> = file.nodes().map(|node| rest_node(&node)).collect();
    for node in file.nodes() {
        for child in node.children() {
            let child = &mut nodes[child.index()];
            if child.parent.replace(node.index()).is_some() {
                return Err(GlbReadError::Hierarchy(child.name.clone()));
            }
        }
    }
    for skin in file.skins() {
        for joint in skin.joints() {
            nodes[joint.index()].is_joint = true;
        }
    }
    Ok(nodes)
}

fn rest_node(node: &gltf::Node<'_>) -> Node {
    let (translation, rotation, scale) = node.transform().decomposed();
    Node {
        name: match node.name() {
            Some(name) => name.to_owned(),
            None => format!("node_{}", node.index()),
        },
        parent: None,
        is_joint: false,
        translation: DVec3::from(translation.map(f64::from)),
        rotation: DQuat::from_array(rotation.map(f64::from)).normalize(),
        scale: DVec3::from(scale.map(f64::from)),
        translations: None,
        rotations: None,
        scales: None,
    }
}

/// The joints and what is above them, depth first, children in the file's order.
fn joints(nodes: Vec<Node>) -> Result<Vec<Node>, GlbReadError> {
    let mut wanted = vec![false; nodes.len()];
    for node in 0..nodes.len() {
        let mut at = nodes[node].is_joint.then_some(node);
        // As many steps as there are nodes lead to a root, or round a circle.
        for _ in 0..=nodes.len() {
            match at {
                Some(above) if !wanted[above] => {
                    wanted[above] = true;
                    at = nodes[above].parent;
                }
                _ => break,
            }
        }
    }
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    let mut open = Vec::new();
    for node in (0..nodes.len()).rev().filter(|&node| wanted[node]) {
        match nodes[node].parent {
            Some(parent) => children[parent].push(node),
            None => open.push(node),
        }
    }
    let mut order = Vec::new();
    let mut place = vec![None; nodes.len()];
    while let Some(node) = open.pop() {
        place[node] = Some(order.len());
        order.push(node);
        open.extend_from_slice(&children[node]);
    }
    let mut nodes: Vec<Option<Node>> = nodes.into_iter().map(Some).collect();
    // Nodes that no root leads to are in a circle.
    let lost = (0..nodes.len()).find(|&node| wanted[node] && place[node].is_none());
    if let Some(node) = lost.and_then(|node| nodes[node].take()) {
        return Err(GlbReadError::Hierarchy(node.name));
    }
    let sorted = order
        .iter()
        .filter_map(|&node| nodes[node].take())
        .map(|node| Node {
            parent: node.parent.and_then(|parent| place[parent]),
            ..node
        });
    Ok(sorted.collect())
}

impl GlbAnimation {
    fn new(nodes: Vec<Node>, name: &str, fps: Option<f32>) -> Result<Self, GlbReadError> {
        let times = || nodes.iter().flat_map(Node::times);
        let Some(start) = times().map(|times| times[0]).reduce(f32::min) else {
            return Err(GlbReadError::NoAnimation);
        };
        let end = times().map(|times| times[times.len() - 1]).fold(start, f32::max);
        let fps = fps.unwrap_or_else(|| rate(times()));
        if !(fps.is_finite() && fps > 0.0) {
            return Err(GlbReadError::Rate(fps));
        }
        for node in &nodes {
            node.check(name)?;
        }
        // A tolerance of a thousandth of a frame: times are rounded, and the last frame must not be
        // lost.
        let (start_s, length_s) = (f64::from(start), f64::from(end) - f64::from(start));
        let frames = (length_s * f64::from(fps) + 1e-3).floor() + 1.0;
        if frames > MAX_FRAMES as f64 {
            let (frames, joints) = (frames as usize, nodes.len());
            return Err(ConvertError::TooLong { frames, joints }.into());
        }
        Ok(Self {
            nodes,
            start_s,
            fps,
            frames: frames as usize,
        })
    }

    /// A clip with its own skeleton: the joints of skins, and the nodes that the animation moves.
    /// Nodes above them, and a root that only places its child, are folded into the root's
    /// transform. Offsets are mean places; the ground is at height 0.
    ///
    /// # Errors
    /// [`GlbReadError::Convert`], for example for a joint below the root that moves in its parent.
    pub fn to_clip(&self, options: &GlbOptions) -> Result<Clip, GlbReadError> {
        Ok(convert::to_clip(self, &options.into())?)
    }

    /// A clip on a given skeleton; joints are matched by name. Nodes that the skeleton lacks are
    /// folded into their descendants.
    ///
    /// # Errors
    /// [`GlbReadError::Convert`], for example if the file lacks joints of the skeleton.
    pub fn to_clip_on(&self, skeleton: &Arc<Skeleton>, options: &GlbOptions) -> Result<Clip, GlbReadError> {
        Ok(convert::to_clip_on(self, skeleton, &options.into())?)
    }

    /// Rate at which the animation is sampled, Hz.
    pub fn fps(&self) -> f32 {
        self.fps
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }
}

/// The rate of the closest keys; a whole number if it is near to one.
fn rate<'a>(times: impl Iterator<Item = &'a [f32]>) -> f32 {
    let step = times
        .flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0]))
        .fold(f32::INFINITY, f32::min);
    let fps = 1.0 / step;
    match fps {
        fps if !(1.0..=1000.0).contains(&fps) => DEFAULT_FPS,
        fps if (fps - fps.round()).abs() < 0.02 * fps => fps.round(),
        fps => fps,
    }
}

impl Node {
    fn times(&self) -> impl Iterator<Item = &[f32]> {
        let moves = [&self.translations, &self.scales];
        let moves = moves.into_iter().flatten().map(Keys::times);
        moves.chain(self.rotations.iter().map(Keys::times))
    }

    /// Refuses a node that stretches what is below it.
    fn check(&self, animation: &str) -> Result<(), GlbReadError> {
        let wrong = |reason: String| GlbReadError::Channel {
            animation: animation.to_owned(),
            node: self.name.clone(),
            reason,
        };
        if !(self.translation.is_finite() && self.rotation.is_finite() && self.scale.is_finite()) {
            return Err(wrong("its transform is not finite".to_owned()));
        }
        let keys = self.scales.iter().flat_map(Keys::all);
        for scale in keys.chain([self.scale]) {
            if scale.min_element() <= 0.0 || scale.max_element() > MAX_STRETCH * scale.min_element() {
                return Err(wrong(format!(
                    "scale {scale}: it must be positive and the same in all directions within 1 %"
                )));
            }
        }
        Ok(())
    }
}

impl From<&GlbOptions> for Rules {
    fn from(options: &GlbOptions) -> Self {
        Self {
            scale_to_metres: 1.0,
            fold_root: true,
            left_axis: options.left_axis,
            max_offset_variation_m: options.max_offset_variation_m,
            max_offset_error_m: options.max_offset_error_m,
        }
    }
}

impl Source for GlbAnimation {
    fn joint_count(&self) -> usize {
        self.nodes.len()
    }

    fn name(&self, joint: usize) -> &str {
        &self.nodes[joint].name
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.nodes[joint].parent
    }

    fn moves(&self, joint: usize) -> bool {
        let Some(keys) = &self.nodes[joint].translations else {
            return false;
        };
        let first = keys.all().next().unwrap_or_default();
        keys.all().any(|place| place.distance(first) > STILL_M)
    }

    fn is_joint(&self, joint: usize) -> bool {
        self.nodes[joint].is_joint
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn fps(&self) -> f32 {
        self.fps
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let time_s = self.start_s + frame as f64 / f64::from(self.fps);
        // Scale of each node's children in the world.
        let mut sizes = vec![1.0; self.nodes.len()];
        for (nth, node) in self.nodes.iter().enumerate() {
            let size = node.parent.map_or(1.0, |parent| sizes[parent]);
            let place = node
                .translations
                .as_ref()
                .map_or(node.translation, |keys| keys.at(time_s));
            let turn = node
                .rotations
                .as_ref()
                .map_or(node.rotation, |keys| keys.at(time_s));
            let scale = node.scales.as_ref().map_or(node.scale, |keys| keys.at(time_s));
            sizes[nth] = size * scale.element_sum() / 3.0;
            out[nth] = Transform {
                place: place * size,
                turn,
            };
        }
    }
}

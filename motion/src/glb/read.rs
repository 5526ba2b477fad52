//! Reads an animation of a glTF file.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use gltf::animation::Property;

use super::document::{Beside, Document, open};
use super::keys::{Keys, Track, read_track};
use super::nodes::{Node, joints, leave_props_out, rest_nodes};
use crate::clip::{Clip, MAX_FRAMES};
use crate::convert::{self, ConvertError, Rules, Source, Transform};
use crate::skeleton::Skeleton;

/// Most nodes of a file.
pub const MAX_NODES: usize = 1 << 14;
/// Rate of an animation whose keys do not show one, Hz.
const DEFAULT_FPS: f32 = 30.0;
/// A node whose keys differ by less than this does not move, metres.
const STILL_M: f64 = 1e-4;

/// Options for turning an animation into a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct GlbOptions {
    /// Rate at which the animation is sampled, Hz. `None`: that of its keys.
    pub fps: Option<f32>,
    /// Name of the animation. `None`: the only one.
    pub animation: Option<String>,
    /// Takes the skins' joints at rest as one frame, and reads no animation.
    pub at_rest: bool,
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
            at_rest: false,
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
    #[error("no glTF: {0}")]
    Format(String),
    /// The file has more than [`MAX_NODES`] nodes.
    #[error("{0} nodes; at most {MAX_NODES} are read")]
    TooManyNodes(usize),
    /// A node has two parents, or is below itself.
    #[error("node {0:?} has more than one parent, or is its own")]
    Hierarchy(String),
    /// No skin has joints.
    #[error(
        "the file has no skin, whose joints would be the character's; bind the mesh to bones, and export both"
    )]
    NoSkin,
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

/// An animation of a file, with the nodes that it moves and those that are joints of skins.
pub struct GlbAnimation {
    /// Parents before children.
    nodes: Vec<Node>,
    start_s: f64,
    fps: f32,
    /// Rate of the closest keys, Hz.
    keys_fps: f32,
    frames: usize,
    origin: Origin,
}

/// What a file says about itself, and what of it is not read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Origin {
    /// Name and version of the program that wrote it, if it says so.
    pub(crate) generator: Option<String>,
    /// Name of the animation.
    pub(crate) animation: String,
    /// Channels that move no node.
    pub(crate) ignored_channels: usize,
    /// Names of moving nodes that are not of the body.
    pub(crate) props: Vec<String>,
}

/// Names of a file's animations, in its order. One without a name gets its number: `animation_0`.
///
/// # Errors
/// [`GlbReadError::Format`] if the file is not glTF.
pub fn animation_names(bytes: &[u8]) -> Result<Vec<String>, GlbReadError> {
    animation_names_beside(bytes, &|_| None)
}

/// As [`animation_names`], for a file that may need others: `beside` gives their bytes by name.
///
/// # Errors
/// As [`animation_names`].
pub fn animation_names_beside(bytes: &[u8], beside: Beside<'_>) -> Result<Vec<String>, GlbReadError> {
    Ok(names(&open(bytes, beside)?.gltf))
}

/// Reads an animation of a file that holds all of its bytes.
///
/// # Errors
/// [`GlbReadError`], with the names of animation and node.
pub fn parse(bytes: &[u8], options: &GlbOptions) -> Result<GlbAnimation, GlbReadError> {
    parse_beside(bytes, &|_| None, options)
}

/// Reads an animation of a file, binary or text, whose bytes may be in files beside it.
///
/// # Errors
/// [`GlbReadError`], with the names of animation and node.
pub fn parse_beside(
    bytes: &[u8],
    beside: Beside<'_>,
    options: &GlbOptions,
) -> Result<GlbAnimation, GlbReadError> {
    let Document {
        gltf: file,
        buffers,
        ignored_channels,
        generator,
    } = open(bytes, beside)?;
    if options.at_rest {
        let nodes = joints(rest_nodes(&file)?)?;
        let origin = Origin {
            generator,
            ..Origin::default()
        };
        return GlbAnimation::at_rest(nodes, origin);
    }
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
            match read_track(&channel, &buffers).map_err(|reason| wrong(node, reason))? {
                Track::Translation(keys) => node.translations = Some(keys),
                Track::Rotation(keys) => node.rotations = Some(keys),
                Track::Scale(keys) => node.scales = Some(keys),
                Track::Other => continue,
            }
            node.is_joint = true;
        }
    }
    for channel in file.animations().flat_map(|animation| animation.channels()) {
        let node = &mut nodes[channel.target().node().index()];
        if channel.target().property() == Property::Translation && !node.ever_moves {
            // Other animations may be broken: they are not read here.
            let track = read_track(&channel, &buffers);
            node.ever_moves = matches!(track, Ok(Track::Translation(keys)) if is_moving(&keys));
        }
    }
    let origin = Origin {
        generator,
        animation: names[nth].clone(),
        ignored_channels,
        props: leave_props_out(&mut nodes),
    };
    GlbAnimation::new(joints(nodes)?, origin, options.fps)
}

fn names(file: &gltf::Document) -> Vec<String> {
    let name = |animation: gltf::Animation<'_>| match animation.name() {
        Some(name) => name.to_owned(),
        None => format!("animation_{}", animation.index()),
    };
    file.animations().map(name).collect()
}

impl GlbAnimation {
    /// One frame in which nothing moves.
    fn at_rest(nodes: Vec<Node>, origin: Origin) -> Result<Self, GlbReadError> {
        if nodes.is_empty() {
            return Err(GlbReadError::NoSkin);
        }
        for node in &nodes {
            node.check("none")?;
        }
        Ok(Self {
            nodes,
            start_s: 0.0,
            fps: DEFAULT_FPS,
            keys_fps: DEFAULT_FPS,
            frames: 1,
            origin,
        })
    }

    fn new(nodes: Vec<Node>, origin: Origin, fps: Option<f32>) -> Result<Self, GlbReadError> {
        let times = || nodes.iter().flat_map(Node::times);
        let Some(start) = times().map(|times| times[0]).reduce(f32::min) else {
            return Err(GlbReadError::NoAnimation);
        };
        let end = times().map(|times| times[times.len() - 1]).fold(start, f32::max);
        let keys_fps = rate(times());
        let fps = fps.unwrap_or(keys_fps);
        if !(fps.is_finite() && fps > 0.0) {
            return Err(GlbReadError::Rate(fps));
        }
        for node in &nodes {
            node.check(&origin.animation)?;
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
            keys_fps,
            frames: frames as usize,
            origin,
        })
    }

    /// What the file says about itself, and what of it is not read.
    pub(crate) fn origin(&self) -> &Origin {
        &self.origin
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

    /// Rate of the closest keys, Hz; 30 if they show none.
    pub fn keys_fps(&self) -> f32 {
        self.keys_fps
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }
}

/// Whether places differ.
fn is_moving(keys: &Keys<DVec3>) -> bool {
    let first = keys.all().next().unwrap_or_default();
    keys.all().any(|place| place.distance(first) > STILL_M)
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

    fn node(&self, joint: usize) -> Option<usize> {
        Some(self.nodes[joint].index)
    }

    fn moves(&self, joint: usize) -> bool {
        let Some(keys) = &self.nodes[joint].translations else {
            return false;
        };
        is_moving(keys)
    }

    fn ever_moves(&self, joint: usize) -> bool {
        self.nodes[joint].ever_moves
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

    fn rest(&self, out: &mut [Transform]) {
        self.transforms(out, |node| (node.translation, node.rotation, node.scale));
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let time_s = self.start_s + frame as f64 / f64::from(self.fps);
        self.transforms(out, |node| {
            let place = node.translations.as_ref();
            let turn = node.rotations.as_ref();
            let scale = node.scales.as_ref();
            (
                place.map_or(node.translation, |keys| keys.at(time_s)),
                turn.map_or(node.rotation, |keys| keys.at(time_s)),
                scale.map_or(node.scale, |keys| keys.at(time_s)),
            )
        });
    }
}

impl GlbAnimation {
    /// Transforms of all nodes in their parents, with the scale of those above in the places.
    fn transforms(&self, out: &mut [Transform], of: impl Fn(&Node) -> (DVec3, DQuat, DVec3)) {
        // Scale of each node's children in the world.
        let mut sizes = vec![1.0; self.nodes.len()];
        for (nth, node) in self.nodes.iter().enumerate() {
            let size = node.parent.map_or(1.0, |parent| sizes[parent]);
            let (place, turn, scale) = of(node);
            sizes[nth] = size * scale.element_sum() / 3.0;
            out[nth] = Transform {
                place: place * size,
                turn,
            };
        }
    }
}

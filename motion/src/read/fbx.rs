//! FBX, by the library ufbx. It converts axes and units; what is here is the choice of joints and
//! of the animation.

use glam::{DQuat, DVec3};
use ufbx::{
    AnimStack, CoordinateAxes, ElementType, InheritModeHandling, LoadOpts, Node, Scene, SceneRoot,
    SpaceConversion,
};

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::producer;
use super::report::{Basis, Finding, Format, Up};
use super::stance::Stated;
use super::units::UNITS;
use crate::clip::MAX_FRAMES;
use crate::convert::{Source, Transform};

/// Most memory that a file may take once opened, bytes.
const MEMORY_LIMIT: usize = 1 << 30;
/// Deepest tree of nodes.
const DEPTH_LIMIT: u32 = 512;
/// Most transforms, frames times joints, that are sampled.
const MAX_SAMPLES: usize = 1 << 23;
/// Rates that are believed, Hz.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1000.0;
/// Rate of files without one, Hz.
const USUAL_FPS: f32 = 30.0;
/// Largest ratio between the axes of a scale.
const MAX_STRETCH: f64 = 1.01;
/// A joint whose places differ by less does not move, metres.
const STILL_M: f64 = 1e-4;

/// Opens a file, with Y up and in metres.
fn load(bytes: &[u8]) -> Result<SceneRoot, ReadErrorKind> {
    let mut opts = LoadOpts {
        ignore_geometry: true,
        ignore_embedded: true,
        skip_skin_vertices: true,
        node_depth_limit: DEPTH_LIMIT,
        target_axes: CoordinateAxes::right_handed_y_up(),
        target_unit_meters: 1.0,
        space_conversion: SpaceConversion::AdjustTransforms,
        inherit_mode_handling: InheritModeHandling::Compensate,
        ..LoadOpts::default()
    };
    opts.temp_allocator.memory_limit = MEMORY_LIMIT;
    opts.result_allocator.memory_limit = MEMORY_LIMIT;
    let scene = ufbx::load_memory(bytes, opts);
    scene.map_err(|error| fault(format!("no FBX that can be read: {}", &*error.description)))
}

/// Names of its animations.
pub(super) fn animations(bytes: &[u8]) -> Result<Vec<String>, ReadErrorKind> {
    Ok(names(&*load(bytes)?))
}

fn names(scene: &Scene) -> Vec<String> {
    let stacks = scene.anim_stacks.iter();
    stacks.map(|stack| stack.element.name.to_string()).collect()
}

pub(super) fn parse(bytes: &[u8], options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    let scene = load(bytes)?;
    let nodes = joints(&scene);
    if nodes.is_empty() {
        return Err(fault(
            "it has no bones, and no other nodes that could be joints".to_owned(),
        ));
    }
    // A character needs no animation.
    let stack = match options.at_rest && scene.anim_stacks.is_empty() {
        true => None,
        false => {
            let found: &AnimStack = &scene.anim_stacks[stack(&scene, options)?];
            Some(found)
        }
    };
    let fps = rate(&scene, options);
    let motion = sample(&scene, &nodes, stack, fps.value)?;
    let names: Vec<&str> = motion.names.iter().map(String::as_str).collect();
    let creator = scene.metadata.creator.to_string();
    let creator = (!creator.is_empty()).then(|| Finding::new(creator, Basis::Stated, "its Creator"));
    let version = scene.metadata.version;
    Ok(Parsed {
        producer: producer::of_names(&names).or(creator),
        format: Finding::new(Format::Fbx, Basis::Found, format!("version {version}")),
        skeleton: None,
        stated: Stated {
            up: Some(Up::Y),
            unit_m: Some(1.0),
            units: &UNITS,
            may_be_y_up: false,
            by: "FBX says its axes and unit; both were converted to Y up and metres",
        },
        fps,
        repairs: Vec::new(),
        oddities: Vec::new(),
        source: Box::new(motion),
    })
}

fn fault(text: String) -> ReadErrorKind {
    ReadErrorKind::Fbx(text)
}

/// Indices of the nodes that are joints or above one, parents first, and whether each is a joint.
fn joints(scene: &Scene) -> Vec<(usize, bool)> {
    let is_bone = |node: &Node| node.bone.is_some();
    let has_bones = scene.nodes.iter().any(|node| is_bone(node));
    // Rigs without bones are made of empty nodes.
    let is_joint = |node: &Node| match has_bones {
        true => is_bone(node),
        false => !node.is_root && matches!(node.attrib_type, ElementType::Empty | ElementType::Unknown),
    };
    let mut wanted = vec![false; scene.nodes.len()];
    for node in scene.nodes.iter().filter(|node| is_joint(node)) {
        let mut at = Some(&**node);
        while let Some(node) = at.filter(|node| !node.is_root) {
            wanted[node.element.typed_id as usize] = true;
            at = node.parent.as_deref();
        }
    }
    let mut nodes: Vec<usize> = (0..scene.nodes.len()).filter(|&nth| wanted[nth]).collect();
    // Stable: nodes of one depth keep the file's order.
    nodes.sort_by_key(|&nth| scene.nodes[nth].node_depth);
    nodes
        .into_iter()
        .map(|nth| (nth, is_joint(&scene.nodes[nth])))
        .collect()
}

/// Index of the animation.
fn stack(scene: &Scene, options: &Options) -> Result<usize, ReadErrorKind> {
    let names = names(scene);
    match (&options.animation, &names[..]) {
        (_, []) => Err(ReadErrorKind::NoAnimation),
        (None, [_]) => Ok(0),
        (None, _) => Err(ReadErrorKind::SeveralAnimations(names)),
        (Some(wanted), _) => {
            let wanted = wanted.clone();
            let found = names.iter().position(|name| *name == wanted);
            found.ok_or(ReadErrorKind::UnknownAnimation { wanted, names })
        }
    }
}

fn rate(scene: &Scene, options: &Options) -> Finding<f32> {
    let stated = scene.settings.frames_per_second;
    match options.fps {
        Some(fps) => Finding::new(fps, Basis::Given, "--fps"),
        None if RATES.contains(&stated) => Finding::new(stated as f32, Basis::Stated, "its TimeMode"),
        None => Finding::new(
            USUAL_FPS,
            Basis::Assumed,
            "its TimeMode is no rate; --fps decides",
        ),
    }
}

/// An animation that was sampled.
struct Sampled {
    names: Vec<String>,
    parents: Vec<Option<usize>>,
    is_joint: Vec<bool>,
    rest: Vec<Transform>,
    /// `frames * joints`.
    locals: Vec<Transform>,
    fps: f32,
}

/// When an animation begins and ends, seconds. Some programs leave out a beginning at 0, and with
/// it the library finds no range: then it is that of the keys.
fn range_s(stack: &AnimStack) -> (f64, f64) {
    if stack.time_end > stack.time_begin {
        return (stack.time_begin, stack.time_end);
    }
    let values = stack.layers.iter().flat_map(|layer| layer.anim_values.iter());
    let curves = values.flat_map(|value| value.curves.iter().flatten());
    let times = curves
        .filter(|curve| !curve.keyframes.is_empty())
        .map(|curve| (curve.min_time, curve.max_time));
    let range = times.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    range.unwrap_or((stack.time_begin, stack.time_begin))
}

/// An animation, or the pose at rest as one frame.
fn sample(
    scene: &Scene,
    nodes: &[(usize, bool)],
    stack: Option<&AnimStack>,
    fps: f32,
) -> Result<Sampled, ReadErrorKind> {
    let (begin_s, end_s) = stack.map_or((0.0, 0.0), range_s);
    let length_s = end_s - begin_s;
    let frames = (length_s * f64::from(fps) + 1e-3).floor() + 1.0;
    if !(1.0..=MAX_FRAMES as f64).contains(&frames) || frames as usize * nodes.len() > MAX_SAMPLES {
        return Err(ReadErrorKind::Range {
            field: "the length of the animation".to_owned(),
            found: format!("{length_s} s, which is {frames} frames of {} joints", nodes.len()),
            allowed: format!("0 s or more, and {MAX_SAMPLES} frames times joints"),
            option: Some(Advice::new(
                "a lower {} takes fewer frames",
                [Choice::any(OptionName::Fps)],
            )),
        });
    }
    let mut place = vec![None; scene.nodes.len()];
    for (at, &(nth, _)) in nodes.iter().enumerate() {
        place[nth] = Some(at);
    }
    let parent = |nth: usize| {
        let parent = scene.nodes[nth].parent.as_deref()?;
        place[parent.element.typed_id as usize]
    };
    let mut sampled = Sampled {
        names: nodes
            .iter()
            .map(|&(nth, _)| scene.nodes[nth].element.name.to_string())
            .collect(),
        parents: nodes.iter().map(|&(nth, _)| parent(nth)).collect(),
        is_joint: nodes.iter().map(|node| node.1).collect(),
        rest: Vec::new(),
        locals: Vec::with_capacity(frames as usize * nodes.len()),
        fps,
    };
    let rest = |nth: usize| scene.nodes[nth].local_transform;
    sampled.rest = transforms(&sampled, nodes, &rest)?;
    for frame in 0..frames as usize {
        let time_s = begin_s + frame as f64 / f64::from(fps);
        let at = |nth: usize| match stack {
            Some(stack) => scene.nodes[nth].evaluate_transform(&stack.anim, time_s),
            None => rest(nth),
        };
        let frame = transforms(&sampled, nodes, &at)?;
        sampled.locals.extend(frame);
    }
    Ok(sampled)
}

/// Transforms of all joints in their parents, with the scale of those above in the places.
fn transforms(
    sampled: &Sampled,
    nodes: &[(usize, bool)],
    of: &dyn Fn(usize) -> ufbx::Transform,
) -> Result<Vec<Transform>, ReadErrorKind> {
    let mut sizes = vec![1.0; nodes.len()];
    let mut out = Vec::with_capacity(nodes.len());
    for (at, &(nth, _)) in nodes.iter().enumerate() {
        let size = sampled.parents[at].map_or(1.0, |parent| sizes[parent]);
        let ufbx::Transform {
            translation,
            rotation,
            scale,
        } = of(nth);
        let place = DVec3::new(translation.x, translation.y, translation.z);
        let turn = DQuat::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w);
        let scale = DVec3::new(scale.x, scale.y, scale.z);
        let is_even = scale.min_element() > 0.0 && scale.max_element() <= MAX_STRETCH * scale.min_element();
        if !(is_even && place.is_finite() && turn.is_finite() && turn.length() > 0.5) {
            return Err(fault(format!(
                "node {:?}: scale {scale}; it must be positive and the same in all directions within 1 %, \
                 and its place finite",
                sampled.names[at]
            )));
        }
        sizes[at] = size * scale.element_sum() / 3.0;
        out.push(Transform {
            place: place * size,
            turn: turn.normalize(),
        });
    }
    Ok(out)
}

impl Source for Sampled {
    fn joint_count(&self) -> usize {
        self.names.len()
    }

    fn name(&self, joint: usize) -> &str {
        &self.names[joint]
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.parents[joint]
    }

    fn moves(&self, joint: usize) -> bool {
        let mut places = self.locals.iter().skip(joint).step_by(self.names.len());
        let first = places.next().map_or(DVec3::ZERO, |at| at.place);
        places.any(|at| at.place.distance(first) > STILL_M)
    }

    fn is_joint(&self, joint: usize) -> bool {
        self.is_joint[joint]
    }

    fn frames(&self) -> usize {
        self.locals.len() / self.names.len().max(1)
    }

    fn fps(&self) -> f32 {
        self.fps
    }

    fn rest(&self, out: &mut [Transform]) {
        out.copy_from_slice(&self.rest);
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let joints = self.names.len();
        out.copy_from_slice(&self.locals[frame * joints..(frame + 1) * joints]);
    }
}

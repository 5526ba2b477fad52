//! Turns the hierarchy of a file of any format into a [`Clip`].

mod sides;

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DQuat, DVec3, Quat, Vec3};

use self::sides::{left_axis_by_words, left_axis_in, left_axis_of};
use crate::clip::{Clip, ClipError, MAX_ROTATIONS};
use crate::skeleton::{Joint, MAX_JOINTS, Skeleton, SkeletonError};

/// Bones that are shorter have no direction that matters, metres.
const MIN_BONE_M: f32 = 0.03;
/// How far a bone may point from the skeleton's if it is the only one of its joint, degrees. Bodies
/// of one rig differ by a few degrees; a T-pose and an A-pose by 45.
const MAX_BONE_ANGLE_DEG: f32 = 20.0;
/// As [`MAX_BONE_ANGLE_DEG`], where a joint has several bones: the places of hips and shoulders in
/// their parents differ more from body to body.
const MAX_FORK_ANGLE_DEG: f32 = 40.0;

/// A hierarchy of moving joints as a file has it, in the file's units.
pub(crate) trait Source {
    /// Number of joints.
    fn joint_count(&self) -> usize;
    /// A joint's name.
    fn name(&self, joint: usize) -> &str;
    /// Index of a joint's parent, smaller than the joint's own.
    fn parent(&self, joint: usize) -> Option<usize>;
    /// Number of the joint's node in its file. `None` for formats whose nodes have no numbers.
    #[cfg_attr(
        not(feature = "files"),
        expect(dead_code, reason = "only the reader of files keeps nodes")
    )]
    fn node(&self, _joint: usize) -> Option<usize> {
        None
    }
    /// Whether the file moves the joint in its parent.
    fn moves(&self, joint: usize) -> bool;
    /// Whether any animation of the file moves the joint in its parent, this one or another.
    #[cfg_attr(
        not(feature = "files"),
        expect(dead_code, reason = "only the reader of files looks for the body's root")
    )]
    fn ever_moves(&self, joint: usize) -> bool {
        self.moves(joint)
    }
    /// Whether it is a joint, and not only a node between the world and the joints.
    fn is_joint(&self, joint: usize) -> bool;
    /// Number of frames.
    fn frames(&self) -> usize;
    /// Frames a second.
    fn fps(&self) -> f32;
    /// Transforms of all joints in their parents at rest.
    #[cfg_attr(
        not(feature = "files"),
        expect(dead_code, reason = "only the reader of files compares rest poses")
    )]
    fn rest(&self, out: &mut [Transform]);
    /// Transforms of all joints in their parents in one frame.
    fn locals(&self, frame: usize, out: &mut [Transform]);
}

/// Which joints of a file become a clip.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Selection<'a> {
    /// The joint that becomes the clip's root. `None`: the first from the file's root on that does
    /// more than place its only child.
    pub(crate) root: Option<usize>,
    /// For each joint of the file, whether it and all below it are left out; empty: none.
    pub(crate) left_out: &'a [bool],
}

/// The options of all formats; [`BvhOptions`](crate::bvh::BvhOptions) documents them.
pub(crate) struct Rules {
    pub(crate) scale_to_metres: f32,
    pub(crate) fold_root: bool,
    pub(crate) left_axis: Option<Vec3>,
    pub(crate) max_offset_variation_m: f32,
    pub(crate) max_offset_error_m: f32,
}

/// Why a file's motion cannot become a clip.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The file has more than one root.
    #[error("the file has {0} roots, but a clip has one")]
    SeveralRoots(usize),
    /// Joints of the skeleton that the file lacks.
    #[error("the file lacks joints of the skeleton: {}", .0.join(", "))]
    MissingJoints(Vec<String>),
    /// A joint moves in its parent, which only the root may do.
    #[error(
        "joint {joint:?} moves in its parent: by {variation_m} m, most in frame {frame}; only the root may"
    )]
    VaryingOffset {
        /// Name of the joint.
        joint: String,
        /// The frame in which it is farthest from the first, from 0.
        frame: usize,
        /// Distance that it moves, metres.
        variation_m: f32,
    },
    /// A bone differs in length or direction from the skeleton's.
    #[error(
        "joint {joint:?} stands {error_m:.3} m from the skeleton's offset (frame {frame}); the skeletons differ"
    )]
    OffsetMismatch {
        /// Name of the joint.
        joint: String,
        /// The frame in which it is farthest off, from 0.
        frame: usize,
        /// Largest distance, metres.
        error_m: f32,
    },
    /// A bone points elsewhere at rest than the skeleton's, so that its rotations do not fit.
    #[error(
        "the bone from {parent:?} to {joint:?} points {angle_deg:.0}° away from the skeleton's at rest; \
         allowed: {allowed_deg:.0}°. The file's rest pose differs from the skeleton's: its rotations mean another pose. `troupe retarget FILE --to` a file of the skeleton carries the motion over"
    )]
    OtherRest {
        /// Name of the joint at the bone's end.
        joint: String,
        /// Name of the joint at its beginning.
        parent: String,
        /// Angle between the two bones, degrees.
        angle_deg: f32,
        /// Largest angle that is read, degrees.
        allowed_deg: f32,
    },
    /// The scale is not finite and positive.
    #[error("the scale must be finite and positive, not {0}")]
    Scale(f32),
    /// Frames times joints exceed [`MAX_ROTATIONS`]. Joints without channels take no text in a
    /// frame, so without this limit a small file could ask for any amount of memory.
    #[error(
        "{frames} frames of {joints} joints are too many: at most {} frames of so many joints are converted",
        MAX_ROTATIONS / (*joints).max(1)
    )]
    TooLong {
        /// Number of frames.
        frames: usize,
        /// Number of joints.
        joints: usize,
    },
    /// The joints do not make a skeleton: for example there are more than
    /// [`MAX_JOINTS`](crate::skeleton::MAX_JOINTS).
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The frames do not make a clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

/// The joints of a file that a clip takes: index in the file, and position of the parent in this
/// list.
type Taken = Vec<(usize, Option<usize>)>;

/// A clip with its own skeleton, made from the file's joints in their order. Offsets are the mean
/// places of the joints in their parents.
pub(crate) fn to_clip(source: &impl Source, rules: &Rules) -> Result<Clip, ConvertError> {
    let roots = (0..source.joint_count())
        .filter(|&j| source.parent(j).is_none())
        .count();
    if roots != 1 {
        return Err(ConvertError::SeveralRoots(roots));
    }
    Ok(to_clip_of(source, rules, Selection::default())?.0)
}

/// As [`to_clip`], for a selection of the joints. Returns also the index in the file of each joint
/// of the clip.
pub(crate) fn to_clip_of(
    source: &(impl Source + ?Sized),
    rules: &Rules,
    selection: Selection<'_>,
) -> Result<(Clip, Vec<usize>), ConvertError> {
    // A file that is too long is not played to find its root, but too many joints are reported
    // first.
    let root = match (selection.root, check(source, rules)) {
        (Some(root), _) => root,
        (None, Ok(())) => character_root(source, rules),
        (None, Err(_)) => 0,
    };
    let taken = subtree(source, root, selection.left_out);
    if taken.len() > MAX_JOINTS {
        return Err(SkeletonError::TooManyJoints(taken.len()).into());
    }
    let played = play(source, &taken, None, rules)?;
    let mut joints = Vec::with_capacity(taken.len());
    for (nth, (&(index, parent), place)) in taken.iter().zip(&played.places).enumerate() {
        let name = source.name(index).to_owned();
        if nth > 0 && place.farthest_m > rules.max_offset_variation_m {
            return Err(ConvertError::VaryingOffset {
                joint: name,
                frame: place.frame,
                variation_m: place.farthest_m,
            });
        }
        // The root's place is the clip's root position.
        let offset_m = if nth == 0 {
            Vec3::ZERO
        } else {
            place.mean(source.frames())
        };
        joints.push(Joint {
            name,
            parent,
            offset_m,
        });
    }
    let left_axis = rules
        .left_axis
        .or_else(|| left_axis_of(&joints))
        .or_else(|| left_axis_in(&joints, &played.rotations))
        .or_else(|| left_axis_by_words(&joints, &played.rotations))
        .unwrap_or(Vec3::X);
    let skeleton = Skeleton::new(joints, left_axis, 0.0, None)?;
    let clip = Clip::new(
        Arc::new(skeleton),
        source.fps(),
        played.root_positions,
        played.rotations,
    )?;
    Ok((clip, taken.into_iter().map(|(index, _)| index).collect()))
}

/// A clip on a given skeleton; joints are matched by name. Joints of the file that the skeleton
/// lacks are folded into their descendants.
pub(crate) fn to_clip_on(
    source: &(impl Source + ?Sized),
    skeleton: &Arc<Skeleton>,
    rules: &Rules,
) -> Result<Clip, ConvertError> {
    Ok(to_clip_on_of(source, skeleton, rules)?.clip)
}

/// A clip on a given skeleton, and how the file's joints fit it.
pub(crate) struct OnSkeleton {
    pub(crate) clip: Clip,
    /// Index in the file of each joint of the skeleton.
    #[cfg_attr(
        not(feature = "files"),
        expect(dead_code, reason = "only the reader of files asks")
    )]
    pub(crate) taken: Vec<usize>,
    /// The skeleton's joint whose bone points farthest from the skeleton's, and the angle in
    /// degrees.
    #[cfg_attr(
        not(feature = "files"),
        expect(dead_code, reason = "only the reader of files asks")
    )]
    pub(crate) farthest: Option<(usize, f32)>,
}

/// As [`to_clip_on`].
pub(crate) fn to_clip_on_of(
    source: &(impl Source + ?Sized),
    skeleton: &Arc<Skeleton>,
    rules: &Rules,
) -> Result<OnSkeleton, ConvertError> {
    let index: HashMap<&str, usize> = (0..source.joint_count())
        .rev()
        .map(|i| (source.name(i), i))
        .collect();
    let mut taken = Taken::with_capacity(skeleton.joint_count());
    let mut missing = Vec::new();
    for joint in &skeleton.joints {
        match index.get(joint.name.as_str()) {
            Some(&i) => taken.push((i, joint.parent)),
            None => missing.push(joint.name.clone()),
        }
    }
    if !missing.is_empty() {
        return Err(ConvertError::MissingJoints(missing));
    }
    let played = play(source, &taken, Some(skeleton), rules)?;
    for (joint, place) in skeleton.joints.iter().zip(&played.places).skip(1) {
        if place.farthest_m > rules.max_offset_error_m {
            return Err(ConvertError::OffsetMismatch {
                joint: joint.name.clone(),
                frame: place.frame,
                error_m: place.farthest_m,
            });
        }
    }
    let farthest = check_directions(skeleton, &played.places, source.frames())?;
    let clip = Clip::new(
        Arc::clone(skeleton),
        source.fps(),
        played.root_positions,
        played.rotations,
    )?;
    Ok(OnSkeleton {
        clip,
        taken: taken.into_iter().map(|(index, _)| index).collect(),
        farthest,
    })
}

/// Refuses bones that point elsewhere than the skeleton's: rotations then mean another pose. The
/// worst bone is named. Returns the joint whose bone is farthest off, with the angle in degrees.
fn check_directions(
    skeleton: &Skeleton,
    places: &[JointOffset],
    frames: usize,
) -> Result<Option<(usize, f32)>, ConvertError> {
    let mut children = vec![0; skeleton.joint_count()];
    for parent in skeleton.joints.iter().filter_map(|joint| joint.parent) {
        children[parent] += 1;
    }
    let angles = skeleton.joints.iter().zip(places).enumerate();
    let angles = angles.filter_map(|(nth, (joint, place))| {
        let (ours, theirs) = (joint.offset_m, place.mean(frames));
        let is_long = ours.length().min(theirs.length()) >= MIN_BONE_M;
        let parent = joint.parent.filter(|_| is_long)?;
        let allowed_deg = match children[parent] {
            1 => MAX_BONE_ANGLE_DEG,
            _ => MAX_FORK_ANGLE_DEG,
        };
        let angle_deg = ours.angle_between(theirs).to_degrees();
        Some((angle_deg, allowed_deg, nth, parent))
    });
    let angles: Vec<_> = angles.collect();
    let refused = angles
        .iter()
        .filter(|(angle_deg, allowed_deg, ..)| angle_deg > allowed_deg);
    if let Some(&(angle_deg, allowed_deg, nth, parent)) = refused.max_by(|a, b| a.0.total_cmp(&b.0)) {
        return Err(ConvertError::OtherRest {
            joint: skeleton.joints[nth].name.clone(),
            parent: skeleton.joints[parent].name.clone(),
            angle_deg,
            allowed_deg,
        });
    }
    let farthest = angles.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(farthest.map(|&(angle_deg, _, nth, _)| (nth, angle_deg)))
}

/// Refuses what would take too much to play, before anything is played.
pub(crate) fn check_length(source: &(impl Source + ?Sized)) -> Result<(), ConvertError> {
    let (frames, joints) = (source.frames(), source.joint_count());
    match frames.saturating_mul(joints) > MAX_ROTATIONS {
        true => Err(ConvertError::TooLong { frames, joints }),
        false => Ok(()),
    }
}

fn check(source: &(impl Source + ?Sized), rules: &Rules) -> Result<(), ConvertError> {
    check_length(source)?;
    let scale = rules.scale_to_metres;
    match scale.is_finite() && scale > 0.0 {
        true => Ok(()),
        false => Err(ConvertError::Scale(scale)),
    }
}

/// The first joint from the root on that does more than place its only child.
pub(crate) fn character_root(source: &(impl Source + ?Sized), rules: &Rules) -> usize {
    let far = f64::from(rules.max_offset_variation_m) / f64::from(rules.scale_to_metres);
    let mut children = vec![Vec::new(); source.joint_count()];
    for joint in 0..source.joint_count() {
        if let Some(parent) = source.parent(joint) {
            children[parent].push(joint);
        }
    }
    // The file is played once, and only if a joint may be a root that places another.
    let mut ways = None;
    let mut root = 0;
    while let Some(&[child]) = children.get(root).map(Vec::as_slice) {
        if source.is_joint(root) {
            if !(rules.fold_root && source.moves(child)) {
                return root;
            }
            let ways = ways.get_or_insert_with(|| ways_of(source));
            if !ways[root].is_still && ways[child].farthest <= far {
                return root;
            }
        }
        root = child;
    }
    root
}

/// How a joint moves in its parent.
#[derive(Clone, Copy)]
struct Way {
    /// Whether it has the same place and rotation in all frames.
    is_still: bool,
    /// Largest distance from its first place along an axis, in the file's units.
    farthest: f64,
}

fn ways_of(source: &(impl Source + ?Sized)) -> Vec<Way> {
    let still = Way {
        is_still: true,
        farthest: 0.0,
    };
    let mut ways = vec![still; source.joint_count()];
    let mut locals = vec![Transform::default(); ways.len()];
    let mut firsts = Vec::new();
    for frame in 0..source.frames() {
        source.locals(frame, &mut locals);
        if frame == 0 {
            firsts.clone_from(&locals);
        }
        for ((way, at), first) in ways.iter_mut().zip(&locals).zip(&firsts) {
            way.is_still &= at == first;
            way.farthest = way.farthest.max((at.place - first.place).abs().max_element());
        }
    }
    ways
}

/// `root` and everything below it that is not left out, in the file's order.
fn subtree(source: &(impl Source + ?Sized), root: usize, left_out: &[bool]) -> Taken {
    let mut place = vec![None; source.joint_count()];
    let mut taken = Taken::new();
    for index in 0..source.joint_count() {
        let parent = source.parent(index).and_then(|p| place[p]);
        if left_out.get(index) == Some(&true) {
            continue;
        }
        if index == root || parent.is_some() {
            place[index] = Some(taken.len());
            taken.push((index, parent));
        }
    }
    taken
}

/// Plays every frame of the file and collects what the clip needs. The joints' places are compared
/// with the offsets of `skeleton`, whose joints are `taken`, or with those of the first frame.
fn play(
    source: &(impl Source + ?Sized),
    taken: &Taken,
    skeleton: Option<&Skeleton>,
    rules: &Rules,
) -> Result<Played, ConvertError> {
    check(source, rules)?;
    let (frames, joints) = (source.frames(), source.joint_count());
    let scale = f64::from(rules.scale_to_metres);
    let mut local = vec![Transform::default(); joints];
    let mut world = local.clone();
    let rest = |nth: usize| JointOffset {
        rest: skeleton.map(|s| s.joints[nth].offset_m),
        ..JointOffset::default()
    };
    let mut played = Played {
        root_positions: Vec::with_capacity(frames),
        rotations: Vec::with_capacity(frames * taken.len()),
        places: (0..taken.len()).map(rest).collect(),
    };
    for frame in 0..frames {
        source.locals(frame, &mut local);
        for j in 0..joints {
            world[j] = match source.parent(j) {
                None => local[j],
                Some(p) => world[p].to_world(&local[j]),
            };
        }
        for (&(index, parent), at) in taken.iter().zip(&mut played.places) {
            let parent = parent.map(|p| taken[p].0);
            let Transform { place, turn } = match parent {
                None => Transform {
                    place: DVec3::ZERO,
                    turn: world[index].turn,
                },
                Some(parent) if source.parent(index) == Some(parent) => local[index],
                Some(parent) => world[parent].to_local(&world[index]),
            };
            if parent.is_none() {
                played.root_positions.push((world[index].place * scale).as_vec3());
            }
            at.note(frame, (place * scale).as_vec3());
            played.rotations.push(turn.normalize().as_quat());
        }
    }
    Ok(played)
}

/// Place and rotation of a joint.
#[derive(Clone, Copy, Default, PartialEq)]
pub(crate) struct Transform {
    pub(crate) place: DVec3,
    pub(crate) turn: DQuat,
}

impl Transform {
    /// The world transform of a child whose transform in this joint is `child`.
    pub(crate) fn to_world(self, child: &Self) -> Self {
        Self {
            place: self.place + self.turn * child.place,
            turn: self.turn * child.turn,
        }
    }

    /// The transform in this joint of something whose world transform is `other`.
    pub(crate) fn to_local(self, other: &Self) -> Self {
        let back = self.turn.inverse();
        Self {
            place: back * (other.place - self.place),
            turn: back * other.turn,
        }
    }
}

/// What a clip takes of a played file.
struct Played {
    root_positions: Vec<Vec3>,
    /// `frames * taken`.
    rotations: Vec<Quat>,
    /// One for each joint taken.
    places: Vec<JointOffset>,
}

/// Places of a joint in its parent over a clip, metres.
#[derive(Default)]
struct JointOffset {
    /// The place to compare with; if it is not given, the first.
    rest: Option<Vec3>,
    sum: DVec3,
    /// Largest distance from `rest`, metres.
    farthest_m: f32,
    /// The frame of that distance.
    frame: usize,
}

impl JointOffset {
    fn note(&mut self, frame: usize, place: Vec3) {
        self.sum += place.as_dvec3();
        let distance_m = place.distance(*self.rest.get_or_insert(place));
        if distance_m > self.farthest_m {
            (self.farthest_m, self.frame) = (distance_m, frame);
        }
    }

    fn mean(&self, frames: usize) -> Vec3 {
        (self.sum / frames.max(1) as f64).as_vec3()
    }
}

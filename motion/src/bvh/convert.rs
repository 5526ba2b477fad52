//! Between BVH files and clips.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DQuat, DVec3, Quat, Vec3};

use super::euler::axis_rotation;
use super::sides::left_axis_of;
use super::{BvhBuildError, BvhFile, BvhJoint, Channel, EulerOrder};
use crate::clip::{Clip, ClipError, MAX_ROTATIONS};
use crate::skeleton::{Joint, MAX_JOINTS, Skeleton, SkeletonError};

/// How a BVH file becomes a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhOptions {
    /// Metres in a unit of the file; 0.01 (centimetres) by default.
    pub scale_to_metres: f32,
    /// Fold a placing root into its child (default): a ROOT whose only child has all three position channels is left out
    /// and its transform applied to that child in the world, where the ROOT never moves or the child moves in it.
    /// Bandai-Namco's `joint_Root` is one: static in most clips, it carries the way of the character in a few. Only for
    /// [`BvhFile::to_clip`]; [`BvhFile::to_clip_on`] folds whatever stands above the skeleton's root.
    pub fold_root: bool,
    /// The character's left in the pelvis' frame. `None`: from the root's children, where two have names that differ in
    /// left and right only (the hips); +X where there are none. Only for [`BvhFile::to_clip`].
    pub left_axis: Option<Vec3>,
    /// How far the place of a joint in its parent may vary over the clip ([`BvhFile::to_clip`]), metres; 0.001 by default.
    pub max_offset_variation_m: f32,
    /// How far the place of a joint in its parent may be from the skeleton's offset ([`BvhFile::to_clip_on`]), metres; 0.02
    /// by default. A larger one plays the rotations on bones of other lengths.
    pub max_offset_error_m: f32,
}

impl Default for BvhOptions {
    fn default() -> Self {
        Self {
            scale_to_metres: 0.01,
            fold_root: true,
            left_axis: None,
            max_offset_variation_m: 0.001,
            max_offset_error_m: 0.02,
        }
    }
}

/// How a clip becomes a BVH file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhWriteOptions {
    /// Units of the file in a metre; 100 (centimetres) by default.
    pub units_per_metre: f32,
    /// Order of the rotation channels; Z X Y by default.
    pub order: EulerOrder,
}

impl Default for BvhWriteOptions {
    fn default() -> Self {
        Self {
            units_per_metre: 100.0,
            order: EulerOrder::default(),
        }
    }
}

/// Why a BVH file cannot become a clip.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// More than one ROOT.
    #[error("the file has {0} roots, but a clip has one")]
    SeveralRoots(usize),
    /// Joints of the skeleton that the file lacks.
    #[error("the file lacks joints of the skeleton: {}", .0.join(", "))]
    MissingJoints(Vec<String>),
    /// A joint that moves in its parent.
    #[error(
        "joint {joint:?} moves in its parent: by {variation_m} m, most in frame {frame}; only the root may"
    )]
    VaryingOffset {
        /// The joint.
        joint: String,
        /// The frame farthest from the first, counted from 0.
        frame: usize,
        /// How far it moves, metres.
        variation_m: f32,
    },
    /// A bone of another length or direction than the skeleton's.
    #[error(
        "joint {joint:?} stands {error_m} m from the skeleton's offset (frame {frame}); the skeletons differ"
    )]
    OffsetMismatch {
        /// The joint.
        joint: String,
        /// The frame in which it is farthest, counted from 0.
        frame: usize,
        /// How far, metres.
        error_m: f32,
    },
    /// A scale that is not finite and positive.
    #[error("the scale must be finite and positive, not {0}")]
    Scale(f32),
    /// Frames times joints are more than [`MAX_ROTATIONS`]. Joints without channels take no text in a frame, so a small file
    /// could else ask for any amount of memory.
    #[error(
        "{frames} frames of {joints} joints are too many: at most {} frames of so many joints are converted",
        MAX_ROTATIONS / (*joints).max(1)
    )]
    TooLong {
        /// Frames of the file.
        frames: usize,
        /// Joints of the file.
        joints: usize,
    },
    /// The joints do not make a skeleton; for example they are more than [`MAX_JOINTS`](crate::skeleton::MAX_JOINTS).
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The frames do not make a clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

/// The joints of a file that a clip takes: index in the file, and the parent's place among the taken.
type Taken = Vec<(usize, Option<usize>)>;

impl BvhFile {
    /// A clip with a skeleton of its own, made from the file's joints in their order.
    ///
    /// Offsets are the mean places of the joints in their parents: the OFFSETs, or what position channels replace them
    /// with. The skeleton has ground height 0 and no contact joints.
    ///
    /// # Errors
    /// [`ConvertError`]; for example a joint below the root that moves in its parent.
    pub fn to_clip(&self, options: &BvhOptions) -> Result<Clip, ConvertError> {
        let roots = self.joints().iter().filter(|j| j.parent.is_none()).count();
        if roots != 1 {
            return Err(ConvertError::SeveralRoots(roots));
        }
        let root = if options.fold_root {
            self.character_root(options)
        } else {
            0
        };
        let taken = self.subtree(root);
        if taken.len() > MAX_JOINTS {
            return Err(SkeletonError::TooManyJoints(taken.len()).into());
        }
        let played = self.play(&taken, None, options)?;
        let mut joints = Vec::with_capacity(taken.len());
        for (nth, (&(index, parent), place)) in taken.iter().zip(&played.places).enumerate() {
            let name = self.joints()[index].name.clone();
            if nth > 0 && place.farthest_m > options.max_offset_variation_m {
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
                place.mean(self.frames())
            };
            joints.push(Joint {
                name,
                parent,
                offset_m,
            });
        }
        let left_axis = options.left_axis.unwrap_or_else(|| left_axis_of(&joints));
        let skeleton = Skeleton::new(joints, left_axis, 0.0, None)?;
        Ok(Clip::new(
            Arc::new(skeleton),
            self.fps(),
            played.root_positions,
            played.rotations,
        )?)
    }

    /// A clip on a given skeleton; joints go by name. Joints of the file that the skeleton lacks are folded into their
    /// descendants' world transforms, so world rotations stay. The clip keeps the file's rate.
    ///
    /// # Errors
    /// [`ConvertError::MissingJoints`] with the names; [`ConvertError::OffsetMismatch`] where the bones differ by more than
    /// [`BvhOptions::max_offset_error_m`].
    pub fn to_clip_on(&self, skeleton: &Arc<Skeleton>, options: &BvhOptions) -> Result<Clip, ConvertError> {
        let index: HashMap<&str, usize> = self
            .joints()
            .iter()
            .enumerate()
            .rev()
            .map(|(i, j)| (j.name.as_str(), i))
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
        let played = self.play(&taken, Some(skeleton), options)?;
        for (joint, place) in skeleton.joints.iter().zip(&played.places).skip(1) {
            if place.farthest_m > options.max_offset_error_m {
                return Err(ConvertError::OffsetMismatch {
                    joint: joint.name.clone(),
                    frame: place.frame,
                    error_m: place.farthest_m,
                });
            }
        }
        Ok(Clip::new(
            Arc::clone(skeleton),
            self.fps(),
            played.root_positions,
            played.rotations,
        )?)
    }

    /// Writes a clip as BVH: six channels at the root, three rotations at every other joint, joints in the clip's order.
    ///
    /// # Errors
    /// [`BvhBuildError`] where a name does not fit the format or the scale makes numbers that are not finite.
    pub fn from_clip(clip: &Clip, options: &BvhWriteOptions) -> Result<Self, BvhBuildError> {
        let units = f64::from(options.units_per_metre);
        let axes = options.order.axes();
        let turns = axes.map(|axis| Channel::ALL[3 + axis]);
        let moves = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
        let mut has_child = vec![false; clip.skeleton.joint_count()];
        for joint in &clip.skeleton.joints {
            if let Some(parent) = joint.parent {
                has_child[parent] = true;
            }
        }
        let joints = clip
            .skeleton
            .joints
            .iter()
            .zip(&has_child)
            .map(|(joint, &has_child)| BvhJoint {
                name: joint.name.clone(),
                parent: joint.parent,
                offset: if joint.parent.is_some() {
                    joint.offset_m.as_dvec3() * units
                } else {
                    DVec3::ZERO
                },
                channels: if joint.parent.is_some() {
                    turns.to_vec()
                } else {
                    [moves, turns].concat()
                },
                end_sites: if has_child { Vec::new() } else { vec![DVec3::ZERO] },
            });
        let joints: Vec<_> = joints.collect();
        let mut values = Vec::with_capacity(clip.frames() * (3 + 3 * joints.len()));
        for (frame, root) in clip.root_positions.iter().enumerate() {
            values.extend((root.as_dvec3() * units).to_array());
            for q in clip.rotations_at(frame) {
                values.extend(options.order.angles(q.as_dquat()).map(f64::to_degrees));
            }
        }
        Self::new(joints, 1.0 / f64::from(clip.fps), values)
    }

    /// First joint from the root on that does not merely place its only child; see [`BvhOptions::fold_root`].
    fn character_root(&self, options: &BvhOptions) -> usize {
        let far = f64::from(options.max_offset_variation_m) / f64::from(options.scale_to_metres);
        let (mut root, mut start) = (0, 0);
        loop {
            let mut children = self
                .joints()
                .iter()
                .enumerate()
                .filter(|(_, j)| j.parent == Some(root));
            let (Some((child, joint)), None) = (children.next(), children.next()) else {
                return root;
            };
            // Parents come first, so the only child of the joint so far is the next joint and its columns follow.
            let next = start + self.joints()[root].channels.len();
            let moves: Vec<usize> = joint
                .channels
                .iter()
                .enumerate()
                .filter_map(|(nth, channel)| (!channel.is_rotation()).then_some(next + nth))
                .collect();
            let is_static = self.variation(start..next) == 0.0;
            if moves.len() < 3 || !(is_static || self.variation(moves) > far) {
                return root;
            }
            (root, start) = (child, next);
        }
    }

    /// The farthest that the numbers in `columns` get from the first frame's, in the file's units.
    fn variation(&self, columns: impl IntoIterator<Item = usize>) -> f64 {
        let spread = |column| {
            let mut values = (0..self.frames()).map(|f| self.row(f)[column]);
            let first: f64 = values.next().unwrap_or(0.0);
            values.fold(0.0, |far: f64, v| far.max((v - first).abs()))
        };
        columns.into_iter().map(spread).fold(0.0, f64::max)
    }

    /// `root` and all below it, in the file's order.
    fn subtree(&self, root: usize) -> Taken {
        let mut place = vec![None; self.joints().len()];
        let mut taken = Taken::new();
        for (index, joint) in self.joints().iter().enumerate() {
            let parent = joint.parent.and_then(|p| place[p]);
            if index == root || parent.is_some() {
                place[index] = Some(taken.len());
                taken.push((index, parent));
            }
        }
        taken
    }

    /// Plays every frame of the file and takes what the clip needs of it. The joints' places are held against the offsets
    /// of `skeleton`, whose joints are `taken`, or against those of the first frame.
    fn play(
        &self,
        taken: &Taken,
        skeleton: Option<&Skeleton>,
        options: &BvhOptions,
    ) -> Result<Played, ConvertError> {
        let (frames, joints) = (self.frames(), self.joints().len());
        if frames.saturating_mul(joints) > MAX_ROTATIONS {
            return Err(ConvertError::TooLong { frames, joints });
        }
        let scale = options.scale_to_metres;
        if !(scale.is_finite() && scale > 0.0) {
            return Err(ConvertError::Scale(scale));
        }
        let scale = f64::from(scale);
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
            self.transforms(frame, &mut local, &mut world);
            for (&(index, parent), at) in taken.iter().zip(&mut played.places) {
                let parent = parent.map(|p| taken[p].0);
                let Transform { place, turn } = match parent {
                    None => Transform {
                        place: DVec3::ZERO,
                        turn: world[index].turn,
                    },
                    Some(parent) if self.joints()[index].parent == Some(parent) => local[index],
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

    /// Transforms of all joints in one frame, in their parents and in the world, in the file's units.
    fn transforms(&self, frame: usize, local: &mut [Transform], world: &mut [Transform]) {
        let mut values = self.row(frame).iter();
        for (j, joint) in self.joints().iter().enumerate() {
            let mut place = joint.offset;
            let mut turn = DQuat::IDENTITY;
            for (channel, &value) in joint.channels.iter().zip(&mut values) {
                if channel.is_rotation() {
                    turn *= axis_rotation(channel.axis(), value.to_radians());
                } else {
                    place[channel.axis()] = value;
                }
            }
            local[j] = Transform { place, turn };
            world[j] = match joint.parent {
                None => local[j],
                Some(p) => world[p].to_world(&local[j]),
            };
        }
    }
}

/// Where a joint is and how it is turned.
#[derive(Clone, Copy, Default)]
struct Transform {
    place: DVec3,
    turn: DQuat,
}

impl Transform {
    /// The world transform of a child whose transform in this joint is `child`.
    fn to_world(self, child: &Self) -> Self {
        Self {
            place: self.place + self.turn * child.place,
            turn: self.turn * child.turn,
        }
    }

    /// The transform in this joint of something whose world transform is `other`.
    fn to_local(self, other: &Self) -> Self {
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
    /// One a joint taken.
    places: Vec<JointOffset>,
}

/// Where a joint is in its parent over a clip, metres.
#[derive(Default)]
struct JointOffset {
    /// What places are held against; the first of them where it is not given.
    rest: Option<Vec3>,
    sum: DVec3,
    /// Largest distance from `rest`.
    farthest_m: f32,
    /// The frame of it.
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

//! Converts between BVH files and clips.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};

use super::euler::axis_rotation;
use super::{BvhBuildError, BvhFile, BvhJoint, Channel, EulerOrder};
use crate::clip::Clip;
use crate::convert::{self, ConvertError, Rules, Source, Transform};
use crate::skeleton::Skeleton;

/// Options for turning a BVH file into a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhOptions {
    /// Metres a unit of the file; 0.01 (centimetres) by default.
    pub scale_to_metres: f32,
    /// Whether to fold a placing root into its child (the default). A ROOT whose only child has all
    /// three position channels is removed, and its transform applied to that child in the world, if
    /// the ROOT never moves or the child moves in it. Bandai-Namco's `joint_Root` is such a root:
    /// it is static in most clips, and carries the travel of the character in a few. Only for
    /// [`BvhFile::to_clip`]; [`BvhFile::to_clip_on`] always folds what is above the skeleton's
    /// root.
    pub fold_root: bool,
    /// The character's left in the pelvis' frame of reference. `None`: from two children of the
    /// root whose names differ only in left and right (the hips), otherwise +X. Only for
    /// [`BvhFile::to_clip`].
    pub left_axis: Option<Vec3>,
    /// How far the place of a joint in its parent may vary over the clip ([`BvhFile::to_clip`]),
    /// metres; 0.001 by default.
    pub max_offset_variation_m: f32,
    /// How far the place of a joint in its parent may be from the skeleton's offset
    /// ([`BvhFile::to_clip_on`]), metres; 0.02 by default. A larger value plays the rotations on
    /// bones of other lengths.
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

/// Options for writing a clip as BVH.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhWriteOptions {
    /// Units of the file a metre; 100 (centimetres) by default.
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

impl From<&BvhOptions> for Rules {
    fn from(options: &BvhOptions) -> Self {
        Self {
            scale_to_metres: options.scale_to_metres,
            fold_root: options.fold_root,
            left_axis: options.left_axis,
            max_offset_variation_m: options.max_offset_variation_m,
            max_offset_error_m: options.max_offset_error_m,
        }
    }
}

impl BvhFile {
    /// A clip with its own skeleton, made from the file's joints in their order.
    ///
    /// Offsets are the mean places of the joints in their parents: the OFFSETs, or what position
    /// channels replace them with. The skeleton has ground height 0 and no contact joints.
    ///
    /// # Errors
    /// [`ConvertError`], for example for a joint below the root that moves in its parent.
    pub fn to_clip(&self, options: &BvhOptions) -> Result<Clip, ConvertError> {
        convert::to_clip(self, &options.into())
    }

    /// A clip on a given skeleton; joints are matched by name. Joints of the file that the skeleton
    /// lacks are folded into their descendants, which keep their world rotations. The clip keeps
    /// the file's rate.
    ///
    /// # Errors
    /// [`ConvertError::MissingJoints`] with the names; [`ConvertError::OffsetMismatch`] if the
    /// bones differ by more than [`BvhOptions::max_offset_error_m`].
    pub fn to_clip_on(&self, skeleton: &Arc<Skeleton>, options: &BvhOptions) -> Result<Clip, ConvertError> {
        convert::to_clip_on(self, skeleton, &options.into())
    }

    /// Turns a clip into a BVH file: six channels at the root, three rotations at every other
    /// joint, joints in the clip's order.
    ///
    /// # Errors
    /// [`BvhBuildError`] if a name does not fit the format, or the scale makes numbers that are not
    /// finite.
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
}

impl Source for BvhFile {
    fn joint_count(&self) -> usize {
        self.joints().len()
    }

    fn name(&self, joint: usize) -> &str {
        &self.joints()[joint].name
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.joints()[joint].parent
    }

    fn moves(&self, joint: usize) -> bool {
        let channels = &self.joints()[joint].channels;
        channels.iter().filter(|channel| !channel.is_rotation()).count() == 3
    }

    fn is_joint(&self, _: usize) -> bool {
        true
    }

    fn frames(&self) -> usize {
        self.frames()
    }

    fn fps(&self) -> f32 {
        self.fps()
    }

    fn rest(&self, out: &mut [Transform]) {
        for (joint, local) in self.joints().iter().zip(out) {
            *local = Transform {
                place: joint.offset,
                turn: DQuat::IDENTITY,
            };
        }
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let mut values = self.row(frame).iter();
        for (joint, local) in self.joints().iter().zip(out) {
            let mut place = joint.offset;
            let mut turn = DQuat::IDENTITY;
            for (channel, &value) in joint.channels.iter().zip(&mut values) {
                if channel.is_rotation() {
                    turn *= axis_rotation(channel.axis(), value.to_radians());
                } else {
                    place[channel.axis()] = value;
                }
            }
            *local = Transform { place, turn };
        }
    }
}

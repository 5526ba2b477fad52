//! Frames of characters, in buffers that are reused.

use glam::{Quat, Vec3};
use troupe_motion::GlobalRoot;
use troupe_motion::codec::{BYTES_PER_ROOT, BYTES_PER_ROTATION, read_roots, read_rotations};
use troupe_motion::conventions::Convention;
use troupe_motion::robot::Robot;
use troupe_motion::rotation::from_wxyz;
use troupe_motion::skeleton::Skeleton;
use troupe_proto::v1;

use crate::error::AnswerError;

/// Which contact joints of the pack are on the ground.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Contacts(u8);

impl Contacts {
    /// Whether the pack's n-th contact joint is on the ground.
    pub fn is_down(self, contact_joint: usize) -> bool {
        contact_joint < 8 && self.0 >> contact_joint & 1 == 1
    }

    /// Bit i for contact joint i.
    pub fn bits(self) -> u8 {
        self.0
    }
}

/// One frame of one character, in the session's convention.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<'a> {
    /// World position of the root joint.
    pub root: Vec3,
    /// A rotation for each joint of the pack: of the first in the world, of the others relative to
    /// their parents.
    pub rotations: &'a [Quat],
    /// Contact joints on the ground.
    pub contacts: Contacts,
    /// World position of each joint. Empty if the options do not ask for it.
    pub positions: &'a [Vec3],
    /// MuJoCo's `qpos`, in its own axes. Empty in other encodings than [`super::Encoding::Qpos`].
    pub qpos: &'a [f32],
}

impl Frame<'_> {
    /// Place and heading of the root in the native convention: metres, radians about +Y.
    pub fn native_root(&self, skeleton: &Skeleton, convention: Convention) -> GlobalRoot {
        let pelvis = self.rotations.first().copied().unwrap_or_default();
        GlobalRoot::of_pose(
            convention.position_to_native(self.root),
            convention.rotation_to_native(pelvis),
            skeleton.left_axis,
        )
    }
}

/// Consecutive frames of one character, in the session's convention.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames<'a> {
    first_frame: u64,
    joints: usize,
    roots: &'a [Vec3],
    rotations: &'a [Quat],
    contacts: &'a [u8],
    positions: &'a [Vec3],
    /// Numbers of a `qpos`; 0 without one.
    qpos_len: usize,
    qpos: &'a [f32],
    hinge_residuals: &'a [f32],
    clamped_hinges: &'a [u32],
    hinge_speed_ratios: &'a [f32],
    fastest_hinges: &'a [u32],
    hinge_accelerations: &'a [f32],
}

impl<'a> Frames<'a> {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.roots.len()
    }

    /// Whether it has no frame.
    pub fn is_empty(&self) -> bool {
        self.roots.is_empty()
    }

    /// Number of the first frame on the session's timeline, which has 30 frames a second. Rounded
    /// down.
    pub fn first_frame(&self) -> u64 {
        self.first_frame
    }

    /// The frame of an index.
    pub fn get(&self, index: usize) -> Option<Frame<'a>> {
        let at = index * self.joints..(index + 1) * self.joints;
        Some(Frame {
            root: *self.roots.get(index)?,
            rotations: self.rotations.get(at.clone())?,
            contacts: Contacts(*self.contacts.get(index)?),
            positions: self.positions.get(at).unwrap_or_default(),
            qpos: &self.qpos[index * self.qpos_len..(index + 1) * self.qpos_len],
        })
    }

    /// How far the motion is from the poses that a robot's hinges allow: the largest angle of any
    /// joint in the world, radians, one per frame. Empty unless frames come as `qpos`.
    pub fn hinge_residuals(&self) -> &'a [f32] {
        self.hinge_residuals
    }

    /// Number of a robot's hinges whose limits were exceeded, one per frame. Empty unless frames
    /// come as `qpos`.
    pub fn clamped_hinges(&self) -> &'a [u32] {
        self.clamped_hinges
    }

    /// Speed of a robot's hinge since the frame before, divided by its highest speed: the largest
    /// of all hinges, one per frame. Above 1 the hinge would have to be faster than it can. Empty
    /// unless frames come as `qpos`.
    pub fn hinge_speed_ratios(&self) -> &'a [f32] {
        self.hinge_speed_ratios
    }

    /// Indices of the hinges with those ratios, one per frame. Empty unless frames come as `qpos`.
    pub fn fastest_hinges(&self) -> &'a [u32] {
        self.fastest_hinges
    }

    /// Largest acceleration of a robot's hinges, rad/s², one per frame. Empty unless frames come as
    /// `qpos`.
    pub fn hinge_accelerations(&self) -> &'a [f32] {
        self.hinge_accelerations
    }

    /// The newest frame.
    pub fn last(&self) -> Option<Frame<'a>> {
        self.get(self.len().checked_sub(1)?)
    }

    /// All frames, the oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Frame<'a>> + use<'a> {
        let frames = *self;
        let (joints, numbers) = (self.joints, self.qpos_len);
        self.roots.iter().enumerate().map(move |(i, &root)| Frame {
            root,
            rotations: &frames.rotations[i * joints..(i + 1) * joints],
            contacts: Contacts(frames.contacts[i]),
            positions: frames
                .positions
                .get(i * joints..(i + 1) * joints)
                .unwrap_or_default(),
            qpos: &frames.qpos[i * numbers..(i + 1) * numbers],
        })
    }
}

/// A block of frames, checked and decoded. Columns of the right form are moved out of the message,
/// not copied.
#[derive(Debug, Default)]
pub(crate) struct Block {
    joints: usize,
    frame_count: usize,
    slots: Vec<u32>,
    first_frames: Vec<u64>,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    /// World positions of joints, three numbers each.
    positions: Vec<f32>,
    /// Numbers of a `qpos`; 0 without one.
    qpos_len: usize,
    qpos: Vec<f32>,
    hinge_residuals: Vec<f32>,
    clamped_hinges: Vec<u32>,
    hinge_speed_ratios: Vec<f32>,
    fastest_hinges: Vec<u32>,
    hinge_accelerations: Vec<f32>,
}

impl Block {
    /// Replaces the block by that of a message. `convention` gives the convention of the character
    /// in a slot.
    ///
    /// # Errors
    /// [`AnswerError::Length`] for the first column of the wrong length. The block is then empty.
    pub(crate) fn read(
        &mut self,
        message: v1::FrameBlock,
        skeleton: &Skeleton,
        convention: impl Fn(u32) -> Convention,
    ) -> Result<(), AnswerError> {
        self.clear();
        check(&message, skeleton)?;
        let joints = skeleton.joint_count();
        let frames = message.frame_count as usize;
        if let (Some(robot), false) = (&skeleton.robot, message.qpos.is_empty()) {
            self.read_qpos(&message, robot, joints, convention);
        } else if message.packed_roots.is_empty() {
            self.roots
                .extend_from_slice(bytemuck::cast_slice(&message.root_positions));
            let rotations = message.rotations.as_chunks::<4>().0;
            self.rotations.extend(rotations.iter().copied().map(from_wxyz));
        } else {
            read_roots(&message.packed_roots, &mut self.roots);
            read_rotations(&message.packed_rotations, &mut self.rotations);
            for (&slot, roots) in message.slots.iter().zip(self.roots.chunks_exact_mut(frames)) {
                let units = convention(slot).units_per_metre();
                if units != 1.0 {
                    roots.iter_mut().for_each(|root| *root *= units);
                }
            }
        }
        self.joints = joints;
        self.frame_count = frames;
        self.contacts = message.contacts;
        self.positions = message.positions;
        self.qpos = message.qpos;
        self.hinge_residuals = message.hinge_residuals;
        self.clamped_hinges = message.clamped_hinges;
        self.hinge_speed_ratios = message.hinge_speed_ratios;
        self.fastest_hinges = message.fastest_hinges;
        self.hinge_accelerations = message.hinge_accelerations;
        self.first_frames = message.first_frames;
        self.slots = message.slots;
        Ok(())
    }

    /// Computes roots and rotations from the `qpos` of all frames, in the conventions of the
    /// characters.
    fn read_qpos(
        &mut self,
        message: &v1::FrameBlock,
        robot: &Robot,
        joints: usize,
        convention: impl Fn(u32) -> Convention,
    ) {
        self.qpos_len = robot.qpos_len();
        let rows = message.qpos.chunks_exact(self.qpos_len);
        let frames = message.frame_count as usize;
        let slots = message
            .slots
            .iter()
            .flat_map(|&slot| std::iter::repeat_n(slot, frames));
        for (slot, row) in slots.zip(rows) {
            let of = convention(slot);
            let (root, rotation, angles) = robot.read_qpos(row);
            self.roots.push(of.position_from_native(root));
            let from = self.rotations.len();
            self.rotations.resize(from + joints, Quat::IDENTITY);
            robot.pose(rotation, angles, &mut self.rotations[from..]);
            for turned in &mut self.rotations[from..] {
                *turned = of.rotation_from_native(*turned);
            }
        }
    }

    /// Empties the block, but keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.frame_count = 0;
        self.slots.clear();
        self.roots.clear();
        self.rotations.clear();
        self.qpos_len = 0;
        self.qpos.clear();
        self.hinge_residuals.clear();
        self.clamped_hinges.clear();
        self.hinge_speed_ratios.clear();
        self.fastest_hinges.clear();
        self.hinge_accelerations.clear();
    }

    /// The characters' slots.
    pub(crate) fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// The frames of the n-th character, if there is one.
    pub(crate) fn frames(&self, place: usize) -> Frames<'_> {
        if place >= self.slots.len() {
            return Frames {
                first_frame: 0,
                joints: self.joints,
                roots: &[],
                rotations: &[],
                contacts: &[],
                positions: &[],
                qpos_len: 0,
                qpos: &[],
                hinge_residuals: &[],
                clamped_hinges: &[],
                hinge_speed_ratios: &[],
                fastest_hinges: &[],
                hinge_accelerations: &[],
            };
        }
        let (frames, joints) = (self.frame_count, self.joints);
        let of_frames = place * frames..(place + 1) * frames;
        let of_joints = of_frames.start * joints..of_frames.end * joints;
        let positions: &[Vec3] = bytemuck::cast_slice(&self.positions);
        let numbers = self.qpos_len;
        Frames {
            first_frame: self.first_frames[place],
            joints,
            roots: &self.roots[of_frames.clone()],
            rotations: &self.rotations[of_joints.clone()],
            contacts: &self.contacts[of_frames.clone()],
            positions: positions.get(of_joints).unwrap_or_default(),
            qpos_len: numbers,
            qpos: &self.qpos[of_frames.start * numbers..of_frames.end * numbers],
            hinge_residuals: self.hinge_residuals.get(of_frames.clone()).unwrap_or_default(),
            clamped_hinges: self.clamped_hinges.get(of_frames.clone()).unwrap_or_default(),
            hinge_speed_ratios: self.hinge_speed_ratios.get(of_frames.clone()).unwrap_or_default(),
            fastest_hinges: self.fastest_hinges.get(of_frames.clone()).unwrap_or_default(),
            hinge_accelerations: self.hinge_accelerations.get(of_frames).unwrap_or_default(),
        }
    }
}

/// Checks the length of every column.
fn check(block: &v1::FrameBlock, skeleton: &Skeleton) -> Result<(), AnswerError> {
    let joints = skeleton.joint_count();
    let characters = block.slots.len();
    let frames = characters.saturating_mul(block.frame_count as usize);
    let (as_qpos, packed) = (!block.qpos.is_empty(), !block.packed_roots.is_empty());
    let wanted = |numbers: usize, of_packed: bool| match !as_qpos && of_packed == packed {
        true => numbers,
        false => 0,
    };
    let of_qpos = |numbers: usize| {
        if as_qpos {
            frames.saturating_mul(numbers)
        } else {
            0
        }
    };
    let columns = [
        ("first_frames", block.first_frames.len(), characters),
        (
            "root_positions",
            block.root_positions.len(),
            wanted(frames * 3, false),
        ),
        (
            "rotations",
            block.rotations.len(),
            wanted(frames * joints * 4, false),
        ),
        (
            "packed_roots",
            block.packed_roots.len(),
            wanted(frames * BYTES_PER_ROOT, true),
        ),
        (
            "packed_rotations",
            block.packed_rotations.len(),
            wanted(frames * joints * BYTES_PER_ROTATION, true),
        ),
        ("contacts", block.contacts.len(), frames),
        (
            "qpos",
            block.qpos.len(),
            of_qpos(skeleton.robot.as_ref().map_or(0, Robot::qpos_len)),
        ),
        ("hinge_residuals", block.hinge_residuals.len(), of_qpos(1)),
        ("clamped_hinges", block.clamped_hinges.len(), of_qpos(1)),
        ("hinge_speed_ratios", block.hinge_speed_ratios.len(), of_qpos(1)),
        ("fastest_hinges", block.fastest_hinges.len(), of_qpos(1)),
        ("hinge_accelerations", block.hinge_accelerations.len(), of_qpos(1)),
    ];
    let positions = ("positions", block.positions.len(), frames * joints * 3);
    let positions = (!block.positions.is_empty()).then_some(positions);
    for (field, got, expected) in columns.into_iter().chain(positions) {
        if got != expected {
            return Err(AnswerError::Length { field, got, expected });
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "frames_tests.rs"]
mod tests;

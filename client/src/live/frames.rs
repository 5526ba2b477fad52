//! Frames of characters as they come, in buffers that are used again.

use glam::{Quat, Vec3};
use troupe_motion::GlobalRoot;
use troupe_motion::codec::{BYTES_PER_ROOT, BYTES_PER_ROTATION, read_roots, read_rotations};
use troupe_motion::conventions::Convention;
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
    /// A rotation for each joint of the pack: the first in the world, the others relative to their parents.
    pub rotations: &'a [Quat],
    /// What is on the ground.
    pub contacts: Contacts,
    /// World position of each joint; empty unless asked for.
    pub positions: &'a [Vec3],
}

impl Frame<'_> {
    /// Where the character is and faces, in the native convention: metres, heading about +Y.
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
}

impl<'a> Frames<'a> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.roots.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.roots.is_empty()
    }

    /// Number of the first on the session's timeline, which counts 30 a second; rounded down.
    pub fn first_frame(&self) -> u64 {
        self.first_frame
    }

    /// One of them.
    pub fn get(&self, index: usize) -> Option<Frame<'a>> {
        let at = index * self.joints..(index + 1) * self.joints;
        Some(Frame {
            root: *self.roots.get(index)?,
            rotations: self.rotations.get(at.clone())?,
            contacts: Contacts(*self.contacts.get(index)?),
            positions: self.positions.get(at).unwrap_or_default(),
        })
    }

    /// The newest.
    pub fn last(&self) -> Option<Frame<'a>> {
        self.get(self.len().checked_sub(1)?)
    }

    /// All, oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Frame<'a>> + use<'a> {
        let frames = *self;
        let joints = self.joints;
        self.roots.iter().enumerate().map(move |(i, &root)| Frame {
            root,
            rotations: &frames.rotations[i * joints..(i + 1) * joints],
            contacts: Contacts(frames.contacts[i]),
            positions: frames
                .positions
                .get(i * joints..(i + 1) * joints)
                .unwrap_or_default(),
        })
    }
}

/// A block of frames, checked and decoded. What the message holds in the right form is moved out of it, not copied.
#[derive(Debug, Default)]
pub(crate) struct Block {
    joints: usize,
    frame_count: usize,
    slots: Vec<u32>,
    first_frames: Vec<u64>,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    /// Three numbers a joint.
    positions: Vec<f32>,
}

impl Block {
    /// Reads a message in place of what was here. `units_per_metre` gives the unit of the character in a slot.
    ///
    /// # Errors
    /// [`AnswerError::Length`] for the first column of the wrong length; the block is then empty.
    pub(crate) fn read(
        &mut self,
        message: v1::FrameBlock,
        joints: usize,
        units_per_metre: impl Fn(u32) -> f32,
    ) -> Result<(), AnswerError> {
        self.clear();
        check(&message, joints)?;
        let frames = message.frame_count as usize;
        if message.packed_roots.is_empty() {
            self.roots
                .extend_from_slice(bytemuck::cast_slice(&message.root_positions));
            let rotations = message.rotations.as_chunks::<4>().0;
            self.rotations.extend(rotations.iter().copied().map(from_wxyz));
        } else {
            read_roots(&message.packed_roots, &mut self.roots);
            read_rotations(&message.packed_rotations, &mut self.rotations);
            for (&slot, roots) in message.slots.iter().zip(self.roots.chunks_exact_mut(frames)) {
                let units = units_per_metre(slot);
                if units != 1.0 {
                    roots.iter_mut().for_each(|root| *root *= units);
                }
            }
        }
        self.joints = joints;
        self.frame_count = frames;
        self.contacts = message.contacts;
        self.positions = message.positions;
        self.first_frames = message.first_frames;
        self.slots = message.slots;
        Ok(())
    }

    /// Forgets what was read, but keeps the room.
    pub(crate) fn clear(&mut self) {
        self.frame_count = 0;
        self.slots.clear();
        self.roots.clear();
        self.rotations.clear();
    }

    /// The characters' slots.
    pub(crate) fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// The frames of the n-th character; none where there is no such.
    pub(crate) fn frames(&self, place: usize) -> Frames<'_> {
        if place >= self.slots.len() {
            return Frames {
                first_frame: 0,
                joints: self.joints,
                roots: &[],
                rotations: &[],
                contacts: &[],
                positions: &[],
            };
        }
        let (frames, joints) = (self.frame_count, self.joints);
        let of_frames = place * frames..(place + 1) * frames;
        let of_joints = of_frames.start * joints..of_frames.end * joints;
        let positions: &[Vec3] = bytemuck::cast_slice(&self.positions);
        Frames {
            first_frame: self.first_frames[place],
            joints,
            roots: &self.roots[of_frames.clone()],
            rotations: &self.rotations[of_joints.clone()],
            contacts: &self.contacts[of_frames],
            positions: positions.get(of_joints).unwrap_or_default(),
        }
    }
}

/// Checks the length of every column.
fn check(block: &v1::FrameBlock, joints: usize) -> Result<(), AnswerError> {
    let characters = block.slots.len();
    let frames = characters.saturating_mul(block.frame_count as usize);
    let packed = !block.packed_roots.is_empty();
    let wanted = |floats: usize, of_packed: bool| if of_packed == packed { floats } else { 0 };
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

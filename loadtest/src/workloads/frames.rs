//! Reads frames of live characters. It always decodes root positions, and rotations only for a
//! sample.

use glam::Vec3;
use troupe_motion::codec;
use troupe_proto::v1;

/// Maximum difference of a rotation's length from 1.
const LENGTH_TOLERANCE: f32 = 1e-3;

/// Why a block breaks the protocol.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum BlockError {
    #[error("{column} has {got} entries instead of {wanted}")]
    Length {
        column: &'static str,
        got: usize,
        wanted: usize,
    },
    #[error("the length of rotation {0} is not 1")]
    Rotation(usize),
    #[error("a root is not finite")]
    Root,
}

/// A block of frames whose columns have the right lengths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block<'a> {
    message: &'a v1::FrameBlock,
    frames: usize,
}

impl<'a> Block<'a> {
    /// Checks the lengths of all columns.
    pub(super) fn read(message: &'a v1::FrameBlock, joints: usize) -> Result<Self, BlockError> {
        let frames = message.frame_count as usize;
        let rows = message.slots.len() * frames;
        let length = |column, got, wanted| {
            (got == wanted)
                .then_some(())
                .ok_or(BlockError::Length { column, got, wanted })
        };
        length("first_frames", message.first_frames.len(), message.slots.len())?;
        length("contacts", message.contacts.len(), rows)?;
        if message.packed_roots.is_empty() {
            length("root_positions", message.root_positions.len(), rows * 3)?;
            length("rotations", message.rotations.len(), rows * joints * 4)?;
        } else {
            length("packed_roots", message.packed_roots.len(), rows * 12)?;
            length(
                "packed_rotations",
                message.packed_rotations.len(),
                rows * joints * 6,
            )?;
        }
        Ok(Self { message, frames })
    }

    /// Size of the frames on the wire, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let of = self.message;
        let floats = of.root_positions.len() + of.rotations.len() + of.positions.len();
        (floats * 4 + of.packed_roots.len() + of.packed_rotations.len() + of.contacts.len()) as u64
    }

    /// Slot and root position of each character in its last frame, metres. Sessions of a load test
    /// use the native convention.
    pub(super) fn places(&self) -> impl Iterator<Item = (u32, Vec3)> + '_ {
        let last = self.frames.saturating_sub(1);
        let slots = self.message.slots.iter().enumerate();
        slots.map(move |(nth, &slot)| (slot, self.root(nth * self.frames + last)))
    }

    fn root(&self, row: usize) -> Vec3 {
        let of = self.message;
        if let Some(bytes) = of.packed_roots.as_chunks::<12>().0.get(row) {
            let steps = bytes.as_chunks::<4>().0.iter().map(|b| i32::from_le_bytes(*b));
            let mut places = [0; 3];
            places.iter_mut().zip(steps).for_each(|(to, from)| *to = from);
            return codec::decode_root(places);
        }
        let floats = of.root_positions.as_chunks::<3>().0;
        floats.get(row).map_or(Vec3::ZERO, |&v| Vec3::from_array(v))
    }

    /// Decodes and checks all rotations and roots.
    pub(super) fn check(&self) -> Result<(), BlockError> {
        let unit = |length: f32| (length - 1.0).abs() < LENGTH_TOLERANCE;
        let mut rotations = Vec::new();
        codec::read_rotations(&self.message.packed_rotations, &mut rotations);
        let packed = rotations.iter().map(|q| q.length());
        let floats = self.message.rotations.as_chunks::<4>().0.iter();
        let floats = floats.map(|q| q.iter().map(|v| v * v).sum::<f32>().sqrt());
        if let Some(place) = packed.chain(floats).position(|length| !unit(length)) {
            return Err(BlockError::Rotation(place));
        }
        let finite = self.places().all(|(_, place)| place.is_finite());
        finite.then_some(()).ok_or(BlockError::Root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    fn block(compact: bool) -> v1::FrameBlock {
        let roots = [Vec3::new(1.0, 0.9, -2.0), Vec3::new(0.5, 0.8, 3.0)];
        let rotations = [
            Quat::IDENTITY,
            Quat::from_rotation_y(1.0),
            Quat::from_rotation_x(0.3),
            Quat::IDENTITY,
        ];
        let mut block = v1::FrameBlock {
            slots: vec![7, 3],
            frame_count: 1,
            first_frames: vec![5, 5],
            contacts: vec![0, 3],
            ..v1::FrameBlock::default()
        };
        if compact {
            codec::write_roots(&roots, &mut block.packed_roots);
            codec::write_rotations(&rotations, &mut block.packed_rotations);
        } else {
            block.root_positions = roots.iter().flat_map(Vec3::to_array).collect();
            block.rotations = rotations.iter().flat_map(|q| [q.w, q.x, q.y, q.z]).collect();
        }
        block
    }

    #[test]
    fn places_are_read_in_both_forms() {
        for compact in [false, true] {
            let message = block(compact);
            let block = Block::read(&message, 2).unwrap();
            let places = block.places().collect::<Vec<_>>();
            assert_eq!(places.iter().map(|p| p.0).collect::<Vec<_>>(), [7, 3]);
            assert!((places[1].1 - Vec3::new(0.5, 0.8, 3.0)).length() < 1e-3);
            assert_eq!(block.check(), Ok(()));
        }
    }

    #[test]
    fn faults_of_a_block_are_found() {
        let mut message = block(true);
        message.packed_rotations.truncate(12);
        assert!(matches!(
            Block::read(&message, 2),
            Err(BlockError::Length {
                column: "packed_rotations",
                ..
            })
        ));
        let mut message = block(false);
        message.rotations[4] = 0.1;
        assert_eq!(
            Block::read(&message, 2).unwrap().check(),
            Err(BlockError::Rotation(1))
        );
        message = block(false);
        message.root_positions[2] = f32::NAN;
        assert_eq!(Block::read(&message, 2).unwrap().check(), Err(BlockError::Root));
        message.contacts.clear();
        assert!(Block::read(&message, 2).is_err());
    }
}

//! From what a pack of words made to frames of a character.

use std::sync::Arc;

use troupe_motion::model::{Motion, Rig};
use troupe_motion::{Joint, Quat, Skeleton, Vec3};

use crate::post::{NonFinite, check_finite, contact_bits, parent_relative, roots};

/// Consecutive frames of a performance in its segment frame, by column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WordsPart {
    /// Root positions, one a frame.
    pub roots: Vec<Vec3>,
    /// `frames * joints`: joint 0 in the segment, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// One a frame: bit i for contact joint i of the character.
    pub contacts: Vec<u8>,
}

/// Reads the parts of a pack of words for characters of another pack, whose joints are the same.
#[derive(Debug, Clone)]
pub struct PartReader {
    words: Arc<Rig>,
    /// For each contact joint of the words, its bit in the character's frames; 0 where it has none.
    contacts: Vec<u8>,
}

/// Why a character cannot act out what a pack makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum OtherSkeleton {
    /// Their joints differ.
    #[error("its joints are others than the session's")]
    Joints,
    /// Their rates differ.
    #[error("its frames have another rate than the session's")]
    Rate,
}

impl PartReader {
    /// For characters of `own` that act out what a pack of `words` makes.
    ///
    /// # Errors
    /// [`OtherSkeleton`] where its joints are not those of the characters, in their order.
    pub fn new(words: &Arc<Rig>, own: &Rig) -> Result<Self, OtherSkeleton> {
        if !same_joints(&words.skeleton, &own.skeleton) {
            return Err(OtherSkeleton::Joints);
        }
        if words.fps != own.fps {
            return Err(OtherSkeleton::Rate);
        }
        let of =
            |rig: &Rig| (rig.skeleton.contacts.as_ref()).map_or(Vec::new(), |known| known.joints.clone());
        let known = of(own);
        let bit = |joint| {
            known
                .iter()
                .take(8)
                .position(|own| *own == joint)
                .map_or(0, |bit| 1 << bit)
        };
        Ok(Self {
            contacts: of(words).into_iter().take(8).map(bit).collect(),
            words: words.clone(),
        })
    }

    /// The frames of a part.
    ///
    /// # Errors
    /// [`NonFinite`] where the model gave numbers that are not finite.
    pub fn read(&self, motion: &Motion) -> Result<WordsPart, NonFinite> {
        check_finite(motion)?;
        let (frames, dims) = (motion.frames(), &self.words.dims);
        let bits = contact_bits(&motion.contacts, dims.contacts, frames);
        let mapped = |bits: u8| {
            let own = self.contacts.iter().enumerate();
            own.filter(|(theirs, _)| bits >> theirs & 1 == 1)
                .fold(0, |all, (_, own)| all | own)
        };
        Ok(WordsPart {
            roots: roots(&motion.root).map(|root| root.position).collect(),
            rotations: parent_relative(motion, frames, dims, &self.words.skeleton),
            contacts: bits.into_iter().map(mapped).collect(),
        })
    }
}

fn same_joints(words: &Skeleton, own: &Skeleton) -> bool {
    let same = |(a, b): (&Joint, &Joint)| a.name == b.name && a.parent == b.parent;
    words.joint_count() == own.joint_count() && words.joints.iter().zip(&own.joints).all(same)
}

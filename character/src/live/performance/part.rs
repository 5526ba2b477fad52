//! Turns what a pack of words makes into frames of a character.

use std::sync::Arc;

use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{Motion, Rig};
use troupe_motion::rotation::align_sign;
use troupe_motion::{Joint, Quat, Skeleton, Vec3};

use crate::post::{NonFinite, check_finite, contact_bits, hold_live, parent_relative, roots};

/// Frames over which the difference to the part before fades out.
const SEAM_FRAMES: usize = 8;

/// Consecutive frames of a performance in its segment frame, by column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WordsPart {
    /// Root positions, one a frame, metres.
    pub roots: Vec<Vec3>,
    /// `frames * joints`: joint 0 in the segment frame, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// One a frame: bit i for contact joint i of the character.
    pub contacts: Vec<u8>,
}

/// Reads the parts that a pack of words makes one after another, for characters of another pack
/// with the same joints. Standing feet are held.
#[derive(Debug, Clone)]
pub struct PartReader {
    words: Arc<Rig>,
    own: Arc<Rig>,
    /// The last frame of the part before.
    seam: Option<Seam>,
    /// For each contact joint of the pack of words, its bit in the character's frames; 0 if the
    /// character has no such contact joint.
    contacts: Vec<u8>,
}

/// The last frame of a part.
#[derive(Debug, Clone)]
struct Seam {
    root: Vec3,
    contacts: u8,
    /// The pose with held feet.
    pose: Vec<Quat>,
    /// For each joint, the difference to the pose that the model made.
    turned: Vec<Quat>,
}

/// Why a character cannot perform what a pack makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum OtherSkeleton {
    /// The pack has other joints, or another order.
    #[error("its joints differ from the session's")]
    Joints,
    /// The pack has another frame rate.
    #[error("its frame rate differs from the session's")]
    Rate,
}

impl PartReader {
    /// A reader for characters of `own` that perform what the pack of `words` makes.
    ///
    /// # Errors
    /// [`OtherSkeleton`] if joints, their order or the frame rate differ.
    pub fn new(words: &Arc<Rig>, own: &Arc<Rig>) -> Result<Self, OtherSkeleton> {
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
            own: own.clone(),
            seam: None,
        })
    }

    /// The frames of the next part.
    ///
    /// # Errors
    /// [`NonFinite`] if the model gave numbers that are not finite.
    pub fn read(&mut self, motion: &Motion) -> Result<WordsPart, NonFinite> {
        check_finite(motion)?;
        let (frames, dims) = (motion.frames(), &self.words.dims);
        let bits = contact_bits(&motion.contacts, dims.contacts, frames);
        let mapped = |bits: u8| {
            let own = self.contacts.iter().enumerate();
            own.filter(|(theirs, _)| bits >> theirs & 1 == 1)
                .fold(0, |all, (_, own)| all | own)
        };
        let mut part = WordsPart {
            roots: roots(&motion.root).map(|root| root.position).collect(),
            rotations: parent_relative(motion, frames, dims, &self.words.skeleton),
            contacts: bits.into_iter().map(mapped).collect(),
        };
        self.hold_feet(&mut part);
        Ok(part)
    }

    /// Holds the feet of a part. Feet that stand at the end of the part before keep their place.
    fn hold_feet(&mut self, part: &mut WordsPart) {
        let joints = self.own.skeleton.joint_count();
        if part.roots.is_empty() {
            return;
        }
        let before = self.seam.take();
        if let Some(seam) = &before {
            seam.fade(&mut part.rotations, joints);
            part.roots.insert(0, seam.root);
            part.contacts.insert(0, seam.contacts);
            part.rotations.splice(0..0, seam.pose.iter().copied());
        }
        let start = usize::from(before.is_some());
        let made = part.rotations[part.rotations.len() - joints..].to_vec();
        hold_live(
            &self.own,
            &mut part.roots,
            &mut part.rotations,
            &mut part.contacts,
            start,
        );
        part.roots.drain(..start);
        part.contacts.drain(..start);
        part.rotations.drain(..start * joints);
        let held = part.rotations[part.rotations.len() - joints..].to_vec();
        let turned = held.iter().zip(&made).map(|(held, made)| *held * made.inverse());
        self.seam = Some(Seam {
            root: part.roots.last().copied().unwrap_or_default(),
            contacts: part.contacts.last().copied().unwrap_or_default(),
            turned: turned.collect(),
            pose: held,
        });
    }
}

impl Seam {
    /// Fades the difference at the seam out of the frames after it.
    fn fade(&self, rotations: &mut [Quat], joints: usize) {
        for (step, pose) in rotations.chunks_exact_mut(joints).enumerate().take(SEAM_FRAMES) {
            let left = 1.0 - smoothstep((step + 1) as f32 / (SEAM_FRAMES + 1) as f32);
            for (rotation, turn) in pose.iter_mut().zip(&self.turned) {
                let turn = Quat::IDENTITY.slerp(align_sign(*turn, Quat::IDENTITY), left);
                *rotation = (turn * *rotation).normalize();
            }
        }
    }
}

fn same_joints(words: &Skeleton, own: &Skeleton) -> bool {
    let same = |(a, b): (&Joint, &Joint)| a.name == b.name && a.parent == b.parent;
    words.joint_count() == own.joint_count() && words.joints.iter().zip(&own.joints).all(same)
}

//! Another body that a motion is carried over to before it meets its constraints.

use troupe_motion::Quat;
use troupe_motion::ik::Leg;
use troupe_motion::retarget::Retargeter;

use super::request::Wanted;
use super::track::Track;

/// The body of an answer that is not the body of its take.
#[derive(Debug, Clone)]
pub struct Onto {
    retargeter: Retargeter,
    legs: Vec<Leg>,
    /// For each contact of the take's body the bit of this one.
    contacts: Vec<Option<usize>>,
    /// Constraints on this body, in its size.
    pub wanted: Wanted,
}

impl Onto {
    /// The target of a retargeter from the take's body.
    pub fn new(retargeter: Retargeter, wanted: Wanted) -> Self {
        Self {
            legs: retargeter.legs(),
            contacts: {
                let contacts = retargeter.contacts().into_iter();
                contacts.map(|own| own.map(|(bit, _)| bit)).collect()
            },
            retargeter,
            wanted,
        }
    }

    /// The way from the take's body to this one.
    pub fn retargeter(&self) -> &Retargeter {
        &self.retargeter
    }

    /// The legs of this body, with the bits of their contacts.
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// A motion of the take's body on this one.
    pub(super) fn carry(&self, track: &Track, fps: f32) -> Track {
        let mut retargeter = self.retargeter.clone();
        retargeter.reset();
        retargeter.set_step(1.0 / fps);
        let joints = retargeter.figures()[1].skeleton().joint_count();
        let mut pose = vec![Quat::IDENTITY; joints];
        let mut made = Track::default();
        for (frame, (&root, &bits)) in track.roots.iter().zip(&track.contacts).enumerate() {
            let root = retargeter.pose(root, track.pose(frame), &mut pose);
            let own = self.contacts.iter().enumerate();
            let own = own.filter(|(bit, _)| bits >> bit & 1 == 1);
            made.push(
                root,
                &pose,
                own.filter_map(|(_, &bit)| bit).fold(0, |all, bit| all | 1 << bit),
            );
        }
        made
    }
}

#[cfg(test)]
#[path = "onto_tests.rs"]
mod tests;

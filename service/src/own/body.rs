//! Columns of an answer on the body of another pack. Callers of that body expect its contacts and
//! its joints.

use std::collections::BTreeMap;

use troupe_live::skeleton::Worn;
use troupe_motion::model::Rig;
use troupe_proto::v1;

/// The columns of a body, by those of the pack whose motion is carried over.
#[derive(Debug)]
pub(super) struct OfBody {
    /// For each contact of the body those of the pack that stand for it.
    contacts: Vec<Vec<usize>>,
    /// Number of the pack's contacts.
    made: usize,
    /// The body's joints by those of the pack.
    joints: BTreeMap<u32, u32>,
}

impl OfBody {
    /// The body with this rig, which `worn` leads to.
    pub(super) fn new(worn: &Worn, rig: &Rig) -> Self {
        let made = worn.onto().contacts();
        let from = |joint: usize| -> Vec<usize> {
            let found = made.iter().enumerate();
            let found = found.filter(|(_, own)| own.is_some_and(|(_, own)| own == joint));
            found.map(|(nth, _)| nth).collect()
        };
        let contacts = rig.skeleton.contacts.iter();
        let contacts = contacts.flat_map(|contacts| &contacts.joints);
        let mut joints = BTreeMap::new();
        for (pack, body) in worn.onto().pairs() {
            joints.entry(pack as u32).or_insert(body as u32);
        }
        Self {
            contacts: contacts.map(|&joint| from(joint)).collect(),
            made: made.len(),
            joints,
        }
    }

    /// Replaces the contacts of frames. Of several that stand for one of the body the largest
    /// counts.
    pub(super) fn touch(&self, frames: &mut v1::Frames) {
        let rows = frames.contacts.chunks_exact(self.made.max(1));
        let of_row = |row: &[f32]| -> Vec<f32> {
            let most = |from: &Vec<usize>| from.iter().map(|&nth| row[nth]).fold(0.0, f32::max);
            self.contacts.iter().map(most).collect()
        };
        frames.contacts = rows.flat_map(of_row).collect();
    }

    /// Replaces the joints of a judgement. A figure about a joint that the body lacks names none.
    pub(super) fn name_joints(&self, found: &mut v1::Feasibility) {
        let figures = [
            &mut found.joint_speed,
            &mut found.joint_acceleration,
            &mut found.below_ground,
            &mut found.off_ground,
            &mut found.bend,
        ];
        for figure in figures.into_iter().flatten() {
            figure.joint = figure.joint.and_then(|joint| self.joints.get(&joint).copied());
        }
    }
}

#[cfg(test)]
#[path = "body_tests.rs"]
mod tests;

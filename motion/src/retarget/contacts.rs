//! The target's feet, for inverse kinematics and contacts.

use super::Retargeter;
use super::figure::Figure;
use crate::anatomy::Limb;
use crate::ik::Leg;

impl Figure {
    /// Limbs that the body stands on: left and right, the hind ones first.
    fn feet(&self) -> impl Iterator<Item = &Limb> {
        let fore = self.parts.arms.iter().filter(|_| self.parts.on_fours);
        self.parts.legs.iter().chain(fore.flatten())
    }
}

impl Retargeter {
    /// The target's legs. The contact bits of leg `n` are `2 * n` for its ankle and `2 * n + 1` for
    /// its toe.
    pub fn legs(&self) -> Vec<Leg> {
        let height = |joint: usize| self.target.places[joint].y;
        let leg = |(nth, limb): (usize, &Limb)| Leg {
            upper: limb.top,
            lower: limb.lower[0],
            foot: limb.end,
            toe: limb.toe,
            contacts: [Some(2 * nth), limb.toe.map(|_| 2 * nth + 1)],
            clearance_m: [height(limb.end), limb.toe.map_or(0.0, height)],
        };
        self.target.feet().enumerate().map(leg).collect()
    }

    /// For each contact joint of the source the target's joint that stands with it, after its
    /// contact bit: toes for toes, ankles for the rest of a foot. None for contacts that are on no
    /// leg.
    pub fn contacts(&self) -> Vec<Option<(usize, usize)>> {
        let joints = &self.source.skeleton.joints;
        let above = |joint: usize| std::iter::successors(Some(joint), |&joint| joints[joint].parent);
        let pairs: Vec<_> = self.source.feet().zip(self.target.feet()).collect();
        let own = |&contact: &usize| {
            let on = |(from, _): &(&Limb, &Limb)| above(contact).any(|joint| joint == from.upper[0]);
            let nth = pairs.iter().position(on)?;
            let (from, to) = pairs[nth];
            Some(match to.toe.filter(|_| contact != from.end) {
                Some(toe) => (2 * nth + 1, toe),
                None => (2 * nth, to.end),
            })
        };
        let contacts = self.source.skeleton.contacts.iter();
        contacts.flat_map(|contacts| &contacts.joints).map(own).collect()
    }

    /// Joints of source and target that are the same part of a body.
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let trunk = |figure: &Figure| {
            let parts = &figure.parts;
            [parts.trunk.first(), parts.trunk.last(), parts.neck.last()].map(|joint| joint.copied())
        };
        let limb = |limb: &Limb| {
            let bones = [limb.upper[0], limb.lower[0], limb.end].map(Some);
            [
                limb.girdle.last().copied(),
                bones[0],
                bones[1],
                bones[2],
                limb.toe,
            ]
        };
        let limbs = |figure: &Figure| {
            let parts = figure.parts.clone();
            let limbs = parts.legs.into_iter().chain(parts.arms.into_iter().flatten());
            limbs.flat_map(|part| limb(&part)).collect::<Vec<_>>()
        };
        let all = [&self.source, &self.target].map(|figure| trunk(figure).into_iter().chain(limbs(figure)));
        let [from, to] = all;
        let mut pairs: Vec<_> = from.zip(to).filter_map(|(from, to)| Some((from?, to?))).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

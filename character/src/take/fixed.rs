//! Roots that constraints fix.

use std::collections::BTreeMap;

use troupe_motion::GlobalRoot;
use troupe_motion::root::heading_of;

use super::request::Take;

/// What the root of a frame must be.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fixed {
    /// World x and z, metres.
    pub(super) place: Option<[f32; 2]>,
    /// Height, metres.
    pub(super) y: Option<f32>,
    /// Radians.
    pub(super) heading: Option<f32>,
}

impl Fixed {
    /// A root with what is fixed of it. Other parts stay as they were made.
    pub(super) fn of(&self, mut root: GlobalRoot) -> GlobalRoot {
        if let Some([x, z]) = self.place {
            (root.position.x, root.position.z) = (x, z);
        }
        root.position.y = self.y.unwrap_or(root.position.y);
        root.heading = self.heading.unwrap_or(root.heading);
        root
    }
}

/// The roots that constraints fix, by frame.
pub(super) fn fixed(take: &Take) -> BTreeMap<usize, Fixed> {
    let mut fixed: BTreeMap<usize, Fixed> = BTreeMap::new();
    for knot in &take.wanted.path {
        let at = fixed.entry(knot.frame.round() as usize).or_default();
        at.place = Some(knot.place);
        at.heading = knot.heading;
    }
    let left = take.subject.rig.skeleton.left_axis;
    for key in &take.wanted.keys {
        let at = fixed.entry(key.frame).or_default();
        if let Some(root) = key.root {
            at.place = Some([root.x, root.z]);
            at.y = Some(root.y);
        }
        if let Some(pelvis) = key.rotations[0] {
            at.heading = Some(heading_of(pelvis, left));
        }
    }
    for effector in take
        .wanted
        .effectors
        .iter()
        .filter(|effector| effector.joint == 0)
    {
        let at = fixed.entry(effector.frame).or_default();
        at.place = Some([effector.point.x, effector.point.z]);
        at.y = Some(effector.point.y);
        at.heading = at
            .heading
            .or(effector.rotation.map(|pelvis| heading_of(pelvis, left)));
    }
    fixed
}


//! What a finished motion must meet: the body of the answer, and constraints on its root.

use std::collections::BTreeMap;

use troupe_motion::Skeleton;
use troupe_motion::anatomy::Parts;
use troupe_motion::ik::Leg;
use troupe_motion::root::heading_of;

use super::request::{Effector, Take, Wanted};

/// The constraints on the root of one frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fixed {
    pub(super) place: Option<[f32; 2]>,
    pub(super) y: Option<f32>,
    pub(super) heading: Option<f32>,
}

/// The body of the answer, and what it must meet.
#[derive(Clone, Copy)]
pub(super) struct Body<'a> {
    pub(super) skeleton: &'a Skeleton,
    pub(super) legs: &'a [Leg],
    /// Of a body that a motion is carried over to.
    pub(super) parts: Option<&'a Parts>,
    pub(super) wanted: &'a Wanted,
    /// Its size by that of the take's body.
    pub(super) scale: f32,
}

impl<'a> Body<'a> {
    pub(super) fn of(take: &'a Take) -> Self {
        match &take.onto {
            None => Self {
                skeleton: &take.subject.rig.skeleton,
                legs: &take.subject.rig.legs,
                parts: None,
                wanted: &take.wanted,
                scale: 1.0,
            },
            Some(onto) => {
                let figure = onto.retargeter().figures()[1];
                Self {
                    skeleton: figure.skeleton(),
                    legs: onto.legs(),
                    parts: Some(figure.parts()),
                    wanted: &onto.wanted,
                    scale: onto.retargeter().scale(),
                }
            }
        }
    }
}

/// The constraints on the root, by frame.
pub(super) fn fixed(body: &Body<'_>) -> BTreeMap<usize, Fixed> {
    let mut fixed: BTreeMap<usize, Fixed> = BTreeMap::new();
    for knot in &body.wanted.path {
        let at = fixed.entry(knot.frame.round() as usize).or_default();
        at.place = Some(knot.place);
        at.heading = knot.heading;
    }
    let left = body.skeleton.left_axis;
    for key in &body.wanted.keys {
        let at = fixed.entry(key.frame).or_default();
        if let Some(root) = key.root {
            at.place = Some([root.x, root.z]);
            at.y = Some(root.y);
        }
        if let Some(pelvis) = key.rotations[0] {
            at.heading = Some(heading_of(pelvis, left));
        }
    }
    let of_root = |effector: &&Effector| effector.joint == 0;
    for effector in body.wanted.effectors.iter().filter(of_root) {
        let at = fixed.entry(effector.frame).or_default();
        at.place = Some([effector.point.x, effector.point.z]);
        at.y = Some(effector.point.y);
        at.heading = at
            .heading
            .or(effector.rotation.map(|pelvis| heading_of(pelvis, left)));
    }
    fixed
}

//! A window that is final once it is made.

use std::collections::BTreeMap;
use std::ops::Range;

use troupe_motion::ik::{FootLock, lock_feet};
use troupe_motion::model::Rig;
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::{GlobalRoot, Quat};

use super::fixed::Fixed;
use super::track::Track;
use crate::live::CONTEXT_FRAMES;
use crate::post::PIN_REACH_FRAMES;

/// The frame that a window goes on from.
const LAST_CONTEXT: usize = CONTEXT_FRAMES - 1;
/// Farthest that a foot is moved, metres.
const HELD_M: f32 = 0.25;

/// What the frames of a window must meet, by frame of the window.
#[derive(Debug, Default)]
pub(super) struct Demands {
    pub(super) roots: BTreeMap<usize, Fixed>,
    pub(super) poses: BTreeMap<usize, Vec<Quat>>,
}

/// Has the frames of a window behind its context meet what they must.
pub(super) fn settle(rig: &Rig, window: &mut Track, demands: &Demands, hold: bool) -> f32 {
    let joints = rig.skeleton.joint_count();
    let mut roots: Vec<GlobalRoot> = (0..window.len()).map(|frame| window.root(frame, &rig.skeleton)).collect();
    let pins = demands.roots.iter().filter(|(frame, _)| **frame < roots.len());
    let pins: Vec<RootPin> = pins
        .map(|(&frame, fixed)| RootPin {
            frame,
            root: fixed.of(roots[frame]),
        })
        .collect();
    let off = |pin: &RootPin| (pin.root.position - roots[pin.frame].position).with_y(0.0).length();
    let moved_m = pins.iter().map(off).fold(0.0, f32::max);
    pin_targets(&mut roots, &mut window.rotations, joints, LAST_CONTEXT, &pins);
    for (place, root) in window.roots.iter_mut().zip(roots) {
        *place = root.position;
    }
    let last = window.pose(LAST_CONTEXT).to_vec();
    let start = PosePin {
        frame: LAST_CONTEXT,
        rotations: &last,
    };
    let given = demands.poses.iter().map(|(&frame, rotations)| PosePin { frame, rotations });
    let pins: Vec<PosePin<'_>> = std::iter::once(start).chain(given).collect();
    pin_poses(&mut window.rotations, joints, &pins, PIN_REACH_FRAMES);
    if hold {
        hold_feet(rig, window, demands);
    }
    moved_m
}

fn hold_feet(rig: &Rig, window: &mut Track, demands: &Demands) {
    let count = window.len();
    let mut from = CONTEXT_FRAMES;
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for &end in demands.poses.keys().filter(|&&frame| frame < count) {
        ranges.push(from..end);
        from = end + 1;
    }
    ranges.push(from..count);
    let Track {
        roots,
        rotations,
        contacts,
    } = window;
    crate::post::bend_as_shown(rig, rotations, |rotations| {
        for range in ranges.into_iter().filter(|range| !range.is_empty()) {
            let options = FootLock {
                max_offset_m: HELD_M,
                max_drop_m: 0.0,
                floor_m: Some(0.0),
                ..FootLock::over(range)
            };
            lock_feet(&rig.skeleton, &rig.legs, roots, rotations, contacts, &options);
        }
    });
}

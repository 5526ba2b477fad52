//! A window that is final once it is made: it meets its keyframes, and its feet stand still.

use std::ops::Range;

use troupe_motion::ik::{FootLock, lock_feet};
use troupe_motion::model::Rig;
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::{GlobalRoot, Quat};

use super::track::Track;
use crate::live::CONTEXT_FRAMES;
use crate::post::PIN_REACH_FRAMES;
use crate::primitives::TargetKey;

/// The frame that a window goes on from.
const LAST_CONTEXT: usize = CONTEXT_FRAMES - 1;

/// Has the frames of a window meet `keys`, which are in the order of their frames, counted from the
/// window's first one. Its context stays as it is.
///
/// A robot's frames come onto its hinges later: locking feet first costs less foot skate than
/// locking the feet of fitted frames (g1 on a square: 1.8 and 4.4 mm a frame).
pub(super) fn settle(rig: &Rig, window: &mut Track, keys: &[(usize, &TargetKey)], hold_feet: bool) {
    let joints = rig.skeleton.joint_count();
    let frames = 0..window.len();
    let mut roots: Vec<GlobalRoot> = frames.map(|frame| window.root(frame, &rig.skeleton)).collect();
    let pin = |&(frame, key): &(usize, &TargetKey)| {
        Some(RootPin {
            frame,
            root: key.root?,
        })
    };
    let pins: Vec<RootPin> = keys.iter().filter_map(pin).collect();
    pin_targets(&mut roots, &mut window.rotations, joints, LAST_CONTEXT, &pins);
    for (place, root) in window.roots.iter_mut().zip(roots) {
        *place = root.position;
    }
    let poses: Vec<(usize, &[Quat])> = keys
        .iter()
        .filter_map(|&(frame, key)| Some((frame, key.rotations.as_deref()?)))
        .collect();
    // The context is a pin of its own: nothing in front of it may change.
    let context = window.pose(LAST_CONTEXT).to_vec();
    let pins = std::iter::once((LAST_CONTEXT, context.as_slice())).chain(poses.iter().copied());
    let pins: Vec<PosePin<'_>> = pins
        .map(|(frame, rotations)| PosePin { frame, rotations })
        .collect();
    pin_poses(&mut window.rotations, joints, &pins, PIN_REACH_FRAMES);
    if hold_feet {
        for range in between(poses.iter().map(|(frame, _)| *frame), window.len()) {
            let options = FootLock {
                // The root keeps its way and its height.
                max_drop_m: 0.0,
                floor_m: Some(0.0),
                ..FootLock::over(range)
            };
            let Track {
                roots,
                rotations,
                contacts,
            } = window;
            lock_feet(&rig.skeleton, &rig.legs, roots, rotations, contacts, &options);
        }
    }
}

/// The frames behind the context that have no given pose.
fn between(given: impl Iterator<Item = usize>, count: usize) -> Vec<Range<usize>> {
    let mut ranges = Vec::new();
    let mut from = CONTEXT_FRAMES;
    for end in given {
        ranges.push(from..end);
        from = end + 1;
    }
    ranges.push(from..count);
    ranges.retain(|range| !range.is_empty());
    ranges
}

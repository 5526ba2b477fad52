//! Keeps standing feet in place: removes the sliding that the networks leave.

use std::ops::Range;

use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{Carried, FootLock, FootPlant, Planted, lock_feet, plant_feet};
use troupe_motion::model::Rig;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::hinges::bend_as_shown;

/// Contact probability from which on a foot touches the ground.
const CONTACT: f32 = 0.5;
/// Farthest that a foot is moved in a gap between known keyframes, metres.
const FARTHEST_M: f32 = 0.25;
/// Farthest that a foot is moved in a live plan, metres. A foot that slides farther is on its way,
/// and holding it would jerk.
const FARTHEST_LIVE_M: f32 = 0.05;

/// One byte a frame: bit i for contact joint i. Contact joints from the ninth on have no bit.
pub fn contact_bits(contacts: &[f32], joints: usize, frames: usize) -> Vec<u8> {
    let bits = |row: &[f32]| bits_of(row.iter().map(|&contact| contact >= CONTACT));
    match joints {
        0 => vec![0; frames],
        _ => contacts.chunks_exact(joints).take(frames).map(bits).collect(),
    }
}

/// Bits for the first eight of these.
pub(crate) fn bits_of(touches: impl IntoIterator<Item = bool>) -> u8 {
    let each = touches.into_iter().take(8).enumerate();
    each.fold(0, |bits, (nth, touches)| bits | (u8::from(touches) << nth))
}

/// Holds the standing feet of a segment in the frames of `gap`, between its keyframes, and lifts
/// feet out of the ground.
///
/// The ground is at height 0. If a keyframe has its lowest foot below that, the ground is there:
/// keyframes know better. Everything is in the world, and a robot's poses are on its hinges.
pub fn hold_between(
    rig: &Rig,
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &[u8],
    gap: Range<usize>,
) {
    let given = (0..gap.start).chain(gap.end..roots.len());
    let floor_m = given
        .map(|frame| lowest_foot_m(&rig.skeleton, roots[frame], &rotations[frame * rig.dims.joints..]))
        .fold(0.0, f32::min);
    hold(rig, roots, rotations, contacts, gap, (FARTHEST_M, floor_m));
}

/// Holds the standing feet of live motion from frame `start` on. The ground is at height 0. Feet of
/// bodies that follow paths are [planted](plant), and their contacts become those of the feet that
/// stand.
pub(crate) fn hold_live(
    rig: &Rig,
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &mut [u8],
    start: usize,
) {
    if rig.by_path.is_some() {
        let range = start..roots.len();
        plant(rig, (roots, rotations, contacts), range, None);
        return;
    }
    let (range, limits) = (start..roots.len(), (FARTHEST_LIVE_M, 0.0));
    // A robot's plans are not on its hinges yet. Feet held before that would slide again once they
    // are.
    bend_as_shown(rig, rotations, |rotations| {
        hold(rig, roots, rotations, contacts, range, limits);
    });
}

/// Has the feet of a body that follows paths stand in the frames of `range`. Its network leaves
/// them gliding on paths that are not as captured ones, so that no contact shows in their speed.
pub(crate) fn plant(
    rig: &Rig,
    (roots, rotations, contacts): (&mut [Vec3], &mut [Quat], &mut [u8]),
    range: Range<usize>,
    carried: Option<&Carried>,
) -> Planted {
    let options = FootPlant {
        fps: rig.fps,
        range,
        floor_m: 0.0,
        height_m: rig.by_path.as_ref().map_or(f32::INFINITY, |body| body.height_m),
    };
    let mut planted = Planted::default();
    bend_as_shown(rig, rotations, |rotations| {
        let how = (&options, carried);
        planted = plant_feet(&rig.skeleton, &rig.legs, roots, rotations, contacts, how);
    });
    planted
}

fn hold(
    rig: &Rig,
    roots: &mut [Vec3],
    rotations: &mut [Quat],
    contacts: &[u8],
    range: Range<usize>,
    (max_offset_m, floor_m): (f32, f32),
) {
    let options = FootLock {
        max_offset_m,
        // The root keeps its path and height: both were asked for.
        max_drop_m: 0.0,
        floor_m: Some(floor_m),
        ..FootLock::over(range)
    };
    lock_feet(&rig.skeleton, &rig.legs, roots, rotations, contacts, &options);
}

/// Height of the lowest contact joint of a pose over its height on the ground, metres.
fn lowest_foot_m(skeleton: &Skeleton, root: Vec3, pose: &[Quat]) -> f32 {
    let contacts = skeleton.contacts.iter();
    contacts
        .flat_map(|contacts| contacts.joints.iter().zip(&contacts.clearance_m))
        .map(|(&joint, clearance_m)| joint_transform(skeleton, root, pose, joint).0.y - clearance_m)
        .fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
#[path = "feet_tests.rs"]
mod tests;

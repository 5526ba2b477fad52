//! Feet that stand still: what networks leave of sliding is taken out once frames are made.

use std::ops::Range;

use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{FootLock, Leg, lock_feet};
use troupe_motion::model::Rig;
use troupe_motion::robot::Fitted;
use troupe_motion::{Quat, Skeleton, Vec3};

/// From here on a contact counts.
const CONTACT: f32 = 0.5;
/// How far a foot is moved at most in a gap whose ends are known, metres.
const FARTHEST_M: f32 = 0.25;
/// In a plan that the next one takes over from: a foot that slides farther goes somewhere, and to hold it would jerk.
const FARTHEST_LIVE_M: f32 = 0.05;

/// One byte a frame, bit i for contact joint i; contact joints from the ninth on have none.
pub fn contact_bits(contacts: &[f32], joints: usize, frames: usize) -> Vec<u8> {
    let bits = |row: &[f32]| bits_of(row.iter().map(|&contact| contact >= CONTACT));
    match joints {
        0 => vec![0; frames],
        _ => contacts.chunks_exact(joints).take(frames).map(bits).collect(),
    }
}

/// A bit for each of the first eight.
pub(crate) fn bits_of(touches: impl IntoIterator<Item = bool>) -> u8 {
    let each = touches.into_iter().take(8).enumerate();
    each.fold(0, |bits, (nth, touches)| bits | (u8::from(touches) << nth))
}

/// Holds the feet of a segment between its keyframes, the frames outside of `gap`, and lifts them out of the ground.
///
/// The ground is at 0, or as far below as the lowest foot of a keyframe: where that is, the keyframes know better. Everything is in
/// the world, and a robot's poses are on its hinges.
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

/// Holds the feet of a live plan behind its context, the frames before `start`; it stands on a ground at 0.
///
/// Of a robot, whose plans are not on the hinges, only legs that are bent for it come onto them: frames tell later what the
/// hinges lack.
pub fn hold_live(rig: &Rig, roots: &mut [Vec3], rotations: &mut [Quat], contacts: &[u8], start: usize) {
    let (range, limits) = (start..roots.len(), (FARTHEST_LIVE_M, 0.0));
    let Some(robot) = &rig.skeleton.robot else {
        return hold(rig, roots, rotations, contacts, range, limits);
    };
    let joints = rig.dims.joints;
    // Feet that are held by limbs as the networks made them would slide again once they are brought onto the hinges.
    let mut fitted = rotations.to_vec();
    let mut took = Fitted::default();
    for pose in fitted[start * joints..].chunks_exact_mut(joints) {
        robot.fit(pose, &mut took);
    }
    let mut held = fitted.clone();
    hold(rig, roots, &mut held, contacts, range.clone(), limits);
    for leg in rig.legs.iter() {
        let limb = limb_of(&rig.skeleton, leg);
        for frame in range.clone() {
            let at = |joint: &usize| frame * joints + joint;
            if limb.iter().any(|joint| held[at(joint)] != fitted[at(joint)]) {
                limb.iter()
                    .for_each(|joint| rotations[at(joint)] = held[at(joint)]);
            }
        }
    }
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
        // The root keeps its way and its height: both were asked for.
        max_drop_m: 0.0,
        floor_m: Some(floor_m),
        ..FootLock::over(range)
    };
    lock_feet(&rig.skeleton, &rig.legs, roots, rotations, contacts, &options);
}

/// The joints of a leg, from the one that hangs from the root to the toes.
fn limb_of(skeleton: &Skeleton, leg: &Leg) -> Vec<usize> {
    let top = |joint: usize| {
        let upwards = std::iter::successors(Some(joint), |&joint| skeleton.joints[joint].parent);
        upwards.take_while(|&joint| joint != 0).last()
    };
    let of_leg = top(leg.upper);
    (1..skeleton.joint_count())
        .filter(|&joint| top(joint) == of_leg)
        .collect()
}

/// How high the lowest contact joint of a pose is over where it would be on the ground, metres.
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

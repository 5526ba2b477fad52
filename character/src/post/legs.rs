//! Keeps legs from passing through each other: where two shins or feet would meet, the swinging leg
//! goes around the other.

use troupe_motion::fk::transforms_down_to;
use troupe_motion::ik::{Leg, two_bone};
use troupe_motion::model::Rig;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::apart::{AROUND_FRAMES, Apart, Meeting, around, eased, runs};
use super::hinges::bend_as_shown;

/// Least distance between the axes of two shins, metres. In clips of people, one in twenty-five
/// comes within 5 cm.
const SHINS_APART_M: f32 = 0.075;
/// Least distance between the axes of two feet, metres.
const FEET_APART_M: f32 = 0.06;
/// The nearest point of a shin counts from this share of the way from knee to ankle on: nearer to
/// the knee, moving the ankle helps little.
const LEAST_SHARE: f32 = 0.6;
/// Number of passes. The second corrects what the first leaves, now that the other leg has its new
/// path.
const PASSES: usize = 2;

/// A leg swings, and the other stands, if its ankle travels this many times as far.
const SWINGS: f32 = 1.5;
/// If two ankles together travel less than this while the legs are near, metres, neither is moved:
/// the character stands like that.
const STANDS_M: f32 = 0.03;

/// Keeps the two legs of a body apart in consecutive frames; a robot's as far as its hinges allow.
///
/// This works on what is shown, after the cross-fade: two plans whose legs are apart may meet half
/// way between them.
pub(crate) fn part_legs(rig: &Rig, roots: &[Vec3], rotations: &mut [Quat]) {
    let (skeleton, [left, right]) = (&*rig.skeleton, &rig.legs[..]) else {
        return;
    };
    bend_as_shown(rig, rotations, |rotations| {
        part(skeleton, [left, right], roots, rotations)
    });
}

fn part(skeleton: &Skeleton, [left, right]: [&Leg; 2], roots: &[Vec3], rotations: &mut [Quat]) {
    let joints = skeleton.joint_count();
    for _ in 0..PASSES {
        let (meetings, ankles): (Vec<Meeting>, Vec<[Vec3; 2]>) = roots
            .iter()
            .zip(rotations.chunks_exact(joints))
            .map(|(&root, pose)| meeting([left, right].map(|leg| points(skeleton, leg, root, pose))))
            .unzip();
        let mut ways = [vec![Vec3::ZERO; meetings.len()], vec![Vec3::ZERO; meetings.len()]];
        for near in runs(&meetings) {
            let shares = shares(&ankles[around(near.clone(), AROUND_FRAMES, ankles.len())]);
            let apart = Apart::of(&meetings[near.clone()]);
            for frame in near {
                let way = apart.way(&meetings[frame]);
                ways[0][frame] = way * shares[0];
                ways[1][frame] = -way * shares[1];
            }
        }
        if ways.iter().flatten().all(|way| *way == Vec3::ZERO) {
            return;
        }
        for (leg, ways) in [left, right].into_iter().zip(ways) {
            leave(skeleton, leg, roots, rotations, &eased(&ways));
        }
    }
}

/// Share of the detour that each leg takes, by how far their ankles travel.
fn shares(ankles: &[[Vec3; 2]]) -> [f32; 2] {
    let goes = |leg: usize| {
        let steps = ankles.windows(2).map(|pair| pair[0][leg].distance(pair[1][leg]));
        steps.sum::<f32>()
    };
    match [goes(0), goes(1)] {
        [left, right] if left + right < STANDS_M => [0.0, 0.0],
        [left, right] if left > SWINGS * right => [1.0, 0.0],
        [left, right] if right > SWINGS * left => [0.0, 1.0],
        _ => [0.5, 0.5],
    }
}

/// How the left leg lies to the right one in a frame, at their shins or at their feet, and the
/// places of the ankles.
fn meeting([left, right]: [[Vec3; 4]; 2]) -> (Meeting, [Vec3; 2]) {
    let at = |bone: [usize; 2], apart_m| {
        let [left_bone, right_bone] = [left, right].map(|points| bone.map(|point| points[point]));
        Meeting::of(left_bone, right_bone, left[0] - right[0], apart_m)
    };
    let (shins, feet) = (at([1, 2], SHINS_APART_M), at([2, 3], FEET_APART_M));
    let nearer = match shins.lack_m() > feet.lack_m() {
        true => shins.counting_from(LEAST_SHARE),
        false => feet.counting_from(1.0),
    };
    (nearer, [left[2], right[2]])
}

/// Hip, knee, ankle and toe of a leg in the world. Without a toe the ankle comes twice.
fn points(skeleton: &Skeleton, leg: &Leg, root: Vec3, pose: &[Quat]) -> [Vec3; 4] {
    let toe = leg.toe.unwrap_or(leg.foot);
    let joints = [leg.upper, leg.lower, leg.foot, toe];
    let mut points = [Vec3::ZERO; 4];
    transforms_down_to(skeleton, root, pose, toe, &mut |joint, position, _| {
        for (point, _) in points.iter_mut().zip(joints).filter(|(_, of)| *of == joint) {
            *point = position;
        }
    });
    points
}

/// Moves a leg's ankle by `ways`, one for each frame; the foot keeps its rotation.
fn leave(skeleton: &Skeleton, leg: &Leg, roots: &[Vec3], rotations: &mut [Quat], ways: &[Vec3]) {
    let poses = rotations.chunks_exact_mut(skeleton.joint_count());
    let frames = roots.iter().zip(poses).zip(ways);
    for ((&root, pose), way) in frames.filter(|(_, way)| **way != Vec3::ZERO) {
        let [.., ankle, _] = points(skeleton, leg, root, pose);
        let pole = GlobalRoot::of_pose(root, pose[0], skeleton.left_axis).forward();
        two_bone(skeleton, root, pose, leg.chain(), ankle + *way, pole, true);
    }
}

#[cfg(test)]
#[path = "legs_tests.rs"]
mod tests;

//! Keeps legs from passing through each other: where two shins or feet would meet, the swinging leg
//! goes around the other.

use std::ops::Range;

use troupe_motion::bones::nearest_points;
use troupe_motion::fk::transforms_down_to;
use troupe_motion::ik::{Leg, two_bone};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::Rig;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::hinges::bend_as_shown;

/// Least distance between the axes of two shins, metres. In clips of people, one in twenty-five
/// comes within 5 cm.
const SHINS_APART_M: f32 = 0.075;
/// Least distance between the axes of two feet, metres.
const FEET_APART_M: f32 = 0.06;
/// Frames that a leg takes to leave its path, and as many to return, around the frame with the
/// greatest detour.
const AROUND_FRAMES: usize = 4;
/// Frames over which legs begin to leave their path at the start of a plan.
const LEAVE_FRAMES: usize = 2;
/// Farthest that an ankle leaves its path, metres.
const FARTHEST_M: f32 = 0.12;
/// The nearest point of a shin counts from this share of the way from knee to ankle on: nearer to
/// the knee, moving the ankle helps little.
const LEAST_SHARE: f32 = 0.6;
/// Number of passes. The second corrects what the first leaves, now that the other leg has its new
/// path.
const PASSES: usize = 2;
/// Distances between legs shorter than this have no direction, metres.
const NOWHERE_M: f32 = 0.005;

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
        let meetings: Vec<Meeting> = roots
            .iter()
            .zip(rotations.chunks_exact(joints))
            .map(|(&root, pose)| Meeting::of(skeleton, [left, right], root, pose))
            .collect();
        let mut ways = [vec![Vec3::ZERO; meetings.len()], vec![Vec3::ZERO; meetings.len()]];
        for near in runs(&meetings) {
            let shares = shares(&meetings[around(near.clone(), AROUND_FRAMES, meetings.len())]);
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
fn shares(meetings: &[Meeting]) -> [f32; 2] {
    let goes = |leg: usize| {
        let steps = meetings
            .windows(2)
            .map(|pair| pair[0].ankles[leg].distance(pair[1].ankles[leg]));
        steps.sum::<f32>()
    };
    match [goes(0), goes(1)] {
        [left, right] if left + right < STANDS_M => [0.0, 0.0],
        [left, right] if left > SWINGS * right => [1.0, 0.0],
        [left, right] if right > SWINGS * left => [0.0, 1.0],
        _ => [0.5, 0.5],
    }
}

/// The frames of a range and `reach` frames on either side, within `len` frames.
fn around(range: Range<usize>, reach: usize, len: usize) -> Range<usize> {
    range.start.saturating_sub(reach)..(range.end + reach).min(len)
}

/// How two legs lie to each other in a frame.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    /// From the right leg to the left at their nearest points, over the ground, metres.
    between: Vec3,
    /// Least distance there over the ground, metres.
    least_m: f32,
    /// Where on the shin that is: 0 at the knee, 1 at the ankle and below.
    share: f32,
    /// From the right hip to the left over the ground, metres.
    hips: Vec3,
    /// Places of the ankles, left and right.
    ankles: [Vec3; 2],
}

impl Meeting {
    fn of(skeleton: &Skeleton, legs: [&Leg; 2], root: Vec3, pose: &[Quat]) -> Self {
        let [left, right] = legs.map(|leg| points(skeleton, leg, root, pose));
        let shins = Self::at([left, right], [1, 2], SHINS_APART_M);
        let feet = Self::at([left, right], [2, 3], FEET_APART_M);
        match shins.lack_m() > feet.lack_m() {
            true => shins,
            false => feet,
        }
    }

    /// Meeting of the bones between two of the legs' points.
    fn at(legs: [[Vec3; 4]; 2], bone: [usize; 2], apart_m: f32) -> Self {
        let [left, right] = legs.map(|points| bone.map(|point| points[point]));
        let [on_left, on_right] = nearest_points(left, right);
        let between = on_left - on_right;
        let down = (on_left - left[0]).length() / (left[1] - left[0]).length().max(NOWHERE_M);
        Self {
            between: between.with_y(0.0),
            least_m: (apart_m * apart_m - between.y * between.y).max(0.0).sqrt(),
            share: if bone[0] == 1 {
                down.clamp(LEAST_SHARE, 1.0)
            } else {
                1.0
            },
            hips: (legs[0][0] - legs[1][0]).with_y(0.0),
            ankles: legs.map(|points| points[2]),
        }
    }

    fn lack_m(&self) -> f32 {
        self.least_m - self.between.length()
    }
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

/// Runs of frames in which the legs are too near.
fn runs(meetings: &[Meeting]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (frame, _) in meetings.iter().enumerate().filter(|(_, m)| m.lack_m() > 0.0) {
        match runs.last_mut() {
            Some(run) if run.end == frame => run.end += 1,
            _ => runs.push(frame..frame + 1),
        }
    }
    runs
}

/// The direction in which legs are moved apart while they are near. It is the same in all of those
/// frames: otherwise a leg that passes through the other would be pushed to one side first, and
/// then to the other.
#[derive(Debug, Clone, Copy)]
struct Apart {
    direction: Vec3,
}

impl Apart {
    fn of(near: &[Meeting]) -> Self {
        let [.., last] = near else {
            return Self { direction: Vec3::X };
        };
        let mean = near.iter().map(|m| m.between).sum::<Vec3>() / near.len() as f32;
        let passes = last.between - near[0].between;
        let hips = near[near.len() / 2].hips;
        // Across the direction of passing, to the side that the leg is on, or else that of its hip.
        let across = |side: Vec3| match passes.length() > NOWHERE_M {
            true => side - passes * (side.dot(passes) / passes.length_squared()),
            false => side,
        };
        let candidates = [across(mean), across(hips), hips];
        let found = candidates.into_iter().find(|way| way.length() > NOWHERE_M);
        Self {
            direction: found.unwrap_or(Vec3::X).normalize(),
        }
    }

    /// Offset of the left ankle against the right, metres.
    fn way(&self, meeting: &Meeting) -> Vec3 {
        let along = meeting.between.dot(self.direction);
        let aside = meeting.between - self.direction * along;
        let wanted = (meeting.least_m * meeting.least_m - aside.length_squared())
            .max(0.0)
            .sqrt();
        self.direction * ((wanted - along).max(0.0) / meeting.share).min(FARTHEST_M)
    }
}

/// Offsets that grow and fade over [`AROUND_FRAMES`]. None is smaller than before, except at the
/// very start.
fn eased(ways: &[Vec3]) -> Vec<Vec3> {
    let near = |frame: usize, reach: usize| around(frame..frame + 1, reach, ways.len());
    let longer = |a: Vec3, b: Vec3| match b.length_squared() > a.length_squared() {
        true => b,
        false => a,
    };
    let longest = |frame: usize| {
        let all = ways[near(frame, AROUND_FRAMES)].iter().copied();
        all.fold(Vec3::ZERO, longer)
    };
    let mut eased: Vec<Vec3> = (0..ways.len()).map(longest).collect();
    for _ in 0..2 {
        let mean = |frame: usize| {
            let some = &eased[near(frame, AROUND_FRAMES / 2)];
            some.iter().sum::<Vec3>() / some.len() as f32
        };
        eased = (0..ways.len()).map(mean).collect();
    }
    for (frame, way) in eased.iter_mut().enumerate().take(LEAVE_FRAMES) {
        *way *= smoothstep((frame + 1) as f32 / (LEAVE_FRAMES + 1) as f32);
    }
    eased
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

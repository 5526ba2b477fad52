//! A limb of two bones.

use glam::{Quat, Vec3};

use crate::fk::{joint_transform, transforms_down_to};
use crate::interpolate::smoothstep;
use crate::robot::Robot;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

use super::hinges::{Goal, solve};
use super::limbs::longest;
use super::three;
use super::trunk::turn_in_world;

/// The straightest that a limb is made, as a share of its length: a little bend keeps the side of
/// the middle joint. A limb that was straighter may stay so.
pub(super) const STRAIGHTEST: f32 = 0.9995;
/// How much nearer the end joint may come than a folded limb brings it, metres.
const FOLDED_M: f32 = 1e-3;
/// A limb whose middle joint lies nearer to the line between its ends than this share of the
/// shorter bone is bent towards the pole, fading out up to here.
const NEARLY_STRAIGHT: f32 = 0.05;
/// Bones shorter than this are none, metres.
pub(super) const SHORTEST_BONE_M: f32 = 1e-4;
/// A goal as near as this is met already, metres.
const MET_M: f32 = 1e-6;

/// Bends a limb so that its end comes to a goal. Returns the remaining distance, metres (0 if it
/// reaches the goal).
///
/// `chain` is upper, middle and end joint, each a descendant of the one before; joints between them
/// move along. The middle joint keeps the side that it bends to, and the limb turns as little as
/// possible. A straight limb, or one that is nearly so, bends towards `pole`, a direction in the
/// world. `root` and `rotations` are one frame. The rotations of the upper and the middle joint
/// change. With `keep_end_rotation` so does that of the end joint, which then keeps its rotation in
/// the world. A goal that is already met changes nothing at all.
///
/// The limb becomes no straighter than 0.9995 of its length, unless it was, and comes no nearer
/// than 1 mm to its folded length. Returns infinity, and changes nothing, if the goal or the pose
/// is not finite, a bone has no length, or the joints are not a chain. Does not allocate.
///
/// A robot's limb bends by all its hinges from the upper joint down, within their limits. It needs
/// no pole: the hinges decide the direction.
pub fn two_bone(
    skeleton: &Skeleton,
    root: Vec3,
    rotations: &mut [Quat],
    chain: [usize; 3],
    goal: Vec3,
    pole: Vec3,
    keep_end_rotation: bool,
) -> f32 {
    two_bone_soft(
        skeleton,
        root,
        rotations,
        chain,
        (goal, 0.0),
        pole,
        keep_end_rotation,
    )
}

/// [`two_bone`] for a goal, with the share of the limb's length (less than 1) over which it eases
/// towards full reach. Otherwise the middle joint would move with the square root of the remaining
/// length, and jump when a goal comes into reach. In return the limb falls short of goals within
/// that share. A straighter limb eases over its remaining length.
pub fn two_bone_soft(
    skeleton: &Skeleton,
    root: Vec3,
    rotations: &mut [Quat],
    chain: [usize; 3],
    (goal, soft): (Vec3, f32),
    pole: Vec3,
    keep_end_rotation: bool,
) -> f32 {
    if rotations.len() < skeleton.joint_count() || !is_chain(skeleton, chain) {
        return f32::INFINITY;
    }
    let limb = Limb::of(skeleton, root, rotations, chain);
    let [upper, middle, end] = limb.joints;
    if let Some(robot) = &skeleton.robot {
        let rotation = keep_end_rotation.then_some(end.1);
        let of = (skeleton, robot);
        return bend_hinges(of, root, rotations, chain, &limb, (goal, soft), rotation);
    }
    let [above_upper, above_middle, above_end] = limb.above;
    let Some(bend) = bend(upper.0, middle.0, end.0, (goal, soft), pole) else {
        return f32::INFINITY;
    };
    let Some((turn_upper, turn_lower)) = bend.turns else {
        return bend.short_m;
    };
    let mut write = |joint: usize, above: Quat, world: Quat| {
        let local = (above.conjugate() * world).normalize();
        rotations[joint] = align_sign(local, rotations[joint]);
    };
    write(chain[0], above_upper, turn_upper * upper.1);
    write(chain[1], turn_upper * above_middle, turn_lower * middle.1);
    if keep_end_rotation {
        write(chain[2], turn_lower * above_end, end.1);
    }
    bend.short_m
}

/// Bends a limb as [`two_bone_soft`] does, and turns its end so that its world rotation is
/// `rotation`.
pub fn place_end(
    skeleton: &Skeleton,
    root: Vec3,
    rotations: &mut [Quat],
    chain: [usize; 3],
    (goal, soft): (Vec3, f32),
    pole: Vec3,
    rotation: Quat,
) -> f32 {
    if let Some(robot) = &skeleton.robot {
        if rotations.len() < skeleton.joint_count() || !is_chain(skeleton, chain) {
            return f32::INFINITY;
        }
        let limb = Limb::of(skeleton, root, rotations, chain);
        let (of, goal) = ((skeleton, robot), (goal, soft));
        return bend_hinges(of, root, rotations, chain, &limb, goal, Some(rotation));
    }
    let short = two_bone_soft(skeleton, root, rotations, chain, (goal, soft), pole, false);
    turn_in_world(skeleton, rotations, chain[2], rotation);
    short
}

/// Turns a whole limb at its root by `turn` in the world.
pub(crate) fn turn_limb(skeleton: &Skeleton, rotations: &mut [Quat], chain: [usize; 3], turn: Quat) {
    let [upper, middle, _] = chain;
    // The joint that has all the turns between the body and the upper bone.
    let bone = match (&skeleton.robot, skeleton.joints[middle].parent) {
        (Some(_), Some(above)) => above,
        _ => upper,
    };
    let turned = turn * joint_transform(skeleton, Vec3::ZERO, rotations, bone).1;
    match &skeleton.robot {
        None => turn_in_world(skeleton, rotations, upper, turned),
        Some(robot) => turn_hinges((skeleton, robot), rotations, (upper, bone), turned),
    }
}

/// Turns the hinges from one joint down to another so that its world rotation comes as near to
/// `rotation` as possible.
pub(crate) fn turn_hinges(
    of: (&Skeleton, &Robot),
    rotations: &mut [Quat],
    (top, end): (usize, usize),
    rotation: Quat,
) {
    // Joints that follow hinges need the search.
    if of.1.mimics().is_empty() && three::turn(of, rotations, (top, end), rotation) {
        return;
    }
    let goal = Goal {
        place: None,
        rotation: Some(rotation),
    };
    // Joints that are not a limb do not turn.
    let _ = solve(of, Vec3::ZERO, rotations, (top, end), &goal);
}

/// Bends a limb of hinges. Returns the remaining distance, metres.
fn bend_hinges(
    of: (&Skeleton, &Robot),
    root: Vec3,
    rotations: &mut [Quat],
    [top, knee, end]: [usize; 3],
    limb: &Limb,
    (goal, soft): (Vec3, f32),
    rotation: Option<Quat>,
) -> f32 {
    let [(upper, _), (middle, bent), (last, turned)] = limb.joints;
    let (first, second, to) = (middle - upper, last - middle, goal - upper);
    let (length_1, length_2) = (first.length(), second.length());
    if !to.is_finite() || length_1 < SHORTEST_BONE_M || length_2 < SHORTEST_BONE_M {
        return f32::INFINITY;
    }
    let keeps = rotation.is_none_or(|rotation| rotation == turned);
    if keeps && goal.distance(last) <= MET_M {
        return 0.0;
    }
    let most = match of.1.hinge_of(knee) {
        Some(hinge) => {
            let axis = bent * of.1.hinges()[hinge].axis;
            longest(first, second, axis)
        }
        None => length_1 + length_2,
    };
    let folded = (length_1 - length_2).abs();
    let reach = reach(to.length(), last.distance(upper), (folded, most), soft);
    let eased = upper + to.normalize_or_zero() * reach;
    let goals = Goal {
        place: Some(eased),
        rotation,
    };
    match solve(of, root, rotations, (top, end), &goals) {
        // The eased distance plus what the hinges lack, at most.
        Some(off) => off + eased.distance(goal),
        None => f32::INFINITY,
    }
}

/// Distance of a limb's end from its upper joint for a goal at `distance`. The limb reaches from
/// `folded` to `most`, and its end is at `now`.
fn reach(distance: f32, now: f32, (folded, most): (f32, f32), soft: f32) -> f32 {
    let straightest = (most * STRAIGHTEST).max(now);
    let folded = (folded + FOLDED_M).min(now);
    let eases = (most * (STRAIGHTEST - soft)).clamp(now.min(straightest), straightest);
    ease(distance, eases, straightest).max(folded)
}

/// Whether each joint is a descendant of the one before.
fn is_chain(skeleton: &Skeleton, chain: [usize; 3]) -> bool {
    chain[2] < skeleton.joint_count()
        && super::limbs::is_below(skeleton, chain[2], chain[1])
        && super::limbs::is_below(skeleton, chain[1], chain[0])
}

/// The state of a limb.
struct Limb {
    /// World positions and rotations of the upper, the middle and the end joint.
    joints: [(Vec3, Quat); 3],
    /// World rotations of their parents; the identity above joint 0.
    above: [Quat; 3],
}

impl Limb {
    fn of(skeleton: &Skeleton, root: Vec3, rotations: &[Quat], chain: [usize; 3]) -> Self {
        let mut limb = Self {
            joints: [(Vec3::ZERO, Quat::IDENTITY); 3],
            above: [Quat::IDENTITY; 3],
        };
        let mut turned = Quat::IDENTITY;
        let mut note = |joint, position, rotation| {
            if let Some(nth) = chain.iter().position(|&of_chain| of_chain == joint) {
                limb.joints[nth] = (position, rotation);
                limb.above[nth] = turned;
            }
            turned = rotation;
        };
        transforms_down_to(skeleton, root, rotations, chain[2], &mut note);
        limb
    }
}

/// The movement of a limb.
pub(crate) struct Bend {
    /// Remaining distance to the goal, metres.
    pub(crate) short_m: f32,
    /// Turns of the upper and the lower bone in the world. `None` if nothing has to move.
    pub(crate) turns: Option<(Quat, Quat)>,
}

/// The turns that bring `end` to `goal`, as for [`two_bone_soft`]. `None` if they cannot be
/// computed.
fn bend(upper: Vec3, middle: Vec3, end: Vec3, goal: (Vec3, f32), pole: Vec3) -> Option<Bend> {
    let side = |first, line, shorter_m| side_of(first, line, pole, shorter_m);
    bend_by([upper, middle, end], goal, &side)
}

/// As [`bend`]. `side` gives the side of the middle joint, by the first bone, the direction from
/// the upper joint to the end, and the length of the shorter bone.
pub(crate) fn bend_by(
    [upper, middle, end]: [Vec3; 3],
    (goal, soft): (Vec3, f32),
    side: &dyn Fn(Vec3, Vec3, f32) -> Vec3,
) -> Option<Bend> {
    let (first, second, along) = (middle - upper, end - middle, end - upper);
    let (length_1, length_2) = (first.length(), second.length());
    let finite = goal.is_finite() && upper.is_finite() && along.is_finite() && first.is_finite();
    if !finite || length_1 < SHORTEST_BONE_M || length_2 < SHORTEST_BONE_M {
        return None;
    }
    if goal.distance(end) <= MET_M {
        return Some(Bend {
            short_m: 0.0,
            turns: None,
        });
    }
    let to = goal - upper;
    let (distance, now) = (to.length(), along.length());
    if !distance.is_finite() {
        return None;
    }
    let reach = reach(
        distance,
        now,
        ((length_1 - length_2).abs(), length_1 + length_2),
        soft,
    );

    // The plane in which the limb bends, turned along with the line between its ends.
    let toward = to
        .try_normalize()
        .or(along.try_normalize())
        .unwrap_or(Vec3::NEG_Y);
    let line = if now > SHORTEST_BONE_M {
        along / now
    } else {
        toward
    };
    let side = side(first, line, length_1.min(length_2));
    let turn = arc(line, toward);
    let side = turn * side;
    let side = (side - toward * side.dot(toward))
        .try_normalize()
        .unwrap_or_else(|| toward.any_orthonormal_vector());

    let reach_or_hair = reach.max(SHORTEST_BONE_M);
    let cos = (length_1 * length_1 + reach * reach - length_2 * length_2) / (2.0 * length_1 * reach_or_hair);
    let cos = cos.clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let new_first = (toward * cos + side * sin) * length_1;
    let new_second = toward * reach - new_first;
    let swing = |bone: Vec3, new: Vec3| match (bone.try_normalize(), new.try_normalize()) {
        (Some(bone), Some(new)) => arc(turn * bone, new) * turn,
        _ => turn,
    };
    Some(Bend {
        short_m: (distance - reach).abs(),
        turns: Some((swing(first, new_first), swing(second, new_second))),
    })
}

/// `distance` up to `from`; beyond, it approaches `to` without reaching it, continuous in value and
/// slope.
fn ease(distance: f32, from: f32, to: f32) -> f32 {
    let (over, room) = (distance - from, to - from);
    if over <= 0.0 || room <= 0.0 {
        return distance.min(to);
    }
    from + room * (1.0 - (-over / room).exp())
}

/// The side of `line` on which the middle joint lies, unit length. If it hardly lies on one, the
/// pole's side.
pub(crate) fn side_of(first: Vec3, line: Vec3, pole: Vec3, shorter_m: f32) -> Vec3 {
    let across = |v: Vec3| v - line * v.dot(line);
    let side = across(first);
    let flat = NEARLY_STRAIGHT * shorter_m;
    let weight = 1.0 - smoothstep((side.length() / flat).min(1.0));
    let pole = across(pole).try_normalize().unwrap_or(Vec3::ZERO);
    (side + pole * (flat * weight))
        .try_normalize()
        .unwrap_or_else(|| line.any_orthonormal_vector())
}

/// The shortest turn between two directions of unit length. Precise for small angles, unlike
/// [`Quat::from_rotation_arc`], which ignores less than 0.7 mrad.
fn arc(from: Vec3, to: Vec3) -> Quat {
    let cross = from.cross(to);
    let w = 1.0 + from.dot(to);
    if w < 1e-6 {
        // Half a turn, about any perpendicular axis.
        let axis = from.any_orthonormal_vector();
        return Quat::from_xyzw(axis.x, axis.y, axis.z, 0.0);
    }
    Quat::from_xyzw(cross.x, cross.y, cross.z, w).normalize()
}

#[cfg(test)]
mod tests {
    use super::ease;

    #[test]
    fn easing_is_smooth_and_stays_in_reach() {
        let at = |d: f32| ease(d, 0.98, 0.9995);
        assert_eq!(at(0.7), 0.7);
        let steps: Vec<f32> = (0..200).map(|n| at(0.9 + 0.001 * n as f32)).collect();
        assert!(
            steps
                .windows(2)
                .all(|w| w[1] >= w[0] && w[1] - w[0] < 0.001 + 1e-6)
        );
        let bends = steps.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).abs());
        assert!(bends.fold(0.0, f32::max) < 6e-5, "no corner, which would be 1e-3");
        assert!(steps.iter().all(|&s| s <= 0.9995) && steps[199] > 0.999);
        assert_eq!(ease(2.0, 0.9995, 0.9995), 0.9995);
    }
}

//! A limb of two bones.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::interpolate::smoothstep;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

/// The straightest that a limb is made, as a share of its length: a little bend keeps the side of the middle joint. A limb
/// that was straighter may stay so.
pub(super) const STRAIGHTEST: f32 = 0.9995;
/// How much nearer the end joint may come than a folded limb brings it, metres.
const FOLDED_M: f32 = 1e-3;
/// A limb whose middle joint lies nearer to the line between its ends than this share of the shorter bone is bent towards
/// the pole, fading out up to here.
const NEARLY_STRAIGHT: f32 = 0.05;
/// Bones shorter than this are none, metres.
pub(super) const SHORTEST_BONE_M: f32 = 1e-4;
/// A goal as near as this is met already, metres.
const MET_M: f32 = 1e-6;

/// Bends a limb so that its end comes to a goal; answers how far it falls short, metres (0 where it reaches).
///
/// `chain` is upper, middle and end joint, each somewhere below the one before it; joints between them move along. The
/// limb keeps the side that its middle joint bends to and turns as little as it can; where it is straight, or nearly so, it
/// bends towards `pole`, a direction in the world. `root` and `rotations` are one frame, whose rotations of the upper and
/// the middle joint change and, with `keep_end_rotation`, that of the end joint, which then keeps its rotation in the
/// world. A goal that is met already changes nothing at all.
///
/// The limb becomes no straighter than 0.9995 of its length unless it was, and comes no nearer than 1 mm to its folded
/// length. Infinity comes back, and nothing changes, where the goal or the pose is not finite, a bone has no length, or the
/// joints are no chain. Does not allocate.
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

/// [`two_bone`] for a goal with the share of its length, less than 1, over which the limb eases towards its reach. At once,
/// the middle joint would move with the square root of what is left to it: a goal that comes into reach makes it jump. In
/// return the limb falls short of goals within that share. One that was straighter eases over what is left to it.
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
    let [upper, middle, end] = chain.map(|joint| joint_transform(skeleton, root, rotations, joint));
    let [above_upper, above_middle, above_end] = chain.map(|joint| match skeleton.joints[joint].parent {
        Some(parent) => joint_transform(skeleton, root, rotations, parent).1,
        None => Quat::IDENTITY,
    });
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

/// Each joint is below the one before it.
fn is_chain(skeleton: &Skeleton, chain: [usize; 3]) -> bool {
    chain[2] < skeleton.joint_count()
        && super::limbs::is_below(skeleton, chain[2], chain[1])
        && super::limbs::is_below(skeleton, chain[1], chain[0])
}

/// What a limb must do.
struct Bend {
    /// How far it falls short, metres.
    short_m: f32,
    /// Turns of the upper and the lower bone in the world; `None` where nothing is to be done.
    turns: Option<(Quat, Quat)>,
}

/// The turns that bring `end` to `goal`; `None` where that cannot be told.
fn bend(upper: Vec3, middle: Vec3, end: Vec3, (goal, soft): (Vec3, f32), pole: Vec3) -> Option<Bend> {
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
    let straightest = ((length_1 + length_2) * STRAIGHTEST).max(now);
    let folded = ((length_1 - length_2).abs() + FOLDED_M).min(now);
    let eases = ((length_1 + length_2) * (STRAIGHTEST - soft)).clamp(now.min(straightest), straightest);
    let reach = ease(distance, eases, straightest).max(folded);

    // The plane that the limb bends in, turned along with the line between its ends.
    let toward = to
        .try_normalize()
        .or(along.try_normalize())
        .unwrap_or(Vec3::NEG_Y);
    let line = if now > SHORTEST_BONE_M {
        along / now
    } else {
        toward
    };
    let side = side_of(first, line, pole, length_1.min(length_2));
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

/// `distance` up to `from`, then on towards `to` without coming there, continuous in value and slope.
fn ease(distance: f32, from: f32, to: f32) -> f32 {
    let (over, room) = (distance - from, to - from);
    if over <= 0.0 || room <= 0.0 {
        return distance.min(to);
    }
    from + room * (1.0 - (-over / room).exp())
}

/// The side of `line` that the middle joint lies on, unit length; where it hardly lies on one, that of the pole.
fn side_of(first: Vec3, line: Vec3, pole: Vec3, shorter_m: f32) -> Vec3 {
    let across = |v: Vec3| v - line * v.dot(line);
    let side = across(first);
    let flat = NEARLY_STRAIGHT * shorter_m;
    let weight = 1.0 - smoothstep((side.length() / flat).min(1.0));
    let pole = across(pole).try_normalize().unwrap_or(Vec3::ZERO);
    (side + pole * (flat * weight))
        .try_normalize()
        .unwrap_or_else(|| line.any_orthonormal_vector())
}

/// The shortest turn from one direction to another, both of unit length. Precise for small angles, unlike
/// [`Quat::from_rotation_arc`], which takes less than 0.7 mrad for none.
fn arc(from: Vec3, to: Vec3) -> Quat {
    let cross = from.cross(to);
    let w = 1.0 + from.dot(to);
    if w < 1e-6 {
        // Half a turn, about any axis across.
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

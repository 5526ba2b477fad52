//! Three hinges in a row, as robots' hips, shoulders, wrists and waists have: their angles for a
//! rotation, without a search.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::robot::Robot;
use crate::root::wrap_angle;
use crate::rotation::align_sign;
use crate::skeleton::Skeleton;

/// The last axis is this far from the first one, as the sine of the angle between: nearer, the two
/// turn about the same line, and their angles are left to a search.
const LEAST_APART: f32 = 0.01;

/// Turns the hinges from `top` to `end` so that `end` has a world rotation. Of the two ways it
/// takes the one that turns them least. Returns false, and changes nothing, if they are not three
/// hinges in a row, or cannot turn that way within their limits. Joints that follow hinges are not
/// turned.
pub(super) fn turn(
    (skeleton, robot): (&Skeleton, &Robot),
    rotations: &mut [Quat],
    (top, end): (usize, usize),
    rotation: Quat,
) -> bool {
    let parent = |joint: usize| skeleton.joints[joint].parent;
    let Some(middle) = parent(end).filter(|&middle| parent(middle) == Some(top)) else {
        return false;
    };
    let joints = [top, middle, end];
    let (Some(above), [Some(first), Some(second), Some(third)]) =
        (parent(top), joints.map(|joint| robot.hinge_of(joint)))
    else {
        return false;
    };
    let hinges = [first, second, third].map(|hinge| &robot.hinges()[hinge]);
    let (_, above) = joint_transform(skeleton, Vec3::ZERO, rotations, above);
    // All turns as rotations about axes in the frame of reference above.
    let mut rest = Quat::IDENTITY;
    let axes = hinges.map(|hinge| {
        rest *= hinge.rest;
        rest * hinge.axis
    });
    let turn = (above.conjugate() * rotation * rest.conjugate()).normalize();
    let now = [0, 1, 2].map(|nth: usize| hinges[nth].angle_of(rotations[joints[nth]]));
    let mut best: Option<(f32, [f32; 3])> = None;
    for angles in ways(axes, turn).into_iter().flatten() {
        let nearest = |nth: usize| {
            let middle = 0.5 * (hinges[nth].lower_rad + hinges[nth].upper_rad);
            middle + wrap_angle(angles[nth] - middle)
        };
        let angles = [0, 1, 2].map(nearest);
        let fits = |nth: usize| hinges[nth].limited(angles[nth]) == angles[nth];
        let far: f32 = (0..3).map(|nth| (angles[nth] - now[nth]).powi(2)).sum();
        if (0..3).all(fits) && best.is_none_or(|(least, _)| far < least) {
            best = Some((far, angles));
        }
    }
    let Some((_, angles)) = best else {
        return false;
    };
    for (nth, &joint) in joints.iter().enumerate() {
        rotations[joint] = align_sign(hinges[nth].rotation(angles[nth]), rotations[joint]);
    }
    true
}

/// The two ways to make a turn of turns about three axes, one after another in each other's frame
/// of reference. None that does not exist, or whose first and last axis would lie on a line.
fn ways([first, second, third]: [Vec3; 3], turn: Quat) -> [Option<[f32; 3]>; 2] {
    // The last turn keeps its axis, so the first two have to bring it to where it ends. Its height
    // along the first axis depends on the second turn alone: still + level * cos + beside * sin.
    let to = turn * third;
    let still = first.dot(second) * second.dot(third);
    let (level, beside) = (first.dot(third) - still, first.dot(second.cross(third)));
    let cos = (first.dot(to) - still) / level.hypot(beside);
    if cos.is_nan() || cos.abs() > 1.0 {
        return [None; 2];
    }
    let (middle, aside) = (beside.atan2(level), cos.acos());
    [middle + aside, middle - aside].map(|of_second| {
        let from = Quat::from_axis_angle(second, of_second) * third;
        let [from, to] = [from, to].map(|axis| axis.reject_from_normalized(first));
        if from.length() < LEAST_APART || to.length() < LEAST_APART {
            return None;
        }
        let of_first = first.dot(from.cross(to)).atan2(from.dot(to));
        let both = Quat::from_axis_angle(first, of_first) * Quat::from_axis_angle(second, of_second);
        let last = both.conjugate() * turn;
        Some([of_first, of_second, 2.0 * last.xyz().dot(third).atan2(last.w)])
    })
}

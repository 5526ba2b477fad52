//! One frame of a G1 as MuJoCo's `qpos`: x y z, w x y z, then the hinges' angles.

use glam::Quat;
use troupe_motion::robot::{ROOT_QPOS, Robot};
use troupe_motion::rotation::{align_sign, from_wxyz, to_wxyz};

use crate::error::SonicError;
use crate::wire::{HINGES, ISAAC};

/// A frame. Positions in metres, angles in radians, X forward, Y left, Z up.
pub type Row = [f32; ROOT_QPOS + HINGES];

/// Checks that a robot is a G1 with hinges in MuJoCo's order.
///
/// # Errors
/// [`SonicError::NoG1`] if it is not.
pub(crate) fn check_robot<'a>(pack: &str, robot: Option<&'a Robot>) -> Result<&'a Robot, SonicError> {
    robot
        .filter(|robot| robot.breadth_first() == ISAAC)
        .ok_or_else(|| SonicError::NoG1(pack.to_owned()))
}

/// Rotation of the pelvis.
pub(crate) fn turn(row: &Row) -> Quat {
    from_wxyz([row[3], row[4], row[5], row[6]])
}

fn set_turn(row: &mut Row, turn: Quat) {
    row[3..ROOT_QPOS].copy_from_slice(&to_wxyz(turn));
}

/// The rotation about Z alone, radians.
fn yaw(turn: Quat) -> f32 {
    let [x, y, z, w] = turn.to_array();
    (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))
}

/// A frame between two, `share` of the way to the second.
pub(crate) fn mix(from: &Row, to: &Row, share: f32) -> Row {
    let mut out: Row = std::array::from_fn(|nth| from[nth] + (to[nth] - from[nth]) * share);
    let (a, b) = (turn(from), turn(to));
    set_turn(
        &mut out,
        (a * (1.0 - share) + align_sign(b, a) * share).normalize(),
    );
    out
}

/// The frame after two that follow each other, while they slow down.
pub(crate) fn onward(before: &Row, last: &Row, limits: &[(f32, f32)]) -> Row {
    /// Speed that is left after a frame.
    const KEPT: f32 = 0.8;
    let mut out: Row = std::array::from_fn(|nth| last[nth] + KEPT * (last[nth] - before[nth]));
    for (angle, &(lower, upper)) in out[ROOT_QPOS..].iter_mut().zip(limits) {
        *angle = angle.clamp(lower, upper);
    }
    let (a, b) = (turn(before), turn(last));
    set_turn(&mut out, (b + (b - align_sign(a, b)) * KEPT).normalize());
    out
}

/// A frame without its place on the ground and its heading.
pub(crate) fn upright(row: &Row) -> Row {
    let mut out = *row;
    (out[0], out[1]) = (0.0, 0.0);
    let turn = turn(row);
    set_turn(&mut out, Quat::from_rotation_z(-yaw(turn)) * turn);
    out
}

/// The upright frame with place and heading of another.
pub(crate) fn standing_at(stand: &Row, row: &Row) -> Row {
    let mut out = *stand;
    (out[0], out[1]) = (row[0], row[1]);
    set_turn(&mut out, Quat::from_rotation_z(yaw(turn(row))) * turn(stand));
    out
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A frame that is turned by `yaw` and bends all hinges by `angle`.
    pub(crate) fn row(x: f32, yaw: f32, angle: f32) -> Row {
        let mut row = [angle; ROOT_QPOS + HINGES];
        row[..3].copy_from_slice(&[x, 0.0, 0.8]);
        set_turn(&mut row, Quat::from_rotation_z(yaw) * Quat::from_rotation_y(0.1));
        row
    }

    #[test]
    fn a_stand_takes_the_heading_and_leaves_the_tilt() {
        let stand = upright(&row(3.0, 2.0, 0.1));
        assert!(yaw(turn(&stand)).abs() < 1e-6 && stand[0] == 0.0);
        let there = standing_at(&stand, &row(5.0, -1.0, 0.7));
        assert!(turn(&there).abs_diff_eq(turn(&row(5.0, -1.0, 0.1)), 1e-6));
        assert_eq!((there[0], there[7]), (5.0, 0.1));
    }

    #[test]
    fn a_mix_goes_the_short_way_round() {
        let (a, mut b) = (row(0.0, 3.0, 0.0), row(1.0, -3.0, 1.0));
        b[3..7].iter_mut().for_each(|number| *number = -*number);
        let half = mix(&a, &b, 0.5);
        assert!(yaw(turn(&half)).abs() > 3.1, "{}", yaw(turn(&half)));
        assert_eq!((half[0], half[7]), (0.5, 0.5));
        assert!((turn(&half).length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_guess_slows_down_within_limits() {
        let limits = [(-1.0, 0.25); HINGES];
        let (mut before, mut last) = (row(0.0, 0.0, 0.1), row(0.1, 0.1, 0.2));
        for _ in 0..60 {
            (before, last) = (last, onward(&before, &last, &limits));
        }
        assert_eq!(last[7], 0.25);
        assert!((last[0] - 0.5).abs() < 0.01, "{}", last[0]);
        assert!((yaw(turn(&last)) - 0.5).abs() < 0.02, "{}", yaw(turn(&last)));
    }
}

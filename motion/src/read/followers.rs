//! Columns of joints that follow hinges: MuJoCo's `qpos` has them, a robot's hinges do not.

use super::options::{JointOrder, Options};
use super::report::{Report, Topic};
use super::robot::ROOT;
use crate::robot::{Mimic, Robot};
use crate::skeleton::Skeleton;

/// Farthest that a follower's number may be from what it follows without a note, radians.
const TOLERANCE_RAD: f64 = 0.01;

/// Takes the followers' columns out of rows of all joints that turn, in the order of the joints.
/// Returns how far each follower is from what it follows at most, radians; nothing if the rows have
/// another number of columns, or the hinges another order.
pub(super) fn take_out(
    numbers: &mut Vec<f64>,
    columns: usize,
    robot: &Robot,
    options: &Options,
) -> Option<Vec<f64>> {
    let (hinges, mimics) = (robot.hinges(), robot.mimics());
    let is_tree = options
        .joint_order
        .as_ref()
        .is_none_or(|order| *order == JointOrder::Tree);
    let in_tree = hinges.is_sorted_by_key(|hinge| hinge.joint);
    if mimics.is_empty() || !is_tree || !in_tree || columns != ROOT + hinges.len() + mimics.len() {
        return None;
    }
    let mut followers: Vec<usize> = (0..mimics.len()).collect();
    followers.sort_by_key(|&nth| mimics[nth].joint);
    // The column of a joint is behind the root and all joints before it.
    let column = |joint: usize| {
        let hinges = hinges.iter().filter(|hinge| hinge.joint < joint).count();
        ROOT + hinges + mimics.iter().filter(|mimic| mimic.joint < joint).count()
    };
    let columns_of: Vec<usize> = followers.iter().map(|&nth| column(mimics[nth].joint)).collect();
    let followed: Vec<usize> = mimics
        .iter()
        .map(|mimic| column(hinges[mimic.hinge].joint))
        .collect();
    let mut far_rad = vec![0.0_f64; mimics.len()];
    let mut kept = Vec::with_capacity(numbers.len());
    for row in numbers.chunks_exact(columns) {
        for (&nth, &at) in followers.iter().zip(&columns_of) {
            let Mimic {
                multiplier,
                offset_rad,
                ..
            } = mimics[nth];
            let expected = f64::from(multiplier) * row[followed[nth]] + f64::from(offset_rad);
            far_rad[nth] = far_rad[nth].max((row[at] - expected).abs());
        }
        kept.extend(
            (0..columns)
                .filter(|at| !columns_of.contains(at))
                .map(|at| row[at]),
        );
    }
    *numbers = kept;
    Some(far_rad)
}

/// Notes followers whose numbers are not those of what they follow.
pub(super) fn note(far_rad: &[f64], robot: &Robot, skeleton: &Skeleton, report: &mut Report) {
    let far = robot.mimics().iter().zip(far_rad);
    let (mimic, far_rad) = match far.max_by(|a, b| a.1.total_cmp(b.1)) {
        Some((mimic, far_rad)) if *far_rad > TOLERANCE_RAD => (mimic, far_rad),
        _ => return,
    };
    let text = format!(
        "joint {:?} follows {:?}, but its numbers are up to {far_rad:.2} rad from that; it is read as following",
        skeleton.joints[mimic.joint].name,
        skeleton.joints[robot.hinges()[mimic.hinge].joint].name
    );
    report.odd(Topic::Angles, text);
}

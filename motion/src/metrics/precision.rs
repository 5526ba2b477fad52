//! Precision: how closely keyframes and the target root are met.

use std::ops::Range;

use super::{MetricError, check_pair};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::root::wrap_angle;

/// Largest distance at which the target root counts as reached, metres.
pub const REACH_DISTANCE_M: f32 = 0.05;
/// Largest difference at which the target heading counts as reached, radians (15°).
pub const REACH_ANGLE_RAD: f32 = 15.0 * std::f32::consts::PI / 180.0;

/// Largest joint position error over the frames of `range`, metres. (The paper takes the largest
/// instead of the mean, because that is what viewers see.)
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn keyframe_error_m(
    motion: &WorldMotion,
    truth: &WorldMotion,
    range: Range<usize>,
) -> Result<f64, MetricError> {
    check_pair(motion, truth, &range)?;
    let largest = range
        .flat_map(|f| motion.positions_at(f).iter().zip(truth.positions_at(f)))
        .map(|(a, b)| a.distance(*b))
        .fold(0.0f32, nan_max);
    Ok(f64::from(largest))
}

/// Largest distance (in 3D: ground plane and height) of the root from ground truth over the frames
/// of `range`, metres.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn root_error_m(
    motion: &WorldMotion,
    truth: &WorldMotion,
    range: Range<usize>,
) -> Result<f64, MetricError> {
    check_pair(motion, truth, &range)?;
    let largest = range
        .map(|f| motion.positions_at(f)[0].distance(truth.positions_at(f)[0]))
        .fold(0.0f32, nan_max);
    Ok(f64::from(largest))
}

/// Whether `frame`'s root is within [`REACH_DISTANCE_M`] and [`REACH_ANGLE_RAD`] of ground truth's.
///
/// # Panics
/// If `frame` is out of either clip's range.
pub fn reached(clip: &Clip, truth: &Clip, frame: usize) -> bool {
    let (a, b) = (clip.root_at(frame), truth.root_at(frame));
    a.position.distance(b.position) <= REACH_DISTANCE_M
        && wrap_angle(a.heading - b.heading).abs() <= REACH_ANGLE_RAD
}

/// The larger, or NaN if either is: a broken frame must not look perfect.
fn nan_max(a: f32, b: f32) -> f32 {
    if a.is_nan() || a > b { a } else { b }
}

//! Distance from ground truth: L2P and L2Q.

use std::ops::Range;

use super::{MetricError, check_pair, mean};
use crate::fk::WorldMotion;
use crate::rotation::align_sign;

/// L2P: mean over the frames of `range` of the L2 norm of the frame's whole vector of joint
/// positions, `sqrt(Σ_joints |p - p_gt|²)`, metres.
///
/// It is LaFAN1's measure without the normalisation of positions by the training set's mean and
/// deviation. So its figures compare only with others of this measure.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn l2p_m(motion: &WorldMotion, truth: &WorldMotion, range: Range<usize>) -> Result<f64, MetricError> {
    check_pair(motion, truth, &range)?;
    Ok(mean(range.map(|f| {
        let pairs = motion.positions_at(f).iter().zip(truth.positions_at(f));
        pairs
            .map(|(a, b)| f64::from(a.distance_squared(*b)))
            .sum::<f64>()
            .sqrt()
    })))
}

/// L2Q: mean over the frames of `range` of `sqrt(Σ_joints |q - q_gt|²)` on world quaternions, each
/// with the sign nearer to ground truth.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit.
pub fn l2q(motion: &WorldMotion, truth: &WorldMotion, range: Range<usize>) -> Result<f64, MetricError> {
    check_pair(motion, truth, &range)?;
    Ok(mean(range.map(|f| {
        let pairs = motion.rotations_at(f).iter().zip(truth.rotations_at(f));
        pairs
            .map(|(&a, &b)| f64::from((align_sign(a, b) - b).length_squared()))
            .sum::<f64>()
            .sqrt()
    })))
}

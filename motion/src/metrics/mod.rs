//! Measures of generated motion against ground truth (MotionBricks, section 7.2; L2P, L2Q and NPSS
//! as in LaFAN1, Harvey et al. 2020).
//!
//! All of them use world transforms from forward kinematics ([`WorldMotion`]). [`evaluate`]
//! measures one in-betweening task, and [`Summary`] gathers many. [`Resamples`] says how reliable
//! the means are. How similar two sets of motions are as a whole, FID and MMD, is measured in the
//! latent space of a motion autoencoder (feature `distribution`).

mod accuracy;
#[cfg(feature = "distribution")]
mod distribution;
mod diversity;
mod limbs;
mod npss;
mod physical;
mod precision;
mod resample;
mod summary;

pub use accuracy::{l2p_m, l2q};
#[cfg(feature = "distribution")]
pub use distribution::{Gaussian, Latents, MMD_SCALE, MMD_SIGMA, Mmd};
pub use diversity::{joint_distance_m, joint_diversity_m, mean_pairwise_distance};
pub use limbs::{LimbDistances, Limbs, ROOT_ACCELERATION_REACH, root_accelerations_mps2};
pub use npss::{Npss, npss};
pub use physical::{
    contact_accuracy, contact_prediction_accuracy, foot_skate_m_per_frame,
    joint_acceleration_percentile_mps2, joint_accelerations_mps2, joint_jitter_mps2, penetration_m,
    percentile, root_jitter_mps2,
};
pub use precision::{REACH_ANGLE_RAD, REACH_DISTANCE_M, keyframe_error_m, reached, root_error_m};
pub use resample::{Estimate, Resamples};
pub use summary::{Evaluation, Figures, Summary, Task, evaluate};

use std::ops::Range;

use crate::fk::WorldMotion;

/// Why motions cannot be measured against each other.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// The motions differ in joints or frames, or in rate.
    #[error("the motions differ in {0}")]
    Shape(&'static str),
    /// There are no frames to measure.
    #[error("frames {start}..{end} are empty or not in a motion of {frames} frames")]
    Range {
        /// First frame.
        start: usize,
        /// One past the last.
        end: usize,
        /// Number of frames.
        frames: usize,
    },
    /// Contacts are measured, but the skeleton has no contact joints.
    #[error("the skeleton has no contact joints")]
    NoContacts,
    /// Diversity needs at least two takes.
    #[error("diversity is measured over two takes or more, not {0}")]
    Takes(usize),
}

/// Checks that `range` is in a motion.
fn check_range(motion: &WorldMotion, range: &Range<usize>) -> Result<(), MetricError> {
    if range.is_empty() || range.end > motion.frames() {
        return Err(MetricError::Range {
            start: range.start,
            end: range.end,
            frames: motion.frames(),
        });
    }
    Ok(())
}

/// Checks that both motions have the same joints and frames, and that `range` is in them.
fn check_pair(a: &WorldMotion, b: &WorldMotion, range: &Range<usize>) -> Result<(), MetricError> {
    if a.joints != b.joints {
        return Err(MetricError::Shape("joints"));
    }
    if a.frames() != b.frames() {
        return Err(MetricError::Shape("frames"));
    }
    check_range(a, range)
}

/// The mean; 0 without values.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u64), |(sum, count), v| (sum + v, count + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

#[cfg(test)]
mod tests;

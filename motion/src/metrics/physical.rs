//! Physical plausibility and smoothness: skating, penetration, contacts, jitter.

use std::ops::Range;

use glam::Vec3;

use super::{MetricError, check_pair, check_range, mean};
use crate::contacts;
use crate::fk::WorldMotion;
use crate::skeleton::{ContactParams, Skeleton};

/// Height over the clearance from which skating does not count, metres (Zhang et al. 2018).
const SKATE_HEIGHT_M: f32 = 0.025;
/// Depth of a joint below its clearance that does not yet count as penetration, metres.
const PENETRATION_TOLERANCE_M: f32 = 0.005;

fn contacts_of(skeleton: &Skeleton) -> Result<&ContactParams, MetricError> {
    skeleton
        .contacts
        .as_ref()
        .filter(|c| !c.is_empty())
        .ok_or(MetricError::NoContacts)
}

/// Foot skate: mean horizontal distance since the frame before, over the frames of `range` and the
/// contact joints, weighted by `clamp(2 - 2^(h / 0.025), 0, 1)`, h the height over the joint's
/// clearance. Metres a frame.
///
/// Frame 0 has no frame before it, and does not count.
///
/// # Errors
/// [`MetricError`] if the range does not fit or the skeleton has no contact joints.
pub fn foot_skate_m_per_frame(
    skeleton: &Skeleton,
    motion: &WorldMotion,
    range: Range<usize>,
) -> Result<f64, MetricError> {
    check_range(motion, &range)?;
    let params = contacts_of(skeleton)?;
    Ok(mean(range.filter(|&f| f > 0).flat_map(|f| {
        let (now, before) = (motion.positions_at(f), motion.positions_at(f - 1));
        params
            .joints
            .iter()
            .zip(&params.clearance_m)
            .map(move |(&joint, &clearance)| {
                let step = (now[joint] - before[joint]) * Vec3::new(1.0, 0.0, 1.0);
                let height = now[joint].y - skeleton.ground_y_m - clearance;
                let weight = (2.0 - (height / SKATE_HEIGHT_M).exp2()).clamp(0.0, 1.0);
                f64::from(step.length() * weight)
            })
    })))
}

/// Penetration: mean over the frames of `range` and the contact joints of
/// `max(0, clearance - 5 mm - height)`, metres.
///
/// # Errors
/// [`MetricError`] if the range does not fit or the skeleton has no contact joints.
pub fn penetration_m(
    skeleton: &Skeleton,
    motion: &WorldMotion,
    range: Range<usize>,
) -> Result<f64, MetricError> {
    check_range(motion, &range)?;
    let params = contacts_of(skeleton)?;
    Ok(mean(range.flat_map(|f| {
        let now = motion.positions_at(f);
        params
            .joints
            .iter()
            .zip(&params.clearance_m)
            .map(move |(&joint, &clearance)| {
                let height = now[joint].y - skeleton.ground_y_m;
                f64::from((clearance - PENETRATION_TOLERANCE_M - height).max(0.0))
            })
    })))
}

/// Contact accuracy: share (0 to 1) of the frames of `range` and contact joints in which the
/// contact computed from the motion ([`contacts::detect`]) equals that of ground truth.
///
/// # Errors
/// [`MetricError`] if the motions or the range do not fit or the skeleton has no contact joints.
pub fn contact_accuracy(
    skeleton: &Skeleton,
    motion: &WorldMotion,
    truth: &WorldMotion,
    range: Range<usize>,
    fps: f32,
) -> Result<f64, MetricError> {
    check_pair(motion, truth, &range)?;
    let params = contacts_of(skeleton)?;
    let [found, wanted] = [motion, truth].map(|m| contacts::detect(m, params, skeleton.ground_y_m, fps));
    let at = range.start * params.len()..range.end * params.len();
    let pairs = found[at.clone()].iter().zip(&wanted[at]);
    Ok(mean(pairs.map(|(a, b)| f64::from(u8::from(a == b)))))
}

/// Accuracy of contacts that a network predicts: share (0 to 1) of the frames of `range` and
/// contact joints in which `said` equals the contact computed from ground truth's motion
/// ([`contacts::detect`]). `said` has one number for each frame and contact joint, from 0 to 1; a
/// contact begins at one half.
///
/// # Errors
/// [`MetricError`] if the numbers or the range do not fit or the skeleton has no contact joints.
pub fn contact_prediction_accuracy(
    skeleton: &Skeleton,
    said: &[f32],
    truth: &WorldMotion,
    range: Range<usize>,
    fps: f32,
) -> Result<f64, MetricError> {
    check_range(truth, &range)?;
    let params = contacts_of(skeleton)?;
    if said.len() != truth.frames() * params.len() {
        return Err(MetricError::Shape("contacts"));
    }
    let wanted = contacts::detect(truth, params, skeleton.ground_y_m, fps);
    let at = range.start * params.len()..range.end * params.len();
    let pairs = said[at.clone()].iter().zip(&wanted[at]);
    Ok(mean(pairs.map(|(&a, &b)| f64::from(u8::from((a >= 0.5) == b)))))
}

/// Joint jitter: mean over the frames of `range` and all joints of the acceleration's magnitude
/// `|p[t+1] - 2 p[t] + p[t-1]| * fps²`, m/s².
///
/// The neighbours of the range's ends lie outside it, so a jump at the seam counts. The motion's
/// own first and last frame do not count.
///
/// # Errors
/// [`MetricError`] if the range does not fit.
pub fn joint_jitter_mps2(motion: &WorldMotion, range: Range<usize>, fps: f32) -> Result<f64, MetricError> {
    jitter(motion, range, fps, 0..motion.joints)
}

/// Root jitter: [`joint_jitter_mps2`] of joint 0 only.
///
/// # Errors
/// [`MetricError`] if the range does not fit.
pub fn root_jitter_mps2(motion: &WorldMotion, range: Range<usize>, fps: f32) -> Result<f64, MetricError> {
    jitter(motion, range, fps, 0..1)
}

/// Joint accelerations: `|p[t+1] - 2 p[t] + p[t-1]| * fps²` of every joint in the frames of
/// `range`, m/s², frame by frame. Neighbours count as in [`joint_jitter_mps2`], whose values these
/// are. Those of several motions may be gathered for [`percentile`].
///
/// # Errors
/// [`MetricError`] if the range does not fit.
pub fn joint_accelerations_mps2(
    motion: &WorldMotion,
    range: Range<usize>,
    fps: f32,
) -> Result<Vec<f64>, MetricError> {
    check_range(motion, &range)?;
    Ok(accelerations(motion, range, fps, 0..motion.joints).collect())
}

/// The value below which this share of all joint accelerations ([`joint_accelerations_mps2`]) lies,
/// m/s². 0.999 is the 99.9th percentile, which a pop at a seam raises. 0 if the range has no frame
/// with two neighbours.
///
/// # Errors
/// [`MetricError`] if the range does not fit.
pub fn joint_acceleration_percentile_mps2(
    motion: &WorldMotion,
    range: Range<usize>,
    fps: f32,
    share: f64,
) -> Result<f64, MetricError> {
    let values = joint_accelerations_mps2(motion, range, fps)?;
    Ok(percentile(values, share).unwrap_or(0.0))
}

/// The value below which this share (0 to 1) of `values` lies, interpolated between the two
/// nearest. `None` without values.
pub fn percentile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let place = share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64;
    let (below, above) = (values[place.floor() as usize], values[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}

fn jitter(
    motion: &WorldMotion,
    range: Range<usize>,
    fps: f32,
    joints: Range<usize>,
) -> Result<f64, MetricError> {
    check_range(motion, &range)?;
    Ok(mean(accelerations(motion, range, fps, joints)))
}

/// Accelerations of some joints, frame by frame, for frames with two neighbours.
fn accelerations(
    motion: &WorldMotion,
    range: Range<usize>,
    fps: f32,
    joints: Range<usize>,
) -> impl Iterator<Item = f64> {
    let last = motion.frames() - 1;
    range.filter(move |&f| f > 0 && f < last).flat_map(move |f| {
        let at = |f| motion.positions_at(f);
        let (before, now, after) = (at(f - 1), at(f), at(f + 1));
        joints
            .clone()
            .map(move |j| f64::from((after[j] - 2.0 * now[j] + before[j]).length() * fps * fps))
    })
}

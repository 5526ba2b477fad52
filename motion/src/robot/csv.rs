//! Writes motion of a robot as Unitree publishes it: CSV without a header, a frame a row. First
//! come the root's `x y z` (metres) and `qx qy qz qw`, in ROS axes, then the hinges' angles in
//! their order, radians. The file has no frame rate.

use std::fmt::Write as _;

use glam::Quat;

use super::Fitted;
use crate::clip::{Clip, ClipError};
use crate::conventions::Convention;
use crate::rotation::align_sign;

/// Why a robot's motion was not written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// The skeleton has no hinges.
    #[error("the skeleton is no robot's: it has no hinges that columns could be angles of")]
    NoRobot,
    /// The resampled frames make no clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

/// Writes a clip as CSV, on the hinges and within their limits ([`Robot::fit`]), with six decimals.
///
/// # Errors
/// [`CsvError::NoRobot`] if the skeleton has no hinges.
pub fn write_csv(clip: &Clip) -> Result<String, CsvError> {
    let robot = clip.skeleton.robot.as_ref().ok_or(CsvError::NoRobot)?;
    let mut fitted = Fitted::default();
    let mut pose = vec![Quat::IDENTITY; clip.skeleton.joint_count()];
    let mut text = String::new();
    let mut before = Quat::IDENTITY;
    for (frame, &root) in clip.root_positions.iter().enumerate() {
        pose.copy_from_slice(clip.rotations_at(frame));
        robot.fit(&mut pose, &mut fitted);
        let place = Convention::Ros.position_from_native(root).to_array();
        // So that readers who plot the columns see no jump of the sign.
        let rotation = align_sign(Convention::Ros.rotation_from_native(pose[0]), before);
        before = rotation;
        let numbers = place.into_iter().chain(rotation.to_array());
        for (nth, number) in numbers.chain(fitted.angles.iter().copied()).enumerate() {
            let comma = if nth == 0 { "" } else { "," };
            // Writing to a string does not fail.
            let _ = write!(text, "{comma}{number:.6}");
        }
        text.push('\n');
    }
    Ok(text)
}

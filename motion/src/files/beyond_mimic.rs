//! BeyondMimic's NumPy archive of a robot's motion.

use super::npz::{Archive, NumpyError};
use crate::clip::Clip;
use crate::robot::{CsvError, Reference, TRACKER_FPS, reference};

/// Writes a robot's clip as BeyondMimic's trackers read it ([`Reference`]): `fps`, `joint_pos`,
/// `joint_vel`, `body_pos_w`, `body_quat_w`, `body_lin_vel_w` and `body_ang_vel_w`, float32. Two
/// more arrays name the columns: `joint_names` and `body_names`.
///
/// Linear velocities are those of the links' own origins, not of their centres of mass.
///
/// # Errors
/// [`NumpyError::NoRobot`] if the skeleton has no hinges.
pub fn write_beyond_mimic(clip: &Clip) -> Result<Vec<u8>, NumpyError> {
    let Reference {
        frames,
        joint_names,
        joint_pos,
        joint_vel,
        body_names,
        body_pos,
        body_quat,
        body_lin_vel,
        body_ang_vel,
    } = reference(clip).map_err(|error| match error {
        CsvError::Clip(error) => NumpyError::Clip(error),
        _ => NumpyError::NoRobot,
    })?;
    let (joints, bodies) = (joint_names.len(), body_names.len());
    let mut archive = Archive::new();
    archive.add("fps", &[1], &[TRACKER_FPS as i64])?;
    archive.add("joint_pos", &[frames, joints], &joint_pos)?;
    archive.add("joint_vel", &[frames, joints], &joint_vel)?;
    archive.add("body_pos_w", &[frames, bodies, 3], &body_pos)?;
    archive.add("body_quat_w", &[frames, bodies, 4], &body_quat)?;
    archive.add("body_lin_vel_w", &[frames, bodies, 3], &body_lin_vel)?;
    archive.add("body_ang_vel_w", &[frames, bodies, 3], &body_ang_vel)?;
    archive.add_names(
        "joint_names",
        &joint_names.iter().map(String::as_str).collect::<Vec<_>>(),
    )?;
    archive.add_names(
        "body_names",
        &body_names.iter().map(String::as_str).collect::<Vec<_>>(),
    )?;
    archive.finish()
}

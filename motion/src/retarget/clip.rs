//! Whole clips.

use std::sync::Arc;

use glam::Quat;

use super::{Figures, RetargetError, Retargeter};
use crate::clip::Clip;

/// A clip of the source's body on the target's, and what it keeps of the source.
///
/// # Errors
/// [`RetargetError::Clip`] if the clip has too many frames for the target's joints.
pub fn retarget(retargeter: &mut Retargeter, clip: &Clip) -> Result<(Clip, Figures), RetargetError> {
    let skeleton = Arc::clone(retargeter.target.skeleton());
    let joints = skeleton.joint_count();
    let mut rotations = Vec::with_capacity(clip.frames() * joints);
    let mut roots = Vec::with_capacity(clip.frames());
    let mut short = (0.0, None);
    let mut pose = vec![Quat::IDENTITY; joints];
    retargeter.reset();
    retargeter.set_step(1.0 / clip.fps);
    for frame in 0..clip.frames() {
        roots.push(retargeter.pose(clip.root_positions[frame], clip.rotations_at(frame), &mut pose));
        rotations.extend_from_slice(&pose);
        if retargeter.short_m() > short.0 {
            short = (retargeter.short_m(), retargeter.short_joint());
        }
    }
    let made = Clip::new(skeleton, clip.fps, roots, rotations)?;
    let figures = Figures::of(retargeter.figures(), [clip, &made], short);
    Ok((made, figures))
}

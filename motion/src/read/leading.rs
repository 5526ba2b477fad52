//! A pose before the motion, as many programs put the T-pose into the first frame.

use glam::Quat;

use super::error::ReadErrorKind;
use super::options::{LeadingPose, Options};
use super::report::{Report, Topic};
use crate::clip::Clip;
use crate::rotation::angle_between;

/// Largest angle from the rest pose of a joint in a leading pose, degrees.
const MAX_OFF_REST_DEG: f32 = 1.0;
/// Least angle of a joint between a leading pose and the motion, degrees.
const MIN_JUMP_DEG: f32 = 15.0;
/// A leading pose is farther from the motion than its frames are from each other, by this factor.
const MIN_JUMP_RATIO: f32 = 5.0;
/// Most frames that are compared with each other.
const LOOKED_AT: usize = 64;

/// The clip without a leading pose. On a given skeleton one that is found is noted and kept,
/// because callers count frames.
pub(super) fn without_pose(
    clip: Clip,
    rest: &[Quat],
    options: &Options,
    report: &mut Report,
) -> Result<Clip, ReadErrorKind> {
    let found = match options.leading_pose {
        LeadingPose::Keep => None,
        LeadingPose::Drop => Some("--leading-pose".to_owned()),
        LeadingPose::Find => evidence(&clip, rest),
    };
    let is_found = options.leading_pose == LeadingPose::Find && found.is_some();
    let Some(evidence) = found else {
        return Ok(clip);
    };
    if clip.frames() < 2 {
        return Ok(clip);
    }
    if is_found && options.skeleton.is_some() {
        let text = format!(
            "the first frame is kept, since frames count on a given skeleton: {evidence}; --leading-pose drop leaves \
             it out"
        );
        report.odd(Topic::LeadingPose, text);
        return Ok(clip);
    }
    report.repaired(
        Topic::LeadingPose,
        format!("the first frame is left out: {evidence}"),
    );
    Ok(clip.slice(1..clip.frames())?)
}

/// What shows that the first frame is the rest pose and not of the motion.
fn evidence(clip: &Clip, rest: &[Quat]) -> Option<String> {
    let joints = clip.skeleton.joint_count();
    let last = clip
        .frames()
        .checked_sub(1)
        .filter(|&last| last >= 2 && joints > 3)?;
    let off = |a: &[Quat], b: &[Quat]| -> (f32, usize) {
        let angles = a.iter().zip(b).enumerate().skip(1);
        let angles = angles.map(|(joint, (a, b))| (angle_between(*a, *b).to_degrees(), joint));
        angles.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    };
    let first = clip.rotations_at(0);
    let (off_rest, _) = off(first, rest);
    let (jump, joint) = off(first, clip.rotations_at(1));
    if off_rest > MAX_OFF_REST_DEG || jump < MIN_JUMP_DEG {
        return None;
    }
    let steps = last.min(LOOKED_AT);
    let mut usual: Vec<f32> = (1..steps)
        .map(|frame| off(clip.rotations_at(frame), clip.rotations_at(frame + 1)).0)
        .collect();
    usual.sort_by(f32::total_cmp);
    let usual = usual.get(usual.len() / 2).copied()?;
    let name = &clip.skeleton.joints[joint].name;
    (jump > MIN_JUMP_RATIO * usual).then(|| {
        format!(
            "it is the rest pose, and {name} turns by {jump:.0}° to the second; later frames differ by {usual:.1}°"
        )
    })
}

//! A pose before the motion, as many programs put the T-pose into the first frame.

use glam::Quat;

use super::error::ReadErrorKind;
use super::options::{LeadingPose, Options};
use super::report::{Report, Topic};
use crate::clip::Clip;
use crate::rotation::angle_between;

/// Largest angle from the rest pose of every joint in a leading pose that is exact, degrees.
const MAX_OFF_REST_DEG: f32 = 1.0;
/// Largest angle from the rest pose in one that is only near to it, degrees, and the share of
/// joints that may be farther, such as fingers.
const MAX_NEAR_REST_DEG: f32 = 12.0;
const MAX_ASTRAY: f32 = 0.1;
/// Least angle of a joint between a leading pose and the motion, degrees.
const MIN_JUMP_DEG: f32 = 15.0;
/// A leading pose is farther from the motion than its frames are from each other, by this factor.
const MIN_JUMP_RATIO: f32 = 5.0;
/// Share of the joints, and their least number, that jump out of a pose that is only near to rest.
const MIN_JUMPING: f32 = 0.1;
const MIN_JUMPING_JOINTS: usize = 3;
/// Most frames at rest before the jump.
const MAX_LEADING: usize = 8;
/// Most frames between rest and motion: resampling blurs the jump.
const MAX_BLURRED: usize = 3;
/// Most frames that are compared with each other.
const LOOKED_AT: usize = 64;

/// Frames before the motion.
struct Lead {
    frames: usize,
    evidence: String,
}

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
        LeadingPose::Drop => {
            let frames = find(&clip, rest).map_or(1, |lead| lead.frames);
            let evidence = "--leading-pose".to_owned();
            Some(Lead { frames, evidence })
        }
        LeadingPose::Find => find(&clip, rest),
    };
    let is_found = options.leading_pose == LeadingPose::Find && found.is_some();
    let Some(Lead { frames, evidence }) = found.filter(|lead| lead.frames < clip.frames()) else {
        return Ok(clip);
    };
    let (which, them) = match frames {
        1 => ("first frame is".to_owned(), "it"),
        frames => (format!("first {frames} frames are"), "them"),
    };
    if is_found && options.skeleton.is_some() {
        let text = format!(
            "the {which} kept, since frames count on a given skeleton: {evidence}; --leading-pose drop leaves \
             {them} out"
        );
        report.odd(Topic::LeadingPose, text);
        return Ok(clip);
    }
    report.repaired(Topic::LeadingPose, format!("the {which} left out: {evidence}"));
    Ok(clip.slice(frames..clip.frames())?)
}

/// The frames before a jump out of the rest pose, with those that the jump is blurred over.
fn find(clip: &Clip, rest: &[Quat]) -> Option<Lead> {
    let joints = clip.skeleton.joint_count();
    let last = clip
        .frames()
        .checked_sub(1)
        .filter(|&last| last >= 2 && joints > 3)?;
    let pose = |frame: usize| clip.rotations_at(frame);
    let step = |frame: usize| farthest(pose(frame), pose(frame + 1));
    let (jump_at, usual) = (0..last.min(MAX_LEADING)).find_map(|frame| {
        let after = frame + 1..last.min(frame + LOOKED_AT);
        let mut usual: Vec<f32> = after.map(|frame| step(frame).0).collect();
        usual.sort_by(f32::total_cmp);
        let usual = usual.get(usual.len() / 2).copied()?;
        is_jump(step(frame).0, usual, 1.0).then_some((frame, usual))
    })?;
    let (jump, joint) = step(jump_at);
    // The frame before the jump may be blurred already.
    let leading = jump_at.max(1);
    let off_rest = |least: f32| {
        let off = |frame: usize| turned(pose(frame), rest, least);
        (0..leading).map(off).max().unwrap_or(0)
    };
    let mut frames = jump_at + 1;
    while frames < last && frames - jump_at <= MAX_BLURRED && is_jump(step(frames).0, usual, 0.5) {
        frames += 1;
    }
    let share = |of: f32| (of * (joints - 1) as f32) as usize;
    let is_exact = jump_at == 0 && off_rest(MAX_OFF_REST_DEG) == 0;
    let is_near = off_rest(MAX_NEAR_REST_DEG) <= share(MAX_ASTRAY).max(1);
    let jumps = |a, b| turned(pose(a), pose(b), MIN_JUMP_DEG) >= share(MIN_JUMPING).max(MIN_JUMPING_JOINTS);
    let is_clear = jumps(0, frames) && (frames == last || !jumps(frames, frames + 1));
    if !(is_exact || (is_near && is_clear)) {
        return None;
    }
    let name = &clip.skeleton.joints[joint].name;
    let evidence = match frames {
        1 => format!("it is the rest pose, and {name} turns by {jump:.0}° to the second"),
        _ => format!(
            "they begin at rest, and {name} turns by {jump:.0}° into frame {}",
            jump_at + 1
        ),
    };
    Some(Lead {
        frames,
        evidence: format!("{evidence}; later frames differ by {usual:.1}°"),
    })
}

/// Whether a step is no motion, with a share of the usual bounds.
fn is_jump(step_deg: f32, usual_deg: f32, share: f32) -> bool {
    step_deg >= share * MIN_JUMP_DEG && step_deg > share * MIN_JUMP_RATIO * usual_deg
}

/// Angles between two poses' joints but the root, degrees.
fn angles(a: &[Quat], b: &[Quat]) -> impl Iterator<Item = f32> {
    let pairs = a.iter().zip(b).skip(1);
    pairs.map(|(a, b)| angle_between(*a, *b).to_degrees())
}

/// The largest angle between two poses, degrees, and its joint.
fn farthest(a: &[Quat], b: &[Quat]) -> (f32, usize) {
    let angles = angles(a, b).zip(1..);
    angles.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
}

/// How many joints differ by more than an angle in degrees.
fn turned(a: &[Quat], b: &[Quat], least_deg: f32) -> usize {
    angles(a, b).filter(|&angle| angle > least_deg).count()
}

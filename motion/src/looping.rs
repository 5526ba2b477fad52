//! Makes a motion loop.

use glam::Quat;

use crate::clip::{Clip, ClipError};
use crate::rotation::{align_sign, angle_between, yaw};

/// Share of a motion that is kept at least.
const MIN_KEPT: f32 = 0.75;

/// A motion whose end leads into its beginning.
#[derive(Clone, Debug, PartialEq)]
pub struct Looped {
    /// Frame 0 follows the last one, moved on over the ground and turned about the vertical.
    pub clip: Clip,
    /// Most that a joint was turned, radians.
    pub turned_rad: f32,
    /// Most that the root was raised or lowered, metres.
    pub raised_m: f32,
}

/// Closes a motion. It ends before the frame of its last quarter whose pose and step are most like
/// those of the first. The rest of the difference is spread evenly over all frames, half on either
/// side of the middle. The way over the ground and the heading stay as they are.
///
/// # Errors
/// [`ClipError::OneFrame`] if the clip has fewer than 2 frames.
pub fn close(clip: &Clip) -> Result<Looped, ClipError> {
    if clip.frames() < 2 {
        return Err(ClipError::OneFrame);
    }
    let headings: Vec<f32> = clip.roots().iter().map(|root| root.heading).collect();
    let poses = poses(clip, &headings);
    let frames = length(&poses);
    let turns: Vec<_> = (poses[0].iter().zip(&poses[frames]))
        .map(|(&first, next)| align_sign(first * next.conjugate(), Quat::IDENTITY).to_scaled_axis())
        .collect();
    let height = |frame: usize| clip.root_positions[frame].y;
    let next_m = match frames < clip.frames() {
        true => height(frames),
        false => 2.0 * height(frames - 1) - height(frames - 2),
    };
    let open_m = next_m - height(0);
    let mut closed = clip.slice(0..frames)?;
    let (mut turned_rad, mut raised_m) = (0.0_f32, 0.0_f32);
    for frame in 0..frames {
        let share = frame as f32 / frames as f32 - 0.5;
        closed.root_positions[frame].y -= open_m * share;
        raised_m = raised_m.max((open_m * share).abs());
        let pose = closed.rotations_at_mut(frame);
        for (joint, &turn) in turns.iter().enumerate() {
            let before = poses[frame][joint];
            pose[joint] = (Quat::from_scaled_axis(turn * share) * before).normalize();
            turned_rad = turned_rad.max(angle_between(pose[joint], before));
        }
        pose[0] = (yaw(headings[frame]) * pose[0]).normalize();
    }
    Ok(Looped {
        clip: closed,
        turned_rad,
        raised_m,
    })
}

/// The poses of all frames without their headings, and one more: the last step taken again.
fn poses(clip: &Clip, headings: &[f32]) -> Vec<Vec<Quat>> {
    let frames = headings.iter().enumerate().map(|(frame, heading)| {
        let mut pose = clip.rotations_at(frame).to_vec();
        pose[0] = yaw(-heading) * pose[0];
        pose
    });
    let mut poses: Vec<_> = frames.collect();
    let [before, last] = [2, 1].map(|back| &poses[headings.len() - back]);
    poses.push(onward(before, last));
    poses
}

/// The pose after the second of two, if its step is taken again.
fn onward(before: &[Quat], last: &[Quat]) -> Vec<Quat> {
    let pairs = before.iter().zip(last);
    pairs
        .map(|(before, last)| (*last * before.conjugate() * *last).normalize())
        .collect()
}

/// Frames of the loop: the frame after them is most like the first.
fn length(poses: &[Vec<Quat>]) -> usize {
    let off = |a: &[Quat], b: &[Quat]| -> f32 {
        let angles = a.iter().zip(b).map(|(a, b)| angle_between(*a, *b));
        angles.map(|angle| angle * angle).sum()
    };
    let first = &poses[0];
    let before = onward(&poses[1], first);
    let frames = poses.len() - 1;
    let least = ((MIN_KEPT * frames as f32).ceil() as usize).max(2);
    let cost = |&frame: &usize| off(&poses[frame], first) + off(&poses[frame - 1], &before);
    let best = (least..=frames).min_by(|a, b| cost(a).total_cmp(&cost(b)));
    best.unwrap_or(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{stand, walk};

    /// Largest angle of a joint between two frames without their headings, radians.
    fn step_rad(clip: &Clip, from: usize, to: usize) -> f32 {
        let pose = |frame: usize| {
            let mut pose = clip.rotations_at(frame).to_vec();
            pose[0] = yaw(-clip.root_at(frame).heading) * pose[0];
            pose
        };
        let (from, to) = (pose(from), pose(to));
        let angles = from.iter().zip(&to).map(|(a, b)| angle_between(*a, *b));
        angles.fold(0.0, f32::max)
    }

    #[test]
    fn the_last_frame_leads_into_the_first() {
        let clip = walk(73);
        let looped = close(&clip).unwrap();
        let closed = &looped.clip;
        let last = closed.frames() - 1;
        assert!((54..73).contains(&last), "a quarter is cut at most: {last}");
        let largest = (1..=last).map(|frame| step_rad(closed, frame - 1, frame));
        let largest = largest.fold(0.0, f32::max);
        assert!(step_rad(&clip, 72, 0) > 3.0 * largest, "it did not loop before");
        assert!(step_rad(closed, last, 0) < 1.1 * largest);
        assert!((closed.root_positions[last].y - closed.root_positions[0].y).abs() < 0.01);
        // Two swings of the legs, which take 62.8 frames.
        assert!(last == 62 && looped.turned_rad < 0.05 && looped.raised_m < 0.02);
        for (a, b) in clip.roots().iter().zip(closed.roots()) {
            let way = a.position.with_y(0.0).distance(b.position.with_y(0.0));
            assert!(way < 1e-6 && (a.heading - b.heading).abs() < 1e-3);
        }
    }

    #[test]
    fn what_cutting_leaves_is_spread() {
        // Half a swing of the legs: no frame of the last quarter is like the first.
        let clip = walk(12);
        let looped = close(&clip).unwrap();
        let last = looped.clip.frames() - 1;
        assert!(
            step_rad(&looped.clip, last, 0) < 0.15,
            "{}",
            step_rad(&looped.clip, last, 0)
        );
        assert!(looped.turned_rad > 0.05);
    }

    #[test]
    fn a_motion_that_loops_stays_and_one_frame_is_refused() {
        let clip = stand(10);
        let looped = close(&clip).unwrap();
        assert!(looped.clip.frames() >= 8);
        assert!(looped.turned_rad < 1e-6 && looped.raised_m < 1e-6);
        assert_eq!(close(&stand(1)), Err(ClipError::Empty));
    }
}

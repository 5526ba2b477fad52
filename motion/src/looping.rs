//! Makes a motion loop.

use glam::Quat;

use crate::clip::{Clip, ClipError};
use crate::rotation::{align_sign, angle_between, yaw};

/// A motion whose end leads into its beginning.
#[derive(Clone, Debug, PartialEq)]
pub struct Looped {
    /// As many frames as before. Frame 0 follows the last one, moved on over the ground and turned
    /// about the vertical.
    pub clip: Clip,
    /// Most that a joint was turned, radians.
    pub turned_rad: f32,
    /// Most that the root was raised or lowered, metres.
    pub raised_m: f32,
}

/// Closes a motion. The difference between its first frame and the one that would follow its last
/// is spread evenly over all frames, half on either side of the middle. The way over the ground and
/// the heading stay as they are.
///
/// # Errors
/// [`ClipError::Empty`] if the clip has fewer than 2 frames.
pub fn close(clip: &Clip) -> Result<Looped, ClipError> {
    let (frames, joints) = (clip.frames(), clip.skeleton.joint_count());
    if frames < 2 {
        return Err(ClipError::Empty);
    }
    let headings: Vec<f32> = clip.roots().iter().map(|root| root.heading).collect();
    let mut closed = clip.clone();
    for (frame, heading) in headings.iter().enumerate() {
        let root = &mut closed.rotations[frame * joints];
        *root = yaw(-heading) * *root;
    }
    // The frame after the last one, if the last step is taken again.
    let next = |joint: usize| {
        let [last, before] = [1, 2].map(|back| closed.rotations[(frames - back) * joints + joint]);
        last * before.conjugate() * last
    };
    let turns: Vec<_> = (0..joints)
        .map(|joint| align_sign(closed.rotations[joint] * next(joint).conjugate(), Quat::IDENTITY))
        .map(Quat::to_scaled_axis)
        .collect();
    let height = |frame: usize| clip.root_positions[frame].y;
    let open_m = 2.0 * height(frames - 1) - height(frames - 2) - height(0);
    let (mut turned_rad, mut raised_m) = (0.0_f32, 0.0_f32);
    for (frame, heading) in headings.iter().enumerate() {
        let share = frame as f32 / frames as f32 - 0.5;
        closed.root_positions[frame].y -= open_m * share;
        raised_m = raised_m.max((open_m * share).abs());
        let pose = closed.rotations_at_mut(frame);
        for (rotation, &turn) in pose.iter_mut().zip(&turns) {
            let turned = (Quat::from_scaled_axis(turn * share) * *rotation).normalize();
            turned_rad = turned_rad.max(angle_between(turned, *rotation));
            *rotation = turned;
        }
        pose[0] = (yaw(*heading) * pose[0]).normalize();
    }
    Ok(Looped {
        clip: closed,
        turned_rad,
        raised_m,
    })
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
        let clip = walk(40);
        let looped = close(&clip).unwrap();
        let closed = &looped.clip;
        let largest = (1..40).map(|frame| step_rad(closed, frame - 1, frame));
        let largest = largest.fold(0.0, f32::max);
        assert!(step_rad(&clip, 39, 0) > 3.0 * largest, "it did not loop before");
        assert!(step_rad(closed, 39, 0) < 1.1 * largest);
        assert!((closed.root_positions[39].y - closed.root_positions[0].y).abs() < 0.01);
        assert!(looped.turned_rad > 0.1 && looped.turned_rad < 0.5 && looped.raised_m < 0.02);
        for (a, b) in clip.roots().iter().zip(closed.roots()) {
            let way = a.position.with_y(0.0).distance(b.position.with_y(0.0));
            assert!(way < 1e-6 && (a.heading - b.heading).abs() < 1e-3);
        }
    }

    #[test]
    fn a_motion_that_loops_stays_and_one_frame_is_refused() {
        let clip = stand(10);
        let looped = close(&clip).unwrap();
        assert!(looped.turned_rad < 1e-6 && looped.raised_m < 1e-6);
        assert_eq!(close(&stand(1)), Err(ClipError::Empty));
    }
}

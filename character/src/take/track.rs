//! The frames of one motion, as more are added.

use troupe_motion::interpolate::hermite;
use troupe_motion::model::{Dims, Motion, Rig};
use troupe_motion::pin::fade;
use troupe_motion::root::heading_of;
use troupe_motion::rotation::{align_sign, slerp_pose, yaw};
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Skeleton, Vec3};

use crate::post::{contact_bits, parent_relative, roots, to_world_rotations};

/// Frames of a motion in world space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Track {
    /// World positions of the root, metres.
    pub roots: Vec<Vec3>,
    /// `frames * joints`: joint 0 in world space, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// A byte a frame: bit i for contact joint i.
    pub contacts: Vec<u8>,
}

impl Track {
    /// The frames of a generator's motion. Its segment is placed at `frame`.
    pub fn of_motion(motion: &Motion, frame: &SegmentFrame, rig: &Rig) -> Self {
        let (dims, count): (&Dims, usize) = (&rig.dims, motion.frames());
        let mut rotations = parent_relative(motion, count, dims, &rig.skeleton);
        to_world_rotations(frame, dims.joints, &mut rotations);
        let places = roots(&motion.root).map(|root| frame.to_world_position(root.position));
        Self {
            roots: places.collect(),
            rotations,
            contacts: contact_bits(&motion.contacts, dims.contacts, count),
        }
    }

    /// Roots, rotations and contacts, to be changed.
    pub(super) fn columns(&mut self) -> (&mut [Vec3], &mut [Quat], &mut [u8]) {
        (&mut self.roots, &mut self.rotations, &mut self.contacts)
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.roots.len()
    }

    /// Whether there are no frames yet.
    pub fn is_empty(&self) -> bool {
        self.roots.is_empty()
    }

    fn joints(&self) -> usize {
        self.rotations.len().checked_div(self.len()).unwrap_or(0)
    }

    /// The rotations of a frame, one a joint.
    pub fn pose(&self, frame: usize) -> &[Quat] {
        let joints = self.joints();
        &self.rotations[frame * joints..(frame + 1) * joints]
    }

    /// Appends one frame.
    pub fn push(&mut self, root: Vec3, pose: &[Quat], contacts: u8) {
        self.roots.push(root);
        self.rotations.extend_from_slice(pose);
        self.contacts.push(contacts);
    }

    /// Appends the frames `from..from + count` of another motion, or fewer if it has fewer. Each
    /// quaternion has the sign that is nearer to the frame before.
    pub fn extend(&mut self, other: &Self, from: usize, count: usize) {
        for frame in from..(from + count).min(other.len()) {
            let start = self.rotations.len();
            self.push(other.roots[frame], other.pose(frame), other.contacts[frame]);
            let joints = self.joints();
            for index in start.max(joints)..self.rotations.len() {
                self.rotations[index] = align_sign(self.rotations[index], self.rotations[index - joints]);
            }
        }
    }

    /// Makes the frames from `from` on continue the pose before them. The difference fades over
    /// `over` frames.
    pub fn lead_over(&mut self, from: usize, over: usize) {
        let len = self.len();
        if from == 0 || from >= len {
            return;
        }
        let mut behind = self.part(from, len - from);
        let height = |frame: usize| Vec3::Y * self.roots[frame].y;
        let (was, is) = (height(from), height(from - 1));
        behind.join((was, self.pose(from)), (is, self.pose(from - 1)), over);
        let before = self.part(0, from);
        *self = before;
        self.extend(&behind, 0, len - from);
    }

    /// Makes the first frames continue another frame than the one that they were made for. `was` is
    /// the root and pose of that one, `is` the root and pose to continue. The difference fades over
    /// `over` frames.
    pub fn join(&mut self, was: (Vec3, &[Quat]), is: (Vec3, &[Quat]), over: usize) {
        let joints = self.joints();
        let turns: Vec<Quat> = was
            .1
            .iter()
            .zip(is.1)
            .map(|(was, is)| {
                let turn = (*is * was.conjugate()).normalize();
                if turn.w < 0.0 { -turn } else { turn }
            })
            .collect();
        for frame in 0..over.min(self.len()) {
            let weight = fade(frame + 1, over + 1);
            self.roots[frame] += (is.0 - was.0) * weight;
            let pose = &mut self.rotations[frame * joints..(frame + 1) * joints];
            for (rotation, turn) in pose.iter_mut().zip(&turns) {
                *rotation = (Quat::IDENTITY.slerp(*turn, weight) * *rotation).normalize();
            }
        }
    }

    /// Makes the first frames go on from the last two of `before` without a jump of place or speed.
    /// The difference fades over `over` frames.
    pub(super) fn go_on(&mut self, before: &Self, over: usize) {
        let joints = self.joints();
        if before.len() < 2 || self.len() < 2 || over == 0 {
            return;
        }
        let last = before.len() - 1;
        let span = over as f32;
        let curve = |frame: usize, off: Vec3, rate: Vec3| {
            let way = (frame + 1) as f32 / span;
            let at = |off: f32, rate: f32| hermite(way, span, (off, rate), (0.0, 0.0));
            Vec3::new(at(off.x, rate.x), at(off.y, rate.y), at(off.z, rate.z))
        };
        let frames = 0..over.min(self.len());
        let (came, goes) = (
            before.roots[last] - before.roots[last - 1],
            self.roots[1] - self.roots[0],
        );
        let off = before.roots[last] - (self.roots[0] - goes);
        for frame in frames.clone() {
            self.roots[frame] += curve(frame, off, came - goes);
        }
        let turn = |from: Quat, to: Quat| align_sign(to * from.conjugate(), Quat::IDENTITY).to_scaled_axis();
        for joint in 0..joints {
            let now = |frame: usize| before.pose(frame)[joint];
            let (first, second) = (self.pose(0)[joint], self.pose(1)[joint]);
            let (came, goes) = (turn(now(last - 1), now(last)), turn(first, second));
            let began = Quat::from_scaled_axis(-goes) * first;
            let off = turn(began, now(last));
            for frame in frames.clone() {
                let turned = Quat::from_scaled_axis(curve(frame, off, came - goes));
                let rotation = &mut self.rotations[frame * joints + joint];
                *rotation = (turned * *rotation).normalize();
            }
        }
    }

    /// The root of a frame, with the heading of its pose.
    pub fn root(&self, frame: usize, skeleton: &Skeleton) -> GlobalRoot {
        GlobalRoot::new(
            self.roots[frame],
            heading_of(self.pose(frame)[0], skeleton.left_axis),
        )
    }

    /// The frames `from..from + count`, as far as there are such.
    #[must_use]
    pub fn part(&self, from: usize, count: usize) -> Self {
        let joints = self.joints();
        let end = (from + count).min(self.len());
        let from = from.min(end);
        Self {
            roots: self.roots[from..end].to_vec(),
            rotations: self.rotations[from * joints..end * joints].to_vec(),
            contacts: self.contacts[from..end].to_vec(),
        }
    }

    /// Moves and turns all frames so that a root at `from` is at `to`. Heights stay.
    pub fn carry(&mut self, from: GlobalRoot, to: GlobalRoot) {
        let turn = yaw(to.heading - from.heading);
        let joints = self.joints();
        for root in &mut self.roots {
            let moved = turn * (*root - from.projected()) + to.projected();
            *root = moved;
        }
        for pose in self.rotations.chunks_exact_mut(joints.max(1)) {
            pose[0] = (turn * pose[0]).normalize();
        }
    }

    /// `frames` frames, each taken at the frame that `at` gives, which may be a fraction. Positions
    /// are interpolated in a line, rotations along the shorter arc.
    #[must_use]
    pub fn resampled(&self, frames: usize, at: impl Fn(usize) -> f32) -> Self {
        let joints = self.joints();
        let last = self.len().saturating_sub(1);
        let mut made = Self::default();
        let mut pose = vec![Quat::IDENTITY; joints];
        for frame in 0..frames {
            let place = at(frame).clamp(0.0, last as f32);
            let before = (place.floor() as usize).min(last);
            let after = (before + 1).min(last);
            let share = place - before as f32;
            slerp_pose(self.pose(before), self.pose(after), share, &mut pose);
            let root = self.roots[before].lerp(self.roots[after], share);
            let nearest = if share < 0.5 { before } else { after };
            made.push(root, &pose, self.contacts[nearest]);
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(frames: usize) -> Track {
        let mut track = Track::default();
        for frame in 0..frames {
            let turn = Quat::from_rotation_y(0.1 * frame as f32);
            track.push(
                Vec3::new(frame as f32, 1.0, 0.0),
                &[turn, Quat::IDENTITY],
                frame as u8,
            );
        }
        track
    }

    #[test]
    fn frames_between_frames_are_interpolated() {
        let half = track(3).resampled(5, |frame| frame as f32 / 2.0);
        assert_eq!(half.roots[3], Vec3::new(1.5, 1.0, 0.0));
        assert!(half.pose(3)[0].dot(Quat::from_rotation_y(0.15)) > 0.999_999);
        assert_eq!(half.contacts, [0, 1, 1, 2, 2]);
        assert_eq!(track(1).resampled(2, |_| 7.0).len(), 2);
    }

    #[test]
    fn following_frames_begin_at_the_pose_before_them() {
        let mut track = track(10);
        track.rotations[8..]
            .iter_mut()
            .for_each(|q| *q = Quat::from_rotation_x(1.0) * *q);
        let end = track.pose(9).to_vec();
        track.lead_over(4, 3);
        let turn = track.pose(3)[1].angle_between(track.pose(4)[1]);
        assert!(turn < 0.2, "{turn}");
        assert_eq!(track.pose(9), end, "the difference fades");
    }

    #[test]
    fn frames_go_on_at_the_speed_of_those_before_them() {
        let mut before = Track::default();
        (0..4).for_each(|frame| {
            let turn = Quat::from_rotation_y(0.05 * frame as f32);
            before.push(Vec3::Z * (0.04 * frame as f32), &[turn], 0);
        });
        // The network jumps, and goes on more slowly.
        let mut after = Track::default();
        (4..24).for_each(|frame| {
            let turn = Quat::from_rotation_y(0.3 + 0.01 * frame as f32);
            after.push(Vec3::Z * (0.1 + 0.03 * frame as f32), &[turn], 0);
        });
        let made = after.clone();
        after.go_on(&before, 8);
        let mut whole = before.clone();
        whole.extend(&after, 0, 20);
        let bend = |values: &dyn Fn(usize) -> f32| {
            let bends = (1..22).map(|at| (values(at + 1) - 2.0 * values(at) + values(at - 1)).abs());
            bends.fold(0.0, f32::max)
        };
        let moved = bend(&|frame| whole.roots[frame].z);
        let turned = bend(&|frame| 2.0 * whole.pose(frame)[0].y.atan2(whole.pose(frame)[0].w));
        // At the seam itself the network's frames bend by 0.1 m and 0.19 rad.
        assert!(moved < 0.012 && turned < 0.03, "{moved} m, {turned} rad");
        assert_eq!(after.part(8, 12), made.part(8, 12), "the difference fades");
    }

    #[test]
    fn all_frames_move_together() {
        let mut track = track(4);
        let from = GlobalRoot::new(track.roots[1], 0.1);
        let to = GlobalRoot::new(Vec3::new(5.0, 9.0, 5.0), 0.1 + std::f32::consts::FRAC_PI_2);
        track.carry(from, to);
        assert!(
            track.roots[1].distance(Vec3::new(5.0, 1.0, 5.0)) < 1e-5,
            "heights stay"
        );
        assert!(
            track.roots[2].distance(Vec3::new(5.0, 1.0, 4.0)) < 1e-5,
            "{}",
            track.roots[2]
        );
    }
}

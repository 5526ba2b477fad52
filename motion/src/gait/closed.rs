//! A gait cycle without a seam.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::cycle::{Cycle, arc};
use crate::clip::{Clip, ClipError};
use crate::rotation::{align_sign, slerp_pose, yaw};
use crate::skeleton::Skeleton;

/// One cycle without a seam. It can be sampled at any time, also before and after the cycle, and
/// repeats for ever.
///
/// The difference between the captured cycle's ends is spread evenly over it, half on either side
/// of its middle.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedCycle {
    skeleton: Arc<Skeleton>,
    fps: f32,
    /// Frames of the cycle, at least 1; a stand has 1.
    frames: usize,
    left_mps: f32,
    forward_mps: f32,
    turn_rps: f32,
    /// For each frame: the root joint relative to its mean path. Left, height over the world's
    /// zero, forward; metres.
    offsets: Vec<Vec3>,
    /// For each frame and joint; the first without the heading line.
    rotations: Vec<Quat>,
}

impl ClosedCycle {
    /// Closes a cycle that [`super::find_cycles`] found in `clip`.
    ///
    /// # Panics
    /// If the cycle is not in the clip.
    pub fn new(clip: &Clip, cycle: &Cycle) -> Self {
        let joints = clip.skeleton.joint_count();
        let origin = clip.root_positions[cycle.start] * Vec3::new(1.0, 0.0, 1.0);
        // One frame more than the cycle: the one that should equal the first.
        let mut offsets = Vec::with_capacity(cycle.frames + 1);
        let mut rotations = Vec::with_capacity((cycle.frames + 1) * joints);
        for f in 0..=cycle.frames {
            let heading = cycle.heading_at(f as f32, clip.fps);
            let time_s = f as f32 / clip.fps;
            let path = origin
                + arc(
                    cycle.left_mps,
                    cycle.forward_mps,
                    cycle.turn_rps,
                    cycle.heading,
                    time_s,
                );
            let pose = clip.rotations_at(cycle.start + f);
            offsets.push(yaw(-heading) * (clip.root_positions[cycle.start + f] - path));
            rotations.push(yaw(-heading) * pose[0]);
            rotations.extend_from_slice(&pose[1..]);
        }
        let mut closed = Self {
            skeleton: Arc::clone(&clip.skeleton),
            fps: clip.fps,
            frames: cycle.frames,
            left_mps: cycle.left_mps,
            forward_mps: cycle.forward_mps,
            turn_rps: cycle.turn_rps,
            offsets,
            rotations,
        };
        closed.close();
        closed.centre();
        closed
    }

    /// One frame of a clip, held for ever.
    ///
    /// # Panics
    /// If `frame` is out of range.
    pub fn stand(clip: &Clip, frame: usize) -> Self {
        let root = clip.root_at(frame);
        let mut rotations = clip.rotations_at(frame).to_vec();
        rotations[0] = yaw(-root.heading) * rotations[0];
        Self {
            skeleton: Arc::clone(&clip.skeleton),
            fps: clip.fps,
            frames: 1,
            left_mps: 0.0,
            forward_mps: 0.0,
            turn_rps: 0.0,
            offsets: vec![Vec3::Y * root.position.y],
            rotations,
        }
    }

    /// Spreads the difference between the first frame and the one after the last over the cycle,
    /// and drops that one.
    fn close(&mut self) {
        let joints = self.skeleton.joint_count();
        let open = self.offsets[self.frames] - self.offsets[0];
        let turns: Vec<Quat> = (0..joints)
            .map(|j| {
                let (first, last) = (self.rotations[j], self.rotations[self.frames * joints + j]);
                align_sign(first * last.conjugate(), Quat::IDENTITY)
            })
            .collect();
        self.offsets.truncate(self.frames);
        self.rotations.truncate(self.frames * joints);
        for f in 0..self.frames {
            let share = f as f32 / self.frames as f32 - 0.5;
            self.offsets[f] -= open * share;
            for (rotation, turn) in self.rotations[f * joints..].iter_mut().zip(&turns) {
                let part = Quat::from_scaled_axis(turn.to_scaled_axis() * share);
                *rotation = (part * *rotation).normalize();
            }
        }
    }

    /// Shifts the path so that the root sways about it evenly.
    fn centre(&mut self) {
        let mean = self.offsets.iter().sum::<Vec3>() / self.frames as f32;
        let beside = mean * Vec3::new(1.0, 0.0, 1.0);
        self.offsets.iter_mut().for_each(|o| *o -= beside);
    }

    /// Mean velocity to the left and forward, m/s, and mean turning rate, rad/s.
    pub fn velocity(&self) -> (f32, f32, f32) {
        (self.left_mps, self.forward_mps, self.turn_rps)
    }

    /// Whether it is one frame that is held.
    pub fn stands(&self) -> bool {
        self.frames == 1
    }

    /// Frames of the cycle; 1 for a stand.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Mean height of the root joint, metres.
    pub fn height_m(&self) -> f32 {
        self.offsets.iter().map(|o| o.y).sum::<f32>() / self.frames as f32
    }

    /// Heading of the heading line at a time, radians; 0 at the start.
    pub fn heading_at(&self, frame: f32) -> f32 {
        self.turn_rps * frame / self.fps
    }

    /// The root joint and the pose at a time in frames from the first left strike, which may be
    /// negative or fractional. The heading line begins at the world's origin along +Z.
    pub fn at(&self, frame: f32) -> (Vec3, Vec<Quat>) {
        let joints = self.skeleton.joint_count();
        let within = frame.rem_euclid(self.frames as f32);
        let from = (within.floor() as usize).min(self.frames - 1);
        let to = (from + 1) % self.frames;
        let t = within - from as f32;
        let pose_at = |f: usize| &self.rotations[f * joints..(f + 1) * joints];
        let mut pose = vec![Quat::IDENTITY; joints];
        slerp_pose(pose_at(from), pose_at(to), t, &mut pose);
        let heading = self.heading_at(frame);
        pose[0] = yaw(heading) * pose[0];
        let offset = self.offsets[from].lerp(self.offsets[to], t);
        let path = arc(
            self.left_mps,
            self.forward_mps,
            self.turn_rps,
            0.0,
            frame / self.fps,
        );
        (path + yaw(heading) * offset, pose)
    }

    /// A clip of `frames` frames from `first` on.
    ///
    /// # Errors
    /// [`ClipError`] for no frames.
    pub fn clip(&self, first: f32, frames: usize) -> Result<Clip, ClipError> {
        let mut roots = Vec::with_capacity(frames);
        let mut rotations = Vec::with_capacity(frames * self.skeleton.joint_count());
        for f in 0..frames {
            let (root, pose) = self.at(first + f as f32);
            roots.push(root);
            rotations.extend(pose);
        }
        Clip::new(Arc::clone(&self.skeleton), self.fps, roots, rotations)
    }
}

//! Measures the figures of keyframes, before there is any motion.

use glam::{Quat, Vec3};

use super::{Feasibility, Figure, Judge, Limits, Reach};
use crate::fk::world_transforms;
use crate::root::{GlobalRoot, LocalRoot};
use crate::rotation::{angle_between, yaw};

/// What a keyframe prescribes, all in one frame of reference: the world's or a segment's.
#[derive(Debug, Clone, Copy, Default)]
pub struct Key<'a> {
    /// Position in metres and heading in radians.
    pub root: Option<GlobalRoot>,
    /// Height of the root, metres.
    pub height: Option<f32>,
    /// Velocity that was asked for.
    pub velocity: Option<LocalRoot>,
    /// One rotation a joint: joint 0 in the frame of reference, others relative to their parents.
    pub rotations: Option<&'a [Quat]>,
}

impl Key<'_> {
    fn place(&self) -> Option<Vec3> {
        self.root.map(|root| root.position)
    }

    /// Rotation of the pelvis; upright if only the heading is known.
    fn pelvis(&self) -> Option<Quat> {
        match self.rotations {
            Some(pose) => pose.first().copied(),
            None => self.root.map(|root| yaw(root.heading)),
        }
    }

    /// Its pose with the height of the root.
    fn pose(&self) -> Option<(f32, &[Quat])> {
        self.place()
            .map(|place| place.y)
            .or(self.height)
            .zip(self.rotations)
    }
}

impl Judge {
    /// Judges the keyframes of a request: consecutive ones at its beginning, and consecutive ones
    /// that end with its last frame. Frames count from the first keyframe.
    pub fn keys(&mut self, context: &[Key<'_>], targets: &[Key<'_>], frames: usize) -> Feasibility {
        let first_target = frames.saturating_sub(targets.len());
        self.take();
        self.run(context, 0);
        // Keyframes without a gap between them are one run.
        if first_target > context.len() {
            self.gap();
        }
        self.run(targets, first_target);
        self.gap();
        if let Some(last) = context.last() {
            for (index, target) in targets.iter().enumerate() {
                let frame = first_target + index;
                self.see_reach(context, last, target, frame);
            }
        }
        self.take()
    }

    /// Judges the velocities that targets ask for, together with the motion that leads to them.
    pub fn arrivals(&mut self, targets: &[Key<'_>], roots: &[Vec3]) -> Feasibility {
        let first = roots.len().saturating_sub(targets.len());
        for (index, target) in targets.iter().enumerate() {
            let frame = first + index;
            if let (Some(velocity), Some(before)) = (target.velocity, frame.checked_sub(1)) {
                let velocity = Vec3::new(velocity.vx, 0.0, velocity.vz);
                self.see_velocity(frame, velocity, roots[before], roots[frame]);
            }
        }
        self.take()
    }

    /// Judges places of the root at increasing frames: the lowest speed that is needed between
    /// them.
    pub fn places(&mut self, places: impl IntoIterator<Item = (usize, [f32; 2])>) -> Feasibility {
        let mut before: Option<(usize, [f32; 2])> = None;
        for (frame, [x, z]) in places {
            if let Some((since, [from_x, from_z])) = before {
                let frames = frame.saturating_sub(since).max(1) as f32;
                let speed = (x - from_x).hypot(z - from_z) / frames * self.fps;
                self.see(Figure::RootSpeed, frame, speed, None);
            }
            before = Some((frame, [x, z]));
        }
        self.take()
    }

    /// Whether a target is within reach of a context in `frames` frames.
    pub fn is_within_reach(&mut self, context: &[Key<'_>], target: &Key<'_>, frames: usize) -> bool {
        let Some(last) = context.last() else { return true };
        let limits = self.limits.reach(frames);
        let found = self.distances(context, last, target, frames);
        found.root_m <= limits.root_m && found.turn_rad <= limits.turn_rad && found.pose_m <= limits.pose_m
    }

    fn run(&mut self, keys: &[Key<'_>], first: usize) {
        let mut before: Option<Vec3> = None;
        for (index, key) in keys.iter().enumerate() {
            self.push(first + index, key.place(), key.pose());
            if let (Some(velocity), Some(before), Some(place)) = (key.velocity, before, key.place()) {
                let velocity = Vec3::new(velocity.vx, 0.0, velocity.vz);
                self.see_velocity(first + index, velocity, before, place);
            }
            before = key.place();
        }
    }

    fn see_reach(&mut self, context: &[Key<'_>], last: &Key<'_>, target: &Key<'_>, frame: usize) {
        let frames = (frame + 1).saturating_sub(context.len()).max(1);
        let limits = self.limits.reach(frames);
        let found = self.distances(context, last, target, frames);
        self.see_within(Figure::RootReach, frame, found.root_m, limits.root_m, None);
        self.see_within(Figure::TurnReach, frame, found.turn_rad, limits.turn_rad, None);
        self.see_within(Figure::PoseReach, frame, found.pose_m, limits.pose_m, None);
    }

    /// Distances from a context to a target; 0 for a part that one of them does not give.
    fn distances(&mut self, context: &[Key<'_>], last: &Key<'_>, target: &Key<'_>, frames: usize) -> Reach {
        let turn = last.pelvis().zip(target.pelvis());
        Reach {
            root_m: reach_of(context, target, frames).unwrap_or(0.0),
            turn_rad: turn.map_or(0.0, |(from, to)| angle_between(from, to)),
            pose_m: self.pose_distance(last, target).unwrap_or(0.0),
        }
    }

    /// Mean distance between the joints of two keyframes over their projected roots, metres. Uses
    /// the memory of frames.
    fn pose_distance(&mut self, from: &Key<'_>, to: &Key<'_>) -> Option<f32> {
        let poses = [from.pose()?, to.pose()?];
        let places = [&mut self.older.places, &mut self.next.places];
        for ((height, pose), places) in poses.into_iter().zip(places) {
            let root = Vec3::new(0.0, height, 0.0);
            world_transforms(&self.skeleton, root, pose, places, &mut self.rotations);
        }
        let pairs = self.older.places.iter().zip(&self.next.places);
        let sum: f32 = pairs.map(|(from, to)| from.distance(*to)).sum();
        Some(sum / self.skeleton.joint_count() as f32)
    }
}

/// Distance over the ground between a target's root and where the context's mean velocity leads in
/// `frames` frames, metres. None if either has no root.
pub fn reach_of(context: &[Key<'_>], target: &Key<'_>, frames: usize) -> Option<f32> {
    let led = context.last()?.place()? + step_of(context)? * frames as f32;
    Some((target.place()? - led).with_y(0.0).length())
}

/// Farthest that a root can get from the last context frame in the direction of a target after
/// `frames` frames, metres over the ground. None if it cannot get in that direction. `limits` are
/// those of the body.
pub fn farthest(limits: &Limits, context: &[Key<'_>], target: &Key<'_>, frames: usize) -> Option<f32> {
    let way = (target.place()? - context.last()?.place()?).with_y(0.0);
    let direction = way.try_normalize()?;
    let led = step_of(context)?.with_y(0.0) * frames as f32;
    let ahead = led.dot(direction);
    let aside = (led - direction * ahead).length_squared();
    let reach = limits.reach(frames).root_m;
    let room = reach * reach - aside;
    (room >= 0.0)
        .then(|| ahead + room.sqrt())
        .filter(|most| *most >= 0.0)
}

/// Mean travel of the context in a frame, metres.
fn step_of(context: &[Key<'_>]) -> Option<Vec3> {
    let (first, last) = (context.first()?.place()?, context.last()?.place()?);
    Some((last - first) / context.len().saturating_sub(1).max(1) as f32)
}

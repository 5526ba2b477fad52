//! Measures the figures of frames, one after another.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{Feasibility, Figure, Limits, Reading};
use crate::fk::world_transforms;
use crate::model::Rig;
use crate::robot::{Fitted, HingeRates};
use crate::rotation::angle_between;
use crate::skeleton::Skeleton;

/// Reads a motion frame by frame, and keeps the readings that are farthest beyond the limits of its
/// body.
///
/// A frame may lack its root or its pose. Figures that need the missing part are not judged then.
/// All memory is allocated once.
#[derive(Debug)]
pub struct Judge {
    pub(super) limits: Arc<Limits>,
    pub(super) skeleton: Arc<Skeleton>,
    pub(super) fps: f32,
    found: Feasibility,
    /// The frame before the next one, and the one before that.
    last: State,
    pub(super) older: State,
    pub(super) next: State,
    pub(super) rotations: Vec<Quat>,
    hinges: Hinges,
}

/// What the figures of a robot's hinges need.
#[derive(Debug, Default)]
struct Hinges {
    rates: HingeRates,
    pose: Vec<Quat>,
    fitted: Fitted,
}

/// What the figures of later frames need of a frame.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    root: Option<Vec3>,
    pelvis: Option<Quat>,
    /// Positions relative to the root, in world axes. Without a pelvis they mean nothing.
    pub(super) places: Vec<Vec3>,
}

impl Judge {
    /// A judge of the rig's motion; none if the rig has no limits.
    pub fn new(rig: &Rig) -> Option<Self> {
        let limits = rig.limits.clone()?;
        let joints = rig.skeleton.joint_count();
        let state = State {
            places: vec![Vec3::ZERO; joints],
            ..State::default()
        };
        Some(Self {
            found: Feasibility::nothing(&limits),
            limits,
            skeleton: rig.skeleton.clone(),
            fps: rig.fps,
            last: state.clone(),
            older: state.clone(),
            next: state,
            rotations: vec![Quat::IDENTITY; joints],
            hinges: Hinges::default(),
        })
    }

    /// Judges a whole motion: world positions of the root, `[frames]`, and poses,
    /// `[frames * joints]`, joint 0 in the world and others relative to their parents.
    pub fn motion(&mut self, roots: &[Vec3], rotations: &[Quat]) -> Feasibility {
        let poses = rotations.chunks_exact(self.skeleton.joint_count());
        for (frame, (&root, pose)) in roots.iter().zip(poses).enumerate() {
            self.push(frame, Some(root), Some((root.y, pose)));
        }
        self.take()
    }

    /// The limits that it judges by.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Takes the readings since the judge was made or this was called. The next frame starts a new
    /// motion.
    pub fn take(&mut self) -> Feasibility {
        let found = self.part();
        self.gap();
        found
    }

    /// Takes the readings since the last call. The next frame continues the motion.
    pub fn part(&mut self) -> Feasibility {
        std::mem::replace(&mut self.found, Feasibility::nothing(&self.limits))
    }

    /// Notes that the next frame does not continue the motion.
    pub(super) fn gap(&mut self) {
        for state in [&mut self.last, &mut self.older] {
            (state.root, state.pelvis) = (None, None);
        }
        self.hinges.rates.clear();
    }

    /// Judges the next frame, with its number, the place of its root, and its pose with the height
    /// of the root.
    pub fn push(&mut self, frame: usize, root: Option<Vec3>, pose: Option<(f32, &[Quat])>) {
        self.next.root = root;
        self.next.pelvis = pose.map(|(_, pose)| pose[0]);
        if let Some(root) = root {
            self.see_root(frame, root);
        }
        if let Some((height, pose)) = pose {
            self.see_pose(frame, height, pose);
            self.see_joints(frame);
            self.see_hinges(frame, pose);
        } else {
            self.hinges.rates.clear();
        }
        // The oldest becomes the memory for the next.
        std::mem::swap(&mut self.older, &mut self.last);
        std::mem::swap(&mut self.last, &mut self.next);
    }

    /// Takes a figure's value in a frame, in the unit of its limit.
    pub(super) fn see(&mut self, figure: Figure, frame: usize, value: f32, joint: Option<usize>) {
        let limit = self.limits.of(figure);
        self.see_within(figure, frame, value, limit, joint);
    }

    /// Takes a figure's value in a frame, with a separate limit.
    pub(super) fn see_within(
        &mut self,
        figure: Figure,
        frame: usize,
        value: f32,
        limit: f32,
        joint: Option<usize>,
    ) {
        let seen = Reading {
            value,
            limit,
            frame,
            joint,
        };
        self.found.see(figure, seen);
    }

    /// Judges a root velocity (over the ground, m/s) that a frame asks for, together with the step
    /// that leads to it.
    pub(super) fn see_velocity(&mut self, frame: usize, velocity: Vec3, before: Vec3, root: Vec3) {
        let step = (root - before).with_y(0.0) * self.fps;
        let change = (velocity.with_y(0.0) - step).length() * self.fps;
        self.see(Figure::RootAcceleration, frame, change, None);
    }

    fn see_root(&mut self, frame: usize, root: Vec3) {
        let Some(before) = self.last.root else { return };
        let step = root - before;
        self.see(
            Figure::RootSpeed,
            frame,
            step.with_y(0.0).length() * self.fps,
            None,
        );
        let Some(older) = self.older.root else { return };
        let change = (step - (before - older)).length() * self.fps * self.fps;
        self.see(Figure::RootAcceleration, frame.saturating_sub(1), change, None);
    }

    fn see_pose(&mut self, frame: usize, height: f32, pose: &[Quat]) {
        // Joints are placed around the root, and lifted by its height for figures that need that.
        let (skeleton, places) = (&*self.skeleton, &mut self.next.places);
        world_transforms(skeleton, Vec3::ZERO, pose, places, &mut self.rotations);
        let lowest = places.iter().enumerate().min_by(|a, b| a.1.y.total_cmp(&b.1.y));
        let (lowest, place) = lowest.map_or((0, Vec3::ZERO), |(joint, place)| (joint, *place));
        let over = height + place.y - skeleton.ground_y_m;
        let (mut worst, mut bent) = (0.0, None);
        for (joint, &rotation) in pose.iter().enumerate().skip(1) {
            let beyond = self
                .limits
                .bend(joint)
                .map_or(0.0, |bend| bend.beyond_rad(rotation));
            if beyond > worst {
                (worst, bent) = (beyond, Some(joint));
            }
        }
        let upright = (pose[0] * self.limits.upright()).y;
        self.see(Figure::BelowGround, frame, -over, Some(lowest));
        self.see(Figure::OffGround, frame, over, Some(lowest));
        self.see(Figure::Tilt, frame, upright.clamp(-1.0, 1.0).acos(), None);
        self.see(Figure::Bend, frame, worst, bent);
    }

    fn see_joints(&mut self, frame: usize) {
        let (Some(now), Some(before)) = (self.next.pelvis, self.last.pelvis) else {
            return;
        };
        let turned = angle_between(now, before) * self.fps;
        let (places, last) = (&self.next.places, &self.last.places);
        let (joint, fastest) = farthest(places.iter().zip(last).map(|(now, before)| *now - *before));
        let changed = self.older.pelvis.is_some().then(|| {
            let all = places.iter().zip(last).zip(&self.older.places);
            farthest(all.map(|((now, before), older)| *now - 2.0 * *before + *older))
        });
        self.see(Figure::Turning, frame, turned, None);
        self.see(Figure::JointSpeed, frame, fastest * self.fps, Some(joint));
        if let Some((joint, change)) = changed {
            let change = change * self.fps * self.fps;
            self.see(
                Figure::JointAcceleration,
                frame.saturating_sub(1),
                change,
                Some(joint),
            );
        }
    }

    /// Judges a robot's hinges. A pose that is not on them, as that of a keyframe may be, counts as
    /// the nearest one that is.
    fn see_hinges(&mut self, frame: usize, pose: &[Quat]) {
        let skeleton = Arc::clone(&self.skeleton);
        let Some(robot) = &skeleton.robot else { return };
        let mut hinges = std::mem::take(&mut self.hinges);
        hinges.pose.clear();
        hinges.pose.extend_from_slice(pose);
        robot.fit(&mut hinges.pose, &mut hinges.fitted);
        hinges.rates.push(robot, &hinges.fitted.angles, self.fps.recip());
        let (speeds, accelerations) = (hinges.rates.speeds(), hinges.rates.accelerations());
        for (hinge, speed) in robot.hinges().iter().zip(speeds) {
            let most = hinge.max_speed_rad_per_s;
            self.see_within(Figure::HingeSpeed, frame, speed.abs(), most, Some(hinge.joint));
        }
        for (hinge, change) in robot.hinges().iter().zip(accelerations) {
            if let Some(most) = hinge.max_acceleration_rad_per_s2 {
                let (frame, joint) = (frame.saturating_sub(1), Some(hinge.joint));
                self.see_within(Figure::HingeAcceleration, frame, change.abs(), most, joint);
            }
        }
        self.hinges = hinges;
    }
}

/// Index and length of the longest vector.
fn farthest(vectors: impl Iterator<Item = Vec3>) -> (usize, f32) {
    let mut found = (0, 0.0);
    for (index, vector) in vectors.enumerate() {
        let square = vector.length_squared();
        // A value that is not a number counts as the farthest.
        if square > found.1 || square.is_nan() {
            found = (index, square);
        }
    }
    (found.0, found.1.sqrt())
}

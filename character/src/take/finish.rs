//! The last step of a take: the motion meets its constraints, its feet stand still, and it comes
//! onto the ground.

use std::collections::BTreeMap;
use std::ops::Range;

use troupe_motion::bend::{Place, bend_through};
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{FootLock, Posed, ReachOptions, Reached, lock_feet, reach_pose};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::pin::{PosePin, pin_poses};
use troupe_motion::robot::HingeRates;
use troupe_motion::segment::{RootPin, pin_targets};
use troupe_motion::terrain::{Terrain, lift_motion};
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::ending::put;
use super::met::{Body, Fixed, fixed};
use super::note::Note;
use super::request::{Effector, Take, Wanted};
use super::track::Track;
use crate::post::{PIN_REACH_FRAMES, onto_hinges, plant};

/// A root that moves farther than this gets a note, metres.
const NOTED_M: f32 = 0.3;
/// The way of words that misses a place by more than this is bent, metres.
const BENT_M: f32 = 0.05;
/// An effector that stays farther away than this gets a note, metres.
const MISSED_M: f32 = 0.02;
/// A robot's pose gets a note if its hinges differ by more than this, radians.
const HINGES_RAD: f32 = 0.2;
/// Frames over which a correction of the first frame's height fades.
const FADE_FRAMES: f32 = 30.0;
/// Farthest that a foot that is held is moved, metres.
const HELD_M: f32 = 0.25;

/// A finished motion, in the frames of the answer.
#[derive(Debug, Clone)]
pub struct Made {
    /// The frames of the answer, at its own rate.
    pub track: Track,
    /// Frames at which windows begin.
    pub boundaries: Vec<usize>,
    /// Notes for the caller.
    pub notes: Vec<Note>,
}

/// Finishes the motion of a sample. `track` has the body's own frame rate.
pub fn finish(take: &Take, mut track: Track, boundaries: Vec<usize>, notes: Vec<Note>) -> Made {
    let body = Body::of(take);
    // The other body's feet stand where those of the take's body do.
    if take.hold_feet && take.subject.follower.is_some() && take.onto.is_some() {
        let range = 0..track.len();
        plant(&take.subject.rig, track.columns(), range, None);
    }
    let mut work = Work {
        take,
        track: match &take.onto {
            Some(onto) => onto.carry(&track, take.clock.native_fps),
            None => track,
        },
        notes,
        fixed: fixed(&body),
        is_bent: false,
        body,
    };
    work.meet_roots();
    work.approach();
    work.meet_poses();
    if take.hold_feet {
        work.hold_feet();
    }
    work.lift();
    work.meet_parts();
    if take.is_loop {
        work.close();
    }
    if let Some(robot) = &work.body.skeleton.robot {
        let frames = (&*work.track.roots, &mut *work.track.rotations);
        let clock = (&mut HingeRates::default(), take.clock.native_fps);
        let columns = onto_hinges(robot, frames, clock, false);
        let most = columns.residuals.iter().copied().fold(0.0, f32::max);
        if most > HINGES_RAD {
            let message = format!("the robot's hinges miss a pose by up to {most:.2} rad");
            work.notes.push(Note::warning("hinges", message));
        }
        let named = |hinge: usize| &work.body.skeleton.joints[robot.hinges()[hinge].joint].name;
        if let Some(message) = columns.rates.too_fast(take.clock.native_fps, named) {
            work.notes.push(Note::warning("hinge_speed", message));
        }
    }
    let Work { track, notes, .. } = work;
    let clock = &take.clock;
    match clock.resamples() {
        false => Made {
            track,
            boundaries,
            notes,
        },
        true => Made {
            track: track.resampled(clock.frames, |frame| clock.native(frame)),
            boundaries: boundaries
                .into_iter()
                .map(|frame| (frame as f32 * clock.fps / clock.native_fps).round() as usize)
                .filter(|&frame| frame < clock.frames)
                .collect(),
            notes,
        },
    }
}

struct Work<'a> {
    take: &'a Take,
    body: Body<'a>,
    track: Track,
    notes: Vec<Note>,
    fixed: BTreeMap<usize, Fixed>,
    /// Whether the way of motion for words was bent: then feet must step as it goes.
    is_bent: bool,
}

impl Work<'_> {
    fn warn(&mut self, code: &'static str, message: String) {
        self.notes.push(Note::warning(code, message));
    }

    fn last(&self) -> usize {
        self.track.len() - 1
    }

    fn root(&self, frame: usize) -> GlobalRoot {
        self.track.root(frame, self.body.skeleton)
    }

    /// The root that a frame must have. Parts without constraint stay as the model made them.
    fn pinned(&self, frame: usize, fixed: &Fixed) -> GlobalRoot {
        let mut root = self.root(frame);
        if let Some([x, z]) = fixed.place {
            (root.position.x, root.position.z) = (x, z);
        }
        root.position.y = fixed.y.unwrap_or(root.position.y);
        root.heading = fixed.heading.unwrap_or(root.heading);
        root
    }

    /// Moves roots to their fixed positions: the first one together with all frames, later ones by
    /// an offset that fades.
    fn meet_roots(&mut self) {
        if let Some(first) = self.fixed.get(&0).copied() {
            let (from, to) = (self.root(0), self.pinned(0, &first));
            self.track.carry(from, to);
            let up = to.position.y - from.position.y;
            for (frame, root) in self.track.roots.iter_mut().enumerate() {
                root.y += up * (1.0 - smoothstep((frame as f32 / FADE_FRAMES).min(1.0)));
            }
        }
        let pins = self.root_pins();
        let off = |(frame, root): (&usize, &GlobalRoot)| {
            (root.position - self.track.roots[*frame]).with_y(0.0).length()
        };
        let most = pins.iter().map(off).fold(0.0, f32::max);
        if most > NOTED_M {
            let message = format!(
                "the model's motion was up to {most:.1} m away from a place that it must meet: feet may slide"
            );
            self.warn("root_moved", message);
        }
        if self.take.speaks() {
            self.is_bent = most > BENT_M;
            self.bend();
        }
        self.pin_roots(&self.root_pins());
    }

    /// The roots that frames after the first one must have.
    fn root_pins(&self) -> BTreeMap<usize, GlobalRoot> {
        let last = self.last();
        let mut pins: BTreeMap<usize, GlobalRoot> = self
            .fixed
            .range(1..)
            .filter(|(frame, _)| **frame <= last)
            .map(|(&frame, fixed)| (frame, self.pinned(frame, fixed)))
            .collect();
        if self.take.is_loop && last > 0 {
            let first = self.root(0);
            let end = pins.get(&last).copied().unwrap_or_else(|| self.root(last));
            let position = end.position.with_y(first.position.y);
            pins.insert(last, GlobalRoot::new(position, first.heading));
        }
        pins
    }

    /// Bends the way of motion for words through its fixed places: a model of words knows none.
    fn bend(&mut self) {
        let place = |(&frame, fixed): (&usize, &Fixed)| {
            Some(Place {
                frame,
                ground: fixed.place?.into(),
                heading: fixed.heading,
            })
        };
        let places: Vec<Place> = self.fixed.range(1..).filter_map(place).collect();
        let frames = 0..self.track.len();
        let roots: Vec<GlobalRoot> = frames.map(|frame| self.root(frame)).collect();
        let bent = bend_through(&roots, &places);
        put(&mut self.track, 0, &bent, self.body.skeleton);
    }

    fn pin_roots(&mut self, pins: &BTreeMap<usize, GlobalRoot>) {
        let joints = self.body.skeleton.joint_count();
        let pins = pins.iter().map(|(&frame, &root)| RootPin { frame, root });
        let pins: Vec<RootPin> = pins.collect();
        let frames = 0..self.track.len();
        let mut roots: Vec<GlobalRoot> = frames.map(|frame| self.root(frame)).collect();
        pin_targets(&mut roots, &mut self.track.rotations, joints, 0, &pins);
        for (place, root) in self.track.roots.iter_mut().zip(roots) {
            *place = root.position;
        }
    }

    /// The effectors of each frame, except those of the root.
    fn effectors(&self) -> BTreeMap<usize, Vec<Effector>> {
        let mut frames: BTreeMap<usize, Vec<Effector>> = BTreeMap::new();
        let wanted = &self.body.wanted.effectors;
        for effector in wanted.iter().filter(|effector| effector.joint != 0) {
            frames.entry(effector.frame).or_default().push(*effector);
        }
        frames.retain(|frame, _| *frame < self.track.len());
        frames
    }

    fn reach(&self, frame: usize, pose: &[Quat], points: &[(usize, Vec3)]) -> Reached {
        let root = self.track.roots[frame];
        let base = Posed {
            root,
            rotations: pose,
        };
        let options = ReachOptions {
            root: Some(root),
            parts: self.body.parts,
            ..ReachOptions::default()
        };
        reach_pose(self.body.skeleton, self.body.legs, base, points, &options)
    }

    /// Brings roots without constraint within reach of their effectors.
    fn approach(&mut self) {
        let floor = &self.body.wanted.ground;
        let mut pins = BTreeMap::new();
        for (frame, effectors) in self.effectors() {
            let is_fixed = self.fixed.get(&frame).is_some_and(|fixed| fixed.place.is_some());
            if is_fixed {
                continue;
            }
            let points: Vec<(usize, Vec3)> = effectors
                .iter()
                .map(|effector| {
                    let height = floor.height(effector.point.x, effector.point.z).unwrap_or(0.0);
                    (effector.joint, effector.point - Vec3::Y * height)
                })
                .collect();
            let reached = self.reach(frame, self.track.pose(frame), &points);
            let off = points.iter().map(|&(joint, point)| {
                let place = joint_transform(self.body.skeleton, reached.root, &reached.rotations, joint).0;
                (point - place).with_y(0.0)
            });
            let off = off.sum::<Vec3>() / points.len() as f32;
            if off.length() > MISSED_M {
                let mut root = self.root(frame);
                root.position += off;
                pins.insert(frame, root);
            }
        }
        if pins.is_empty() {
            return;
        }
        for (&frame, fixed) in &self.fixed {
            if frame < self.track.len() {
                pins.insert(frame, self.pinned(frame, fixed));
            }
        }
        if self.take.is_loop {
            pins.insert(self.last(), self.root(self.last()));
        }
        self.pin_roots(&pins);
    }

    /// Whole poses of the request, by frame.
    fn whole(&self) -> BTreeMap<usize, Vec<Quat>> {
        let keys = self.body.wanted.keys.iter();
        let keys = keys.filter(|key| key.frame < self.track.len());
        keys.filter_map(|key| Some((key.frame, key.whole()?))).collect()
    }

    fn pin_poses(&mut self, poses: &BTreeMap<usize, Vec<Quat>>) {
        let pins = poses
            .iter()
            .map(|(&frame, rotations)| PosePin { frame, rotations });
        let pins: Vec<PosePin<'_>> = pins.collect();
        let joints = self.body.skeleton.joint_count();
        pin_poses(&mut self.track.rotations, joints, &pins, PIN_REACH_FRAMES);
    }

    fn meet_poses(&mut self) {
        let mut poses = self.whole();
        if self.take.is_loop {
            let first = poses
                .get(&0)
                .cloned()
                .unwrap_or_else(|| self.track.pose(0).to_vec());
            poses.insert(self.last(), first);
        }
        self.pin_poses(&poses);
    }

    /// Holds standing feet still between the frames with whole poses.
    fn hold_feet(&mut self) {
        let count = self.track.len();
        let mut ends: Vec<usize> = self.whole().into_keys().collect();
        if self.take.is_loop {
            ends.extend([0, count - 1]);
        }
        ends.sort_unstable();
        ends.dedup();
        let mut ranges: Vec<Range<usize>> = Vec::with_capacity(ends.len() + 1);
        let mut from = 0;
        for end in ends {
            ranges.push(from..end);
            from = end + 1;
        }
        ranges.push(from..count);
        let ranges = ranges.into_iter().filter(|range| !range.is_empty());
        let steps = self.take.subject.follower.is_some() || self.is_bent;
        if steps && self.take.onto.is_none() {
            for range in ranges {
                plant(&self.take.subject.rig, self.track.columns(), range, None);
            }
            return;
        }
        let Body {
            skeleton,
            legs,
            scale,
            ..
        } = self.body;
        for range in ranges {
            let options = FootLock {
                max_offset_m: scale * HELD_M,
                // The root keeps its path and its height.
                max_drop_m: 0.0,
                floor_m: Some(0.0),
                ..FootLock::over(range)
            };
            let Track {
                roots,
                rotations,
                contacts,
            } = &mut self.track;
            lock_feet(skeleton, legs, roots, rotations, contacts, &options);
        }
    }

    /// Lifts the motion, which the model made for a floor at height 0, onto the ground.
    fn lift(&mut self) {
        let Body {
            skeleton,
            legs,
            wanted: Wanted { ground, .. },
            ..
        } = self.body;
        if let Some(level) = ground.level() {
            self.track.roots.iter_mut().for_each(|root| root.y += level);
            return;
        }
        let Track {
            roots,
            rotations,
            contacts,
        } = &mut self.track;
        let height = |x: f32, z: f32| ground.height(x, z).unwrap_or(f32::NAN);
        let short_m = lift_motion(
            skeleton,
            legs,
            roots,
            rotations,
            contacts,
            height,
            &Terrain::default(),
        );
        let message = "the motion was made on level ground and lifted: feet take the height of the nearest point, \
                       and legs bend for it, in keyframes too";
        self.notes.push(Note::info("ground_lifted", message));
        if short_m > NOTED_M / 2.0 {
            self.warn(
                "ground_steep",
                format!("a leg is up to {short_m:.2} m too short for the ground"),
            );
        }
    }

    /// Meets partial poses and positions of joints, with a transition of a few frames on either
    /// side.
    fn meet_parts(&mut self) {
        let mut poses = BTreeMap::new();
        let mut kept = self.whole();
        let keys = self.body.wanted.keys.iter();
        for key in keys.filter(|key| key.whole().is_none() && key.frame < self.track.len()) {
            let mut pose = self.track.pose(key.frame).to_vec();
            for (rotation, given) in pose.iter_mut().zip(&key.rotations) {
                *rotation = given.unwrap_or(*rotation);
            }
            poses.insert(key.frame, pose);
        }
        let mut missed = 0.0_f32;
        for (frame, effectors) in self.effectors() {
            let base = poses
                .remove(&frame)
                .unwrap_or_else(|| self.track.pose(frame).to_vec());
            let points: Vec<(usize, Vec3)> = effectors
                .iter()
                .map(|effector| (effector.joint, effector.point))
                .collect();
            let mut reached = self.reach(frame, &base, &points);
            missed = reached.errors_m.iter().copied().fold(missed, f32::max);
            for effector in &effectors {
                self.turn(frame, effector, &mut reached.rotations);
            }
            poses.insert(frame, reached.rotations);
        }
        if missed > MISSED_M {
            self.warn(
                "effector_missed",
                format!("an effector is missed by up to {missed:.2} m"),
            );
        }
        if poses.is_empty() {
            return;
        }
        // All other given poses stay as they are at this step.
        kept.retain(|frame, _| !poses.contains_key(frame));
        if self.take.is_loop {
            kept.insert(0, Vec::new());
            kept.insert(self.last(), Vec::new());
        }
        for frame in kept.into_keys() {
            let pose = self.track.pose(frame).to_vec();
            poses.entry(frame).or_insert(pose);
        }
        self.pin_poses(&poses);
    }

    /// Turns a joint to the rotation that an effector asks for.
    fn turn(&self, frame: usize, effector: &Effector, pose: &mut [Quat]) {
        let joint = &self.body.skeleton.joints[effector.joint];
        let (Some(rotation), Some(parent)) = (effector.rotation, joint.parent) else {
            return;
        };
        let above = joint_transform(self.body.skeleton, self.track.roots[frame], pose, parent).1;
        pose[effector.joint] = (above.inverse() * rotation).normalize();
    }

    /// Gives the last frame the pose and height of the first.
    fn close(&mut self) {
        let last = self.last();
        let up = self.track.roots[0].y - self.track.roots[last].y;
        let reach = PIN_REACH_FRAMES.min(last);
        for back in 0..reach {
            let share = 1.0 - smoothstep(back as f32 / reach as f32);
            self.track.roots[last - back].y += up * share;
        }
        let first = self.track.pose(0).to_vec();
        self.pin_poses(&BTreeMap::from([(last, first)]));
    }
}

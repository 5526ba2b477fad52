//! A hand that carries something: while locomotion moves the rest, it is kept where it was, before
//! the hips.
//!
//! As [`super::Footing`] lifts frames as they are shown, this bends the arm: plans know nothing of
//! it.

use serde::{Deserialize, Serialize};
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{Posed, arm_of, place_end};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::Body;
use crate::object::Socket;
use crate::scene::Transform;

/// Frames over which an arm goes over to other motion, or back to where it carries.
pub(super) const RAMP_FRAMES: i64 = 10;
/// Share of the arm's length over which it eases towards its reach.
const SOFT: f32 = 0.02;
/// Ramps that began so many frames before the newest are not asked for any more.
const KEPT_FRAMES: i64 = 64;

/// How much a character's arm carries, from frame to frame.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::live) struct Carry {
    grip: Option<Grip>,
    /// What was carried is in the hand no more.
    over: bool,
    /// Locomotion moves the frames behind this one. Who has something in the hand then carries it:
    /// not before, for what is taken or put down in that frame is not known when a plan comes.
    due: Option<i64>,
    /// The last frame of which that is known.
    settled: i64,
    /// In the order of their first frames; before the first nothing is carried.
    ramps: Vec<Ramp>,
}

/// An arm as it carries.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Grip {
    /// Upper, middle and end joint.
    chain: [usize; 3],
    /// Rotations of the upper and the middle joint, relative to their parents: the elbow keeps to
    /// its side.
    bent: [Quat; 2],
    /// The end joint in the frame of the root and its heading.
    end: Transform,
}

/// Behind frame `start` the weight goes over to `to`. That frame itself may have been shown before
/// the ramp was known.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Ramp {
    start: i64,
    frames: i64,
    from: f32,
    to: f32,
}

impl Ramp {
    fn at(&self, frame: i64, part: f32) -> f32 {
        let gone = (frame - self.start) as f32 + part;
        let share = match self.frames {
            0 => 1.0,
            frames => smoothstep((gone / frames as f32).min(1.0)),
        };
        self.from + (self.to - self.from) * share
    }
}

impl Carry {
    /// Bends the arm of a frame that is shown, `part` of the way (0 to 1) from `frame` to the next.
    /// Where nothing is carried, nothing changes.
    pub(in crate::live) fn bend(
        &self,
        skeleton: &Skeleton,
        frame: i64,
        part: f32,
        root: Vec3,
        rotations: &mut [Quat],
    ) {
        let Some(grip) = &self.grip else { return };
        let weight = self.weight(frame, part);
        if weight > 0.0 {
            grip.bend(skeleton, root, rotations, weight);
        }
    }

    fn weight(&self, frame: i64, part: f32) -> f32 {
        let mut latest = self.ramps.iter().rev();
        let ramp = latest.find(|ramp| ramp.start < frame || (ramp.start == frame && part > 0.0));
        ramp.map_or(0.0, |ramp| ramp.at(frame, part))
    }

    /// What the weight is, or is on its way to.
    fn goes_to(&self) -> f32 {
        self.ramps.last().map_or(0.0, |ramp| ramp.to)
    }

    fn go(&mut self, start: i64, frames: i64, to: f32) {
        let from = if frames == 0 { to } else { self.weight(start, 0.0) };
        self.ramps.retain(|ramp| ramp.start < start);
        let old = |ramp: &Ramp| ramp.start <= start - KEPT_FRAMES;
        if let Some(last) = self.ramps.iter().rposition(old) {
            self.ramps.drain(..last);
        }
        let ramp = Ramp {
            start,
            frames,
            from,
            to,
        };
        self.ramps.push(ramp);
    }

    /// The last frame that was settled.
    pub(super) fn settled(&self) -> i64 {
        self.settled
    }

    /// Locomotion moves the frames behind `start`.
    pub(super) fn due(&mut self, start: i64) {
        self.due.get_or_insert(start);
    }

    /// Other motion moves the arm behind frame `start`, and `frames` or at most [`RAMP_FRAMES`]
    /// later it alone.
    pub(super) fn rest(&mut self, start: i64, frames: i64) {
        self.due = None;
        if self.goes_to() > 0.0 {
            self.go(start, frames.clamp(1, RAMP_FRAMES), 0.0);
        }
    }

    /// Nothing is in the hand any more behind frame `frame`.
    fn let_go(&mut self, frame: i64) {
        if !self.over {
            self.over = true;
            self.rest(frame, RAMP_FRAMES);
        }
    }
}

impl Grip {
    /// The arm as it is in `posed`; `None` where `joint` does not end one.
    fn of(skeleton: &Skeleton, joint: usize, posed: Posed<'_>) -> Option<Self> {
        let chain = arm_of(skeleton, joint)?;
        let (position, rotation) = joint_transform(skeleton, posed.root, posed.rotations, joint);
        let [upper, middle, _] = chain;
        Some(Self {
            chain,
            bent: [posed.rotations[upper], posed.rotations[middle]],
            end: body(skeleton, posed.root, posed.rotations).inverse() * Transform::new(position, rotation),
        })
    }

    fn bend(&self, skeleton: &Skeleton, root: Vec3, rotations: &mut [Quat], weight: f32) {
        let [upper, middle, end] = self.chain;
        let (place, turn) = joint_transform(skeleton, root, rotations, end);
        let kept = body(skeleton, root, rotations) * self.end;
        let goal = place.lerp(kept.position, weight);
        let turn = turn.slerp(kept.rotation, weight);
        for (joint, bent) in [upper, middle].into_iter().zip(self.bent) {
            rotations[joint] = rotations[joint].slerp(bent, weight).normalize();
        }
        let goal = (goal, SOFT);
        place_end(skeleton, root, rotations, self.chain, goal, Vec3::NEG_Y, turn);
    }
}

/// The frame of a root and its heading.
fn body(skeleton: &Skeleton, root: Vec3, rotations: &[Quat]) -> Transform {
    let pelvis = rotations.first().copied().unwrap_or_default();
    let heading = GlobalRoot::of_pose(root, pelvis, skeleton.left_axis).heading;
    Transform::new(root, yaw(heading))
}

impl Body<'_> {
    /// What the arm does behind the frames up to `frame`, which are settled, with something in
    /// `socket` or nothing.
    pub(super) fn settle_arm(&mut self, frame: i64, socket: Option<&Socket>) {
        self.carry.settled = frame;
        let due = self.carry.due.take_if(|due| *due <= frame);
        match (socket, due) {
            (None, _) => self.carry.let_go(frame),
            (Some(socket), Some(start)) if !socket.swings => self.carry_on(start, socket.joint),
            (Some(_), _) => {}
        }
    }

    /// The hand stays where it is in frame `start`, or goes back to where it was when it began to
    /// carry, if something else has moved it since.
    fn carry_on(&mut self, start: i64, hand: usize) {
        let again = self.carry.grip.is_some() && !self.carry.over;
        if again && self.carry.goes_to() < 1.0 {
            self.carry.go(start, RAMP_FRAMES, 1.0);
        }
        if again {
            return;
        }
        let shown = self.shown(start);
        if let Some(grip) = Grip::of(&self.rig.skeleton, hand, shown.posed()) {
            self.carry.grip = Some(grip);
            self.carry.over = false;
            self.carry.go(start, 0, 1.0);
        }
    }
}

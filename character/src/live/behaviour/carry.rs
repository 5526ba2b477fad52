//! A hand that carries something. While locomotion moves the rest of the body, the hand stays at
//! its place in front of the hips.
//!
//! The arm is bent as frames are shown, just as [`super::Footing`] lifts them. Plans do not know of
//! it.

use serde::{Deserialize, Serialize};
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{Posed, arm_of, place_end};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::CharacterParts;
use crate::object::Socket;
use crate::scene::Transform;

/// Frames over which an arm changes between carrying and other motion.
pub(super) const RAMP_FRAMES: i64 = 10;
/// Share of the arm's length over which it eases towards full reach.
const SOFT: f32 = 0.02;
/// Ramps that began this many frames before the newest are forgotten.
const KEPT_FRAMES: i64 = 64;

/// The weight of carrying over the frames: 0 leaves the arm to the motion, 1 holds it in place.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(in crate::live) struct Carry {
    grip: Option<Grip>,
    /// The hand has let go of what it carried.
    over: bool,
    /// Locomotion moves the frames after this one, and an object in the hand is carried in them.
    /// Decided no sooner: an object taken or put down in that very frame is not known when the plan
    /// arrives.
    due: Option<i64>,
    /// The newest settled frame: what the hand holds up to here is known.
    settled: i64,
    /// In the order of their first frames. The weight before the first is 0.
    ramps: Vec<Ramp>,
}

/// The arm's place and bend while it carries.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Grip {
    /// Upper, middle and end joint: for example shoulder, elbow, wrist.
    chain: [usize; 3],
    /// Rotations of the upper and the middle joint relative to their parents, so that the elbow
    /// stays on its side.
    bent: [Quat; 2],
    /// The end joint relative to the root on the ground and its heading.
    end: Transform,
}

/// After frame `start` the weight changes to `to`. Frame `start` itself may have been shown
/// already.
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
    /// Bends the arm in a frame that is shown, `part` of the way (0 to 1) from `frame` to the next.
    /// Changes nothing if the hand carries nothing.
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

    /// The weight that the newest ramp leads to.
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

    /// The newest settled frame.
    pub(super) fn settled(&self) -> i64 {
        self.settled
    }

    /// Locomotion moves the frames after `start`.
    pub(super) fn due(&mut self, start: i64) {
        self.due.get_or_insert(start);
    }

    /// Other motion moves the arm after frame `start`. It has the arm to itself `frames` later, but
    /// at most after [`RAMP_FRAMES`].
    pub(super) fn rest(&mut self, start: i64, frames: i64) {
        self.due = None;
        if self.goes_to() > 0.0 {
            self.go(start, frames.clamp(1, RAMP_FRAMES), 0.0);
        }
    }

    /// The hand is empty after frame `frame`.
    fn let_go(&mut self, frame: i64) {
        if !self.over {
            self.over = true;
            self.rest(frame, RAMP_FRAMES);
        }
    }
}

impl Grip {
    /// The arm in the pose `posed`; `None` if `joint` is not the end of an arm.
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

/// The root on the ground and its heading, as a frame of reference.
fn body(skeleton: &Skeleton, root: Vec3, rotations: &[Quat]) -> Transform {
    let pelvis = rotations.first().copied().unwrap_or_default();
    let heading = GlobalRoot::of_pose(root, pelvis, skeleton.left_axis).heading;
    Transform::new(root, yaw(heading))
}

impl CharacterParts<'_> {
    /// Decides what the arm does in the frames up to `frame`, with something in `socket` or
    /// nothing.
    pub(super) fn settle_arm(&mut self, frame: i64, socket: Option<&Socket>) {
        self.post.carry.settled = frame;
        let due = self.post.carry.due.take_if(|due| *due <= frame);
        match (socket, due) {
            (None, _) => self.post.carry.let_go(frame),
            (Some(socket), Some(start)) if !socket.swings => self.carry_on(start, socket.joint),
            (Some(_), _) => {}
        }
    }

    /// Keeps the hand in its place of frame `start`. If other motion moved it since it began to
    /// carry, it goes back to its old place.
    fn carry_on(&mut self, start: i64, hand: usize) {
        let again = self.post.carry.grip.is_some() && !self.post.carry.over;
        if again && self.post.carry.goes_to() < 1.0 {
            self.post.carry.go(start, RAMP_FRAMES, 1.0);
        }
        if again {
            return;
        }
        let shown = self.shown(start);
        if let Some(grip) = Grip::of(&self.rig.skeleton, hand, shown.posed()) {
            self.post.carry.grip = Some(grip);
            self.post.carry.over = false;
            self.post.carry.go(start, 0, 1.0);
        }
    }
}

//! A character's motion: past frames that a plan may start from, and frames to come.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

use troupe_motion::interpolate::{blend, smoothstep};
use troupe_motion::rotation::{align_sign, angle_between};
use troupe_motion::{Quat, Vec3};

use super::SUB_FRAMES;

/// Frames over which a new plan takes over from the old one.
pub const CROSSFADE_FRAMES: usize = 8;

/// Share of each frame's velocity that is left in the next when a motion is drawn out beyond its
/// end.
const DRAWN_OUT_VELOCITY: f32 = 0.7;

/// A joint farther than this from its place in a new plan, radians, takes its own way: straight
/// from its place to where the plan has it some frames later. Blending two motions that are about
/// half a turn apart would turn the joint now one way round and now the other. It also hides how a
/// plan begins with a pose that the networks do not know.
const FAR: f32 = 1.0;
/// Frames that a joint takes if it is off by half a turn; at [`FAR`] it takes [`CROSSFADE_FRAMES`].
/// In so few frames a raised arm would come down by 0.4 m a frame.
const FAR_FADE_FRAMES: usize = 24;
/// Highest rate at which such a joint goes on turning from its old place, or turns into its new
/// one, radians a frame.
const MOST_RATE: f32 = 0.15;

/// A joint that is far from its place in a new motion.
#[derive(Debug)]
struct FarJoint {
    joint: usize,
    /// Frames that its way takes.
    frames: usize,
    way: Way,
}

/// The way of a joint from one rotation to another. Each comes with its rate of turn: a rotation
/// vector in the joint's own frame of reference, radians a frame.
#[derive(Debug, Clone, Copy)]
struct Way {
    from: (Quat, Vec3),
    to: (Quat, Vec3),
    /// The turn between the two in the frame before, so that the joint keeps turning the same way
    /// round.
    turn: Quat,
}

impl Way {
    /// A way from `old[0]`, at frame 0, to `new[1]`. The pairs give the rates of turn.
    fn new(old: [Quat; 2], new: [Quat; 2]) -> Self {
        let turn = |[a, b]: [Quat; 2]| {
            let turn = align_sign(a.conjugate() * b, Quat::IDENTITY).to_scaled_axis();
            turn.clamp_length_max(MOST_RATE)
        };
        Self {
            from: (old[0], turn(old)),
            to: (new[1], turn(new)),
            turn: Quat::IDENTITY,
        }
    }

    /// The rotation in frame `step` of `frames`.
    fn at(&mut self, step: usize, frames: usize) -> Quat {
        // Frames of travel that remain of a fading velocity.
        let goes =
            |frames: usize| (1.0 - DRAWN_OUT_VELOCITY.powi(frames as i32)) / (1.0 - DRAWN_OUT_VELOCITY);
        let from = self.from.0 * Quat::from_scaled_axis(self.from.1 * goes(step));
        let to = self.to.0 * Quat::from_scaled_axis(-self.to.1 * goes(frames - step));
        self.turn = align_sign(from.conjugate() * to, self.turn);
        let (axis, angle) = self.turn.to_axis_angle();
        let share = smoothstep(step as f32 / frames as f32);
        (from * Quat::from_axis_angle(axis, angle * share)).normalize()
    }
}

/// Consecutive frames, by column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frames<'a> {
    /// Root positions, one a frame, metres.
    pub(super) roots: &'a [Vec3],
    /// Rotations, `frames * joints`.
    pub(super) rotations: &'a [Quat],
    /// Contacts, one a frame: bit i for contact joint i.
    pub(super) contacts: &'a [u8],
}

impl<'a> Frames<'a> {
    /// All but the first `count` frames.
    fn skip(self, count: usize, joints: usize) -> Self {
        Self {
            roots: self.roots.get(count..).unwrap_or_default(),
            rotations: self.rotations.get(count * joints..).unwrap_or_default(),
            contacts: self.contacts.get(count..).unwrap_or_default(),
        }
    }

    fn pose(&self, index: usize, joints: usize) -> &'a [Quat] {
        &self.rotations[index * joints..][..joints]
    }
}

/// Frames by column as [`Frames`], to be changed.
#[derive(Debug)]
pub(super) struct FramesMut<'a> {
    pub(super) roots: &'a mut [Vec3],
    pub(super) rotations: &'a mut [Quat],
    pub(super) contacts: &'a mut [u8],
    /// The first one that may be changed.
    pub(super) start: usize,
}

/// How a new plan takes over from the old one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fade {
    /// Frames of the fade, at most [`CROSSFADE_FRAMES`].
    pub(super) frames: usize,
    /// The root follows the plan over the ground from the plan's first frame on, which continues
    /// where the old plan was. A fade would hold the root back at first, and then take twice the
    /// acceleration to catch up.
    pub(super) own_way: bool,
}

impl Fade {
    pub(super) const USUAL: Self = Self {
        frames: CROSSFADE_FRAMES,
        own_way: false,
    };
    /// For a plan for a command: users wait for the fade to end.
    pub(super) const COMMAND: Self = Self {
        frames: 5,
        own_way: true,
    };
}

/// How far a frame is from where it should be.
#[derive(Debug)]
pub(super) struct Seam {
    /// Offset of the root, metres.
    pub(super) moved: Vec3,
    /// Rotation of each joint from its pose to the pose that it should have.
    pub(super) turned: Vec<Quat>,
}

/// Frames by column, numbered as on the timeline. There is always at least one. A number outside
/// the buffer stands for the nearest frame in it.
///
/// Memory grows to the longest plan so far and stays: a frame allocates nothing.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct MotionBuffer {
    joints: usize,
    /// Number of the oldest frame; negative at first.
    first: i64,
    roots: Vec<Vec3>,
    /// `frames * joints`, joint 0 in the world. No joint changes its hemisphere between two frames.
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
}

impl MotionBuffer {
    /// A buffer of at least one frame, the first of which has number `first`.
    pub(super) fn new(joints: usize, first: i64, frames: Frames<'_>) -> Self {
        debug_assert!(!frames.roots.is_empty() && frames.rotations.len() == frames.roots.len() * joints);
        let mut buffer = Self {
            joints,
            first,
            roots: Vec::new(),
            rotations: Vec::new(),
            contacts: Vec::new(),
        };
        buffer.append(frames);
        buffer
    }

    /// Number of the oldest frame.
    pub(super) fn first(&self) -> i64 {
        self.first
    }

    /// Number of the newest frame.
    pub(super) fn last(&self) -> i64 {
        self.first + self.roots.len() as i64 - 1
    }

    fn index(&self, frame: i64) -> usize {
        (frame.clamp(self.first, self.last()) - self.first) as usize
    }

    /// Root position of a frame.
    pub(super) fn root(&self, frame: i64) -> Vec3 {
        self.roots[self.index(frame)]
    }

    /// Mean velocity over the ground of the `frames` frames before `frame`, or of as many as there
    /// are, m/s.
    pub(super) fn velocity(&self, frame: i64, frames: i64, fps: f32) -> Vec3 {
        let from = (frame - frames).max(self.first());
        let way = (self.root(frame) - self.root(from)).with_y(0.0);
        way * fps / (frame - from).max(1) as f32
    }

    /// Rotations of a frame, one a joint: joint 0 in the world.
    pub(super) fn pose(&self, frame: i64) -> &[Quat] {
        &self.rotations[self.index(frame) * self.joints..][..self.joints]
    }

    /// The frames after number `frame`, to be changed, and all that are before them.
    pub(super) fn behind_mut(&mut self, frame: i64) -> FramesMut<'_> {
        FramesMut {
            start: (frame + 1 - self.first).clamp(0, self.roots.len() as i64) as usize,
            roots: &mut self.roots,
            rotations: &mut self.rotations,
            contacts: &mut self.contacts,
        }
    }

    /// The frames `from..=to`, as far as the buffer has them.
    pub(super) fn range(&self, from: i64, to: i64) -> Frames<'_> {
        if from > to || from > self.last() || to < self.first {
            return Frames {
                roots: &[],
                rotations: &[],
                contacts: &[],
            };
        }
        let (from, end) = (self.index(from), self.index(to) + 1);
        Frames {
            roots: &self.roots[from..end],
            rotations: &self.rotations[from * self.joints..end * self.joints],
            contacts: &self.contacts[from..end],
        }
    }

    /// Drops the frames before number `frame`.
    pub(super) fn trim(&mut self, frame: i64) {
        let count = self.index(frame);
        self.roots.drain(..count);
        self.rotations.drain(..count * self.joints);
        self.contacts.drain(..count);
        self.first += count as i64;
    }

    /// Checks that all columns have the same number of frames, of `joints` joints.
    ///
    /// # Errors
    /// The lengths that do not fit.
    pub(super) fn check(&self, joints: usize) -> Result<(), String> {
        let (frames, rotations, contacts) = (self.roots.len(), self.rotations.len(), self.contacts.len());
        let fits = self.joints == joints && rotations == frames * joints && contacts == frames;
        match fits && frames > 0 {
            true => Ok(()),
            false => Err(format!(
                "its buffer has {frames} roots, {rotations} rotations of {} joints and {contacts} contacts",
                self.joints
            )),
        }
    }

    /// Moves and turns the frames up to number `frame` by `seam`. The frames after it return to the
    /// rotations and heights that they had.
    pub(super) fn rejoin(&mut self, frame: i64, seam: &Seam) {
        for index in 0..self.roots.len() {
            let behind = (self.first + index as i64 - frame).max(0) as f32;
            let share = 1.0 - smoothstep((behind / CROSSFADE_FRAMES as f32).min(1.0));
            self.roots[index] += seam.moved.with_y(seam.moved.y * share);
            let pose = &mut self.rotations[index * self.joints..][..self.joints];
            for (rotation, turn) in pose.iter_mut().zip(&seam.turned) {
                let turn = Quat::IDENTITY.slerp(align_sign(*turn, Quat::IDENTITY), share);
                *rotation = (turn * *rotation).normalize();
            }
            self.align(index);
        }
    }

    /// Adds frames up to number `to` in which the motion comes to rest.
    pub(super) fn draw_out(&mut self, to: i64) {
        while self.last() < to {
            let now = self.roots.len() - 1;
            let before = now.saturating_sub(1);
            let step = (self.roots[now] - self.roots[before]) * DRAWN_OUT_VELOCITY;
            self.roots.push(self.roots[now] + step);
            for joint in 0..self.joints {
                let rotation = self.rotations[now * self.joints + joint];
                let turn = rotation * self.rotations[before * self.joints + joint].conjugate();
                let turn = Quat::IDENTITY.slerp(turn, DRAWN_OUT_VELOCITY);
                self.rotations.push((turn * rotation).normalize());
            }
            self.contacts.push(self.contacts[now]);
        }
    }

    /// Repeats the last frame up to number `to`.
    pub(super) fn hold(&mut self, to: i64) {
        let last = self.roots.len() - 1;
        while self.last() < to {
            self.roots.push(self.roots[last]);
            self.rotations
                .extend_from_within(last * self.joints..(last + 1) * self.joints);
            self.contacts.push(self.contacts[last]);
        }
    }

    /// Replaces what comes after frame `at`, which must be there, by `frames` at once.
    pub(super) fn replace(&mut self, at: i64, frames: Frames<'_>) {
        let start = self.index(at) + 1;
        self.roots.truncate(start);
        self.rotations.truncate(start * self.joints);
        self.contacts.truncate(start);
        self.append(frames);
    }

    /// Replaces what comes after frame `at` by `plan`, which fades in over its first frames. Joints
    /// that are far from their place take up to [`FAR_FADE_FRAMES`]. An old motion that is too
    /// short for the fade is drawn out.
    pub(super) fn splice(&mut self, at: i64, plan: Frames<'_>, over: Fade) {
        let usual = CROSSFADE_FRAMES.min(plan.roots.len());
        self.draw_out(at + usual as i64);
        let start = self.index(at) + 1;
        let mut far = self.far_joints(start, &plan, usual);
        let longest = far
            .iter()
            .map(|far| far.frames)
            .fold(over.frames.min(usual), usize::max);
        self.draw_out(at + longest as i64);
        for step in 0..longest {
            self.fade((start + step, step), &plan, over, &mut far);
        }
        self.roots.truncate(start + longest);
        self.rotations.truncate((start + longest) * self.joints);
        self.contacts.truncate(start + longest);
        self.append(plan.skip(longest, self.joints));
    }

    /// The joints that are far from their place in `plan`, whose first frame has index `start`.
    /// Mostly none.
    fn far_joints(&self, start: usize, plan: &Frames<'_>, fade: usize) -> Vec<FarJoint> {
        if fade < CROSSFADE_FRAMES {
            return Vec::new();
        }
        // A plan ends in its target, which must hold completely.
        let most = FAR_FADE_FRAMES.min(plan.roots.len() * 3 / 4).max(fade);
        let far = |joint: usize| {
            let old = |step: usize| self.rotations[(start + step) * self.joints + joint];
            let new = |step: usize| plan.pose(step.min(plan.roots.len() - 1), self.joints)[joint];
            let apart = (0..fade).map(|step| angle_between(old(step), new(step)));
            if apart.fold(0.0, f32::max) <= FAR {
                return None;
            }
            let far = ((angle_between(old(0), new(0)) - FAR) / (PI - FAR)).clamp(0.0, 1.0);
            let frames = fade + (far * (most - fade) as f32).round() as usize;
            let way = Way::new([old(0), old(1)], [new(frames - 1), new(frames)]);
            Some(FarJoint { joint, frames, way })
        };
        (0..self.joints).filter_map(far).collect()
    }

    /// Blends the frame at `index` towards frame `step` of the plan.
    fn fade(&mut self, (index, step): (usize, usize), plan: &Frames<'_>, over: Fade, far: &mut [FarJoint]) {
        let rotations = &mut self.rotations[index * self.joints..][..self.joints];
        if step < over.frames {
            let weight = smoothstep((step + 1) as f32 / (over.frames + 1) as f32);
            let faded = self.roots[index].lerp(plan.roots[step], weight);
            self.roots[index] = match over.own_way {
                true => plan.roots[step].with_y(faded.y),
                false => faded,
            };
            for (old, new) in rotations.iter_mut().zip(plan.pose(step, self.joints)) {
                *old = old.slerp(*new, weight).normalize();
            }
            if weight >= 0.5 {
                self.contacts[index] = plan.contacts[step];
            }
        } else {
            self.roots[index] = plan.roots[step];
            rotations.copy_from_slice(plan.pose(step, self.joints));
            self.contacts[index] = plan.contacts[step];
        }
        for far in far.iter_mut().filter(|far| step < far.frames) {
            rotations[far.joint] = far.way.at(step, far.frames);
        }
        self.align(index);
    }

    fn append(&mut self, frames: Frames<'_>) {
        let from = self.roots.len();
        self.roots.extend_from_slice(frames.roots);
        self.rotations.extend_from_slice(frames.rotations);
        self.contacts.extend_from_slice(frames.contacts);
        for index in from..self.roots.len() {
            self.align(index);
        }
    }

    /// Keeps the rotations of a frame in the hemisphere of the frame before.
    fn align(&mut self, index: usize) {
        let Some(before) = index.checked_sub(1) else {
            return;
        };
        for joint in 0..self.joints {
            let reference = self.rotations[before * self.joints + joint];
            let rotation = &mut self.rotations[index * self.joints + joint];
            *rotation = align_sign(*rotation, reference);
        }
    }

    /// The motion at `cursor`, in sub-frames: roots linear, rotations spherical between two frames,
    /// contacts of the nearer frame. Writes rotations to `out`, returns root and contacts.
    pub(super) fn sample(&self, cursor: i64, out: &mut Vec<Quat>) -> (Vec3, u8) {
        let sub_frames = i64::from(SUB_FRAMES);
        let (frame, rest) = (cursor.div_euclid(sub_frames), cursor.rem_euclid(sub_frames));
        let (from, to) = (self.index(frame), self.index(frame + 1));
        if rest == 0 || from == to {
            out.clear();
            out.extend_from_slice(self.pose(frame));
            return (self.roots[from], self.contacts[from]);
        }
        let part = rest as f32 / SUB_FRAMES as f32;
        out.resize(self.joints, Quat::IDENTITY);
        let root = blend(
            (self.roots[from], self.pose(frame)),
            (self.roots[to], self.pose(frame + 1)),
            part,
            out,
        );
        let nearer = if part < 0.5 { from } else { to };
        (root, self.contacts[nearer])
    }
}

#[cfg(test)]
#[path = "buffer_tests.rs"]
mod tests;

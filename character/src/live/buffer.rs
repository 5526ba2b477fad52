//! A character's motion: frames of the past that a plan may start from, and of the future.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

use troupe_motion::interpolate::{blend, smoothstep};
use troupe_motion::rotation::{align_sign, angle_between};
use troupe_motion::{Quat, Vec3};

use super::SUB_FRAMES;

/// Frames over which a new plan takes over from the old one.
pub const CROSSFADE_FRAMES: usize = 8;

/// What is left of each frame's velocity in the next, where a motion is drawn out beyond its end.
const DRAWN_OUT_VELOCITY: f32 = 0.7;

/// Joints that are farther than this from where a new plan has them, radians, go over in another
/// way: straight from where they are to where it has them some frames later. To blend two motions
/// that are about half a turn apart would have them go now this way round and now that; and what a
/// plan does at first with a pose that the networks do not know is better not shown.
const FAR: f32 = 1.0;
/// Frames over which a joint goes over that is half a turn off; one that is [`FAR`] off takes
/// [`CROSSFADE_FRAMES`]. A raised arm that came down in so few would go 0.4 m in a frame.
const FAR_FADE_FRAMES: usize = 24;
/// Most that such a joint goes on turning from where it is, or turns into where it goes, radians a
/// frame.
const MOST_RATE: f32 = 0.15;

/// A joint that is far from where a new motion has it.
#[derive(Debug)]
struct FarJoint {
    joint: usize,
    /// Frames over which it goes there.
    frames: usize,
    way: Way,
}

/// The way of a joint from one rotation to another, each with how it turns there: about an axis in
/// its own frame, radians a frame.
#[derive(Debug, Clone, Copy)]
struct Way {
    from: (Quat, Vec3),
    to: (Quat, Vec3),
    /// The turn between the two in the frame before: the way round is kept.
    turn: Quat,
}

impl Way {
    /// From the first of `old`, frame 0, to the last of `new`, with what they turn by between the
    /// two.
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
        // How far what is left of a velocity brings it.
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
    /// Root positions, one a frame.
    pub(super) roots: &'a [Vec3],
    /// Rotations, `frames * joints`.
    pub(super) rotations: &'a [Quat],
    /// Contacts, one a frame.
    pub(super) contacts: &'a [u8],
}

impl<'a> Frames<'a> {
    /// Without the first `count` frames.
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

/// How a new plan takes over from the old one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fade {
    /// Frames over which it does, [`CROSSFADE_FRAMES`] at most.
    pub(super) frames: usize,
    /// The root goes the plan's way over the ground from its first frame on, which carries on from
    /// where the old plan was. Faded in it would stay behind at first, and then catch up with twice
    /// the acceleration.
    pub(super) own_way: bool,
}

impl Fade {
    pub(super) const USUAL: Self = Self {
        frames: CROSSFADE_FRAMES,
        own_way: false,
    };
    /// That of a plan for a command: what it fades in over is waited for.
    pub(super) const COMMAND: Self = Self {
        frames: 5,
        own_way: true,
    };
}

/// How far a frame is from what it is to be.
#[derive(Debug)]
pub(super) struct Seam {
    /// The root, metres.
    pub(super) moved: Vec3,
    /// For each joint, by what it is turned.
    pub(super) turned: Vec<Quat>,
}

/// Frames by column and by their number on the timeline. It always holds at least one frame; frame
/// numbers that it does not hold stand for the nearest that it does.
///
/// Memory grows to the longest plan that came and stays: nothing is allocated for a frame.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct MotionBuffer {
    joints: usize,
    /// Number of the oldest frame.
    first: i64,
    roots: Vec<Vec3>,
    /// `frames * joints`, joint 0 in the world; no joint changes its hemisphere from one frame to
    /// the next.
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
}

impl MotionBuffer {
    /// A buffer of the frames from number `first` on; there must be at least one.
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

    /// Mean velocity over the ground of so many frames before `frame`, of those that are there,
    /// m/s.
    pub(super) fn velocity(&self, frame: i64, frames: i64, fps: f32) -> Vec3 {
        let from = (frame - frames).max(self.first());
        let way = (self.root(frame) - self.root(from)).with_y(0.0);
        way * fps / (frame - from).max(1) as f32
    }

    /// Rotations of a frame, one a joint.
    pub(super) fn pose(&self, frame: i64) -> &[Quat] {
        &self.rotations[self.index(frame) * self.joints..][..self.joints]
    }

    /// Roots and rotations of the frames behind number `frame`, to be changed.
    pub(super) fn behind_mut(&mut self, frame: i64) -> (&[Vec3], &mut [Quat]) {
        let start = (frame + 1 - self.first).clamp(0, self.roots.len() as i64) as usize;
        (&self.roots[start..], &mut self.rotations[start * self.joints..])
    }

    /// The frames `from..=to`, as far as they are there.
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

    /// Forgets the frames before number `frame`.
    pub(super) fn trim(&mut self, frame: i64) {
        let count = self.index(frame);
        self.roots.drain(..count);
        self.rotations.drain(..count * self.joints);
        self.contacts.drain(..count);
        self.first += count as i64;
    }

    /// Whether all columns have as many frames, of `joints` joints.
    ///
    /// # Errors
    /// What does not fit.
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

    /// Frames up to number `frame` are moved and turned as `seam` says, and those behind it go over
    /// to the rotations and heights that they had.
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

    /// Adds frames up to number `to`, all like the last.
    pub(super) fn hold(&mut self, to: i64) {
        let last = self.roots.len() - 1;
        while self.last() < to {
            self.roots.push(self.roots[last]);
            self.rotations
                .extend_from_within(last * self.joints..(last + 1) * self.joints);
            self.contacts.push(self.contacts[last]);
        }
    }

    /// Replaces what comes behind frame `at`, which must be there, by `frames`, at once.
    pub(super) fn replace(&mut self, at: i64, frames: Frames<'_>) {
        let start = self.index(at) + 1;
        self.roots.truncate(start);
        self.rotations.truncate(start * self.joints);
        self.contacts.truncate(start);
        self.append(frames);
    }

    /// Replaces what comes behind frame `at` by `plan`, which fades in over its first frames,
    /// joints that are far from where it has them over up to [`FAR_FADE_FRAMES`]. Where the old
    /// motion is too short for that it is drawn out.
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

    /// The joints that are far from where `plan` has them, whose first frame comes to `start`: most
    /// often none.
    fn far_joints(&self, start: usize, plan: &Frames<'_>, fade: usize) -> Vec<FarJoint> {
        if fade < CROSSFADE_FRAMES {
            return Vec::new();
        }
        // A plan ends in what it was made for: by then all of it counts.
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

    /// Moves the frame at `index` towards frame `step` of the plan.
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

    /// Keeps the rotations of a frame in the hemisphere of those before.
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

    /// The motion at `cursor`, in sub-frames: linear between two frames' roots, spherical between
    /// rotations, contacts of the nearer frame. Rotations go to `out`; root and contacts come back.
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

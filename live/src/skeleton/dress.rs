//! The way of one character onto a user's skeleton, frame by frame.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_character::live::{Character, FrameOut};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::retarget::{Holds, Memory, Retargeter};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::difference::{self, Difference};

/// Frames over which a character goes from a pose that its client gave to the pose as it is carried
/// over.
const EASE_FRAMES: f32 = 8.0;
/// Duration of a frame, seconds.
const FRAME_S: f32 = 1.0 / 30.0;

/// The way of one character onto a user's skeleton. It remembers the pose before.
#[derive(Debug)]
pub struct Dress {
    onto: Retargeter,
    last: Last,
    /// Joints of the pack that are held at places, reused.
    reaches: Vec<usize>,
    /// Counts the character of a session among the skeleton's wearers.
    wearer: Option<Arc<()>>,
}

/// What the next frame of a character takes from those before.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Last {
    /// Rotations as they were carried over, one a joint of the user's skeleton.
    pose: Vec<Quat>,
    /// Of the retargeter.
    memory: Memory,
    /// Time of the pose: a frame, or a place between two frames. None before the first.
    frame: Option<f64>,
    /// Root of the last frame that was shown, and its time.
    shown: Option<(f64, Vec3)>,
    /// How far each hand holds on, and how far the hips are on a seat, 0 to 1.
    holds: [f32; 3],
    ease: Option<Ease>,
}

/// From the pose as it is carried over to one that the client gave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Ease {
    /// The frame of the given pose.
    frame: f64,
    difference: Difference,
}

impl Dress {
    /// The way of `onto`, from the beginning of a motion on.
    pub(super) fn new(mut onto: Retargeter, wearer: Option<Arc<()>>) -> Self {
        onto.reset();
        let joints = onto.figures()[1].skeleton().joint_count();
        Self {
            onto,
            last: Last {
                pose: vec![Quat::IDENTITY; joints],
                ..Last::default()
            },
            reaches: Vec::new(),
            wearer,
        }
    }

    /// A copy for a look at later frames. It is no wearer of the skeleton.
    pub(crate) fn glimpse(&self) -> Self {
        Self {
            onto: self.onto.clone(),
            last: self.last.clone(),
            reaches: Vec::new(),
            wearer: None,
        }
    }

    /// The character wears the skeleton no longer. A step under way may still finish with it.
    pub(crate) fn take_off(&mut self) {
        self.wearer = None;
    }

    /// What the next frame takes from those before, for [`Dress::resume`].
    pub(crate) fn last(&self) -> Last {
        Last {
            memory: self.onto.memory(),
            ..self.last.clone()
        }
    }

    /// Goes on after the frames of another one. Answers whether those were on the same joints.
    #[must_use]
    pub(crate) fn resume(&mut self, last: Last) -> bool {
        let joints = self.last.pose.len();
        let turns = last.ease.as_ref().map_or(joints, |ease| ease.difference.joints());
        if [last.pose.len(), turns] != [joints; 2] {
            return false;
        }
        self.onto.resume(last.memory);
        self.last = last;
        true
    }

    /// Carries the frame at the cursor of `character` over. It replaces the frame. Hands that hold
    /// an object or on to a place of the scene are where the character's hands are, in the user's
    /// size, and so are hips on a seat.
    pub fn put_on(&mut self, character: &Character, out: &mut FrameOut) {
        character.reaches(&mut self.reaches);
        let sits = self.reaches.contains(&0);
        self.reaches.extend(character.held().map(|held| held.joint));
        // Feet stand on flat ground to the retargeter.
        let lift = Vec3::Y * character.lift().root_m;
        let time = character.time_frames();
        let root = self.carry_holding((time, sits), out.root - lift, &out.rotations);
        out.root = root + self.onto.scale() * lift;
        self.show(time, out);
    }

    /// As [`Dress::put_on`], for a frame that is not at the cursor.
    pub fn put_on_later(&mut self, out: &mut FrameOut) {
        let time = out.frame as f64;
        self.pass(time);
        out.root = self.carry(out.root, &out.rotations);
        self.show(time, out);
    }

    /// Frames from the last pose to that of a time, which is the next one.
    fn pass(&mut self, time: f64) -> f32 {
        let before = self.last.frame.replace(time);
        let frames = before.map_or(0.0, |before| (time - before).max(0.0) as f32);
        self.onto.set_step(frames * FRAME_S);
        frames
    }

    /// Carries a pose over with hands that hold on, and hips that sit. They take [`EASE_FRAMES`] to
    /// get there and to let go.
    fn carry_holding(&mut self, (time, sits): (f64, bool), root: Vec3, rotations: &[Quat]) -> Vec3 {
        let step = self.pass(time) / EASE_FRAMES;
        let [left, right] = self.hands();
        for (hold, is_held) in self.last.holds.iter_mut().zip([left, right, sits]) {
            *hold = (*hold + if is_held { step } else { -step }).clamp(0.0, 1.0);
        }
        let [left, right, hips] = self.last.holds.map(smoothstep);
        let free = Holds {
            hips,
            ..Holds::default()
        };
        let free = (self.onto).pose_holding(root, rotations, free, &mut self.last.pose);
        if [left, right] == [0.0; 2] {
            return free;
        }
        let [pack, own] = self.onto.figures();
        let (Some(arms), Some(of_own)) = (&pack.parts().arms, &own.parts().arms) else {
            return free;
        };
        let goal = |side: usize, hold: f32| {
            let there = place_of(pack.skeleton(), root, rotations, arms[side].end);
            let own = place_of(own.skeleton(), free, &self.last.pose, of_own[side].end);
            (hold > 0.0).then(|| (own / self.onto.scale()).lerp(there, hold))
        };
        let holds = Holds {
            hands: [goal(0, left), goal(1, right)],
            hips,
        };
        // No time has passed.
        self.onto.set_step(0.0);
        (self.onto).pose_holding(root, rotations, holds, &mut self.last.pose)
    }

    /// The root of the frame at the cursor of `character`, if that is the last one that was shown.
    pub(crate) fn root_at_cursor(&self, character: &Character) -> Option<Vec3> {
        let (time, root) = self.last.shown?;
        (time == character.time_frames()).then_some(root)
    }

    /// Whether each hand holds on.
    fn hands(&self) -> [bool; 2] {
        let pack = self.onto.figures()[0];
        let joints = &pack.skeleton().joints;
        let line = |joint: usize| std::iter::successors(Some(joint), |&joint| joints[joint].parent);
        let holds = |wrist: usize| {
            self.reaches
                .iter()
                .any(|&held| line(held).any(|joint| joint == wrist))
        };
        let arms = pack.parts().arms.as_ref().filter(|_| !self.reaches.is_empty());
        arms.map_or([false; 2], |arms| arms.each_ref().map(|arm| holds(arm.end)))
    }

    /// Makes the last pose the frame.
    fn show(&mut self, time: f64, out: &mut FrameOut) {
        out.rotations.clear();
        out.rotations.extend_from_slice(&self.last.pose);
        self.settle(time, out);
        self.last.shown = Some((time, out.root));
        if let Some(robot) = &self.onto.figures()[1].skeleton().robot {
            robot.fit(&mut out.rotations, &mut out.fitted);
        } else {
            out.fitted.clear();
        }
    }

    /// Carries the next pose over, and returns its root. [`Dress::pose`] has its rotations.
    pub fn carry(&mut self, root: Vec3, rotations: &[Quat]) -> Vec3 {
        self.onto.pose(root, rotations, &mut self.last.pose)
    }

    /// The rotations of the last pose.
    pub fn pose(&self) -> &[Quat] {
        &self.last.pose
    }

    /// Begins at the frame at the cursor of `character`, whose pose the client gave: root and
    /// rotations on its skeleton.
    pub fn begin(&mut self, given: (Vec3, &[Quat]), character: &Character) {
        let mut made = FrameOut::default();
        character.sample(&mut made);
        let lift = Vec3::Y * character.lift().root_m;
        let time = character.time_frames();
        self.pass(time);
        let root = self.carry(made.root - lift, &made.rotations) + self.onto.scale() * lift;
        let figure = self.onto.figures()[1];
        let difference = Difference::between(figure, (root, &self.last.pose), given);
        self.last.shown = Some((time, given.0));
        self.last.ease = Some(Ease {
            frame: time,
            difference,
        });
    }

    /// Adds what is left of the way from a given pose.
    fn settle(&mut self, time: f64, out: &mut FrameOut) {
        let Some(ease) = &self.last.ease else {
            return;
        };
        let away = (time - ease.frame).max(0.0) as f32 / EASE_FRAMES;
        let share = smoothstep((1.0 - away).max(0.0));
        if share <= 0.0 {
            self.last.ease = None;
            return;
        }
        let shares = [(share, &ease.difference)];
        difference::add(self.onto.figures()[1], &shares, &mut out.root, &mut out.rotations);
    }
}

/// World position of a joint.
fn place_of(skeleton: &Skeleton, root: Vec3, rotations: &[Quat], joint: usize) -> Vec3 {
    let (mut place, mut at) = (Vec3::ZERO, joint);
    // From the joint up: each parent turns what is below it.
    while let Some(parent) = skeleton.joints[at].parent {
        place = rotations[parent] * (skeleton.joints[at].offset_m + place);
        at = parent;
    }
    root + place
}

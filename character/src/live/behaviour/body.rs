//! What acting works on: the character's motion, as it is planned and as it is shown.

use troupe_motion::ik::Posed;
use troupe_motion::robot::Fitted;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::super::timeline::Timeline;
use super::super::{CROSSFADE_FRAMES, CharacterOptions};
use super::{Carry, Footing};
use crate::primitives::{Locomotion, LocomotionCommand};
use crate::scene::Scene;
use crate::skill::Skills;
use troupe_motion::model::Rig;

/// Frames of motion that are kept beyond where the next plan takes over, while a pose is held.
const HELD_FRAMES: i64 = 16;

/// What acting works on: the character, apart from what it is about.
pub(in crate::live) struct Body<'a> {
    pub(in crate::live) rig: &'a Rig,
    pub(in crate::live) options: &'a CharacterOptions,
    pub(in crate::live) timeline: &'a mut Timeline,
    pub(in crate::live) locomotion: &'a mut Locomotion,
    pub(in crate::live) footing: &'a mut Footing,
    pub(in crate::live) carry: &'a mut Carry,
    pub(in crate::live) skills: &'a Skills,
}

/// One frame as it is shown.
pub(super) struct Shown {
    pub(super) root: Vec3,
    pub(super) rotations: Vec<Quat>,
}

impl Shown {
    pub(super) fn posed(&self) -> Posed<'_> {
        Posed {
            root: self.root,
            rotations: &self.rotations,
        }
    }
}

impl Body<'_> {
    /// A frame of the buffer as it is shown.
    pub(super) fn shown(&self, frame: i64) -> Shown {
        let buffer = self.timeline.buffer();
        let mut root = buffer.root(frame);
        let mut rotations = buffer.pose(frame).to_vec();
        let skeleton = &self.rig.skeleton;
        self.footing.lift(skeleton, frame, 0.0, &mut root, &mut rotations);
        self.carry.bend(skeleton, frame, 0.0, root, &mut rotations);
        if let Some(robot) = &skeleton.robot {
            robot.fit(&mut rotations, &mut Fitted::default());
        }
        Shown { root, rotations }
    }

    /// A frame of the buffer as it is: heights count from what the character stands on.
    pub(super) fn flat(&self, frame: i64) -> Posed<'_> {
        let buffer = self.timeline.buffer();
        Posed {
            root: buffer.root(frame),
            rotations: buffer.pose(frame),
        }
    }

    /// Root of a frame of the buffer, with its heading.
    pub(super) fn root(&self, frame: i64) -> GlobalRoot {
        let posed = self.flat(frame);
        let pelvis = posed.rotations.first().copied().unwrap_or_default();
        GlobalRoot::of_pose(posed.root, pelvis, self.rig.skeleton.left_axis)
    }

    /// Locomotion goes by `command` from `frame` on: further on its way, or again from wherever
    /// something else has brought the character.
    pub(super) fn move_on(&mut self, frame: i64, command: LocomotionCommand, further: bool) {
        if further {
            self.locomotion.set_command(frame as u64, command);
        } else {
            let heading = self.root(frame + self.timeline.look_ahead()).heading;
            *self.locomotion = Locomotion::new(frame as u64, heading, self.rig.fps, command);
        }
        self.timeline.command_changed();
    }

    /// The command to stand.
    pub(super) fn standing(&self) -> LocomotionCommand {
        LocomotionCommand::standing(&self.locomotion.command().style)
    }

    /// The buffer's frames behind `shown` are others, or the ground is.
    pub(super) fn renew_footing(&mut self, shown: i64, scene: &Scene) {
        let skeleton = &self.rig.skeleton;
        self.footing.renew(shown, self.timeline.buffer(), scene, skeleton);
    }

    /// The ground is at `height` now where the character stands: it goes there from the frame
    /// behind `shown` on.
    pub(super) fn shift_footing(&mut self, shown: i64, height: f32, scene: &Scene) {
        if let Some(there) = self.footing.shift(shown, height) {
            self.renew_footing(there, scene);
        }
    }

    /// Has the last frame go on for as long as a plan may need.
    pub(super) fn hold(&mut self, frame: i64) {
        let needed = frame + self.timeline.ahead() + CROSSFADE_FRAMES as i64 + 1;
        if self.timeline.buffer().last() < needed {
            self.timeline.hold(needed + HELD_FRAMES);
        }
    }

    /// Mean velocity over the ground of the frames before `frame`, m/s.
    pub(super) fn velocity(&self, frame: i64, frames: i64) -> Vec3 {
        let fps = self.rig.fps;
        self.timeline.buffer().velocity(frame, frames, fps)
    }
}

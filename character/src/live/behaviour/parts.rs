//! The parts of a character that its behaviour works on: its motion as planned and as shown.

use troupe_motion::ik::Posed;
use troupe_motion::robot::Fitted;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::super::timeline::Timeline;
use super::super::{CROSSFADE_FRAMES, CharacterOptions};
use super::PostProcess;
use crate::primitives::{Locomotion, LocomotionCommand};
use crate::scene::ScaledScene;
use crate::skill::Skills;
use troupe_motion::model::Rig;

/// Frames that a held pose goes on beyond where the next plan takes over.
const HELD_FRAMES: i64 = 16;

/// A character without its behaviour, borrowed while the behaviour decides.
pub(in crate::live) struct CharacterParts<'a> {
    pub(in crate::live) rig: &'a Rig,
    pub(in crate::live) options: &'a CharacterOptions,
    pub(in crate::live) timeline: &'a mut Timeline,
    pub(in crate::live) locomotion: &'a mut Locomotion,
    pub(in crate::live) post: &'a mut PostProcess,
    pub(in crate::live) skills: &'a Skills,
}

/// The pose of one frame as it is shown.
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

impl CharacterParts<'_> {
    /// A frame of the buffer as it is shown.
    pub(super) fn shown(&self, frame: i64) -> Shown {
        let buffer = self.timeline.buffer();
        let mut root = buffer.root(frame);
        let mut rotations = buffer.pose(frame).to_vec();
        let skeleton = &self.rig.skeleton;
        self.post.apply(skeleton, (frame, 0.0), &mut root, &mut rotations);
        if let Some(robot) = &skeleton.robot {
            robot.fit(&mut rotations, &mut Fitted::default());
        }
        Shown { root, rotations }
    }

    /// A frame of the buffer as planned: heights count from what the character stands on.
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

    /// Has locomotion follow `command` from `frame` on. With `further` it continues its motion.
    /// Otherwise it starts from wherever other motion has brought the character.
    pub(super) fn move_on(&mut self, frame: i64, command: LocomotionCommand, further: bool) {
        if further {
            self.locomotion.set_command(frame as u64, command);
        } else {
            let heading = self.root(frame + self.timeline.look_ahead()).heading;
            *self.locomotion = Locomotion::new(frame as u64, heading, self.rig.fps, command);
        }
        self.timeline.command_changed();
    }

    /// The command to stand, in the current style.
    pub(super) fn standing(&self) -> LocomotionCommand {
        LocomotionCommand::standing(&self.locomotion.command().style)
    }

    /// Works out the lifts after frame `shown`, because the buffer's frames or the ground changed.
    pub(super) fn renew_footing(&mut self, shown: i64, scene: &ScaledScene) {
        let skeleton = &self.rig.skeleton;
        self.post
            .footing
            .renew(shown, self.timeline.buffer(), scene, skeleton);
    }

    /// Moves the character to ground of height `height`, from the frame after `shown` on.
    pub(super) fn shift_footing(&mut self, shown: i64, height: f32, scene: &ScaledScene) {
        if let Some(there) = self.post.footing.shift(shown, height) {
            self.renew_footing(there, scene);
        }
    }

    /// Repeats the last frame for as long as a plan may take.
    pub(super) fn hold(&mut self, frame: i64) {
        let needed = frame + self.timeline.ahead() + CROSSFADE_FRAMES as i64 + 1;
        if self.timeline.buffer().last() < needed {
            self.timeline.hold(needed + HELD_FRAMES);
        }
    }

    /// Mean velocity over the ground in the `frames` frames before `frame`, m/s.
    pub(super) fn velocity(&self, frame: i64, frames: i64) -> Vec3 {
        let fps = self.rig.fps;
        self.timeline.buffer().velocity(frame, frames, fps)
    }
}

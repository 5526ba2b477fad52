//! The way to an object: steering, slowing down, and the moment at which the first set may begin.
//!
//! A walking character hands over on the way: the first set's motion begins 1.4 seconds of walking
//! before its keyframe. Some characters stop first, because the set says so or because they stood
//! close by already. They go to the keyframe's place, stop there with its heading, and hand over
//! when they stand.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, Vec3};

use super::Frame;
use super::recipe::{
    APPROACH_FRAMES, HAND_OVER_M, HAND_OVER_MPS, HAND_OVER_S, HAND_OVER_TURN, IN_PLACE_M, NEAR_FRAMES,
    NEAR_M, NEAR_MPS, PACE_MPS, PASSED, SHARP_TURN, STAND_NEAR_M, STANDS_MPS, STEER_FRAMES, STEER_TURN,
    STOP_FRAMES, STOP_M, STOP_S, STOPPED_MPS, STOPPED_TURN,
};
use crate::primitives::LocomotionCommand;
use crate::style::Style;

/// The goal of an approach.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Position over the ground and heading of the first keyframe; y is ignored.
    pub key: GlobalRoot,
    /// A place to pass on the way, over the ground.
    pub via: Option<Vec3>,
    /// Whether the character stops before the first set.
    pub from_stand: bool,
    /// The first set begins wherever the character comes to stand. `key` is ignored.
    pub anywhere: bool,
}

/// The state in which the character will be when the next plan takes over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Here {
    /// Frame of that moment.
    pub frame: Frame,
    /// Position and heading; y is ignored.
    pub root: GlobalRoot,
    /// Velocity over the ground, m/s.
    pub velocity: Vec3,
}

/// What an approach says about a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Going {
    /// Go on as before.
    On,
    /// Go on with another command.
    Command {
        /// The new command.
        command: LocomotionCommand,
        /// Whether to ask for a plan at once.
        replan: bool,
        /// The place to stand at, over the ground, for a command to stand.
        stand_at: Option<Vec3>,
    },
    /// The first set may begin.
    HandOver,
    /// The approach takes too long.
    TimedOut,
}

/// Steers a character to where the first set begins.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Approach {
    entry: Entry,
    #[serde(with = "crate::saved::style")]
    style: Arc<Style>,
    began: Frame,
    state: State,
    /// The frame since which the character has been near.
    near_since: Option<Frame>,
    /// The current command, and the frame at which the direction was last checked.
    commanded: Option<(LocomotionCommand, Frame)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum State {
    /// Before the first check.
    New,
    /// On the way.
    Going {
        /// Whether it stops before the first set.
        stops: bool,
    },
    /// Stopping since this frame.
    Stopping(Frame),
}

impl Approach {
    /// An approach that begins at frame `began`, in `style`.
    pub fn new(entry: Entry, style: Arc<Style>, began: Frame) -> Self {
        Self {
            entry,
            style,
            began,
            state: State::New,
            near_since: None,
            commanded: None,
        }
    }

    /// The goal of the approach.
    pub fn entry(&self) -> &Entry {
        &self.entry
    }

    /// Leads to another goal from now on, because the object has moved. A stop that had begun is
    /// called off.
    pub fn redirect(&mut self, entry: Entry) {
        if entry == self.entry {
            return;
        }
        if let State::Stopping(_) = self.state
            && !entry.anywhere
        {
            self.state = State::Going { stops: true };
        }
        self.entry = entry;
    }

    /// Decides what a character does that will be `here`.
    pub fn step(&mut self, here: &Here) -> Going {
        if here.frame - self.began > APPROACH_FRAMES {
            return Going::TimedOut;
        }
        let speed = here.velocity.with_y(0.0).length();
        let left = flat(self.entry.key.position - here.root.position);
        let way = left.length();
        match self.state {
            State::New if self.entry.anywhere => match speed < STANDS_MPS {
                true => Going::HandOver,
                false => self.stop(here.frame),
            },
            State::New => {
                let stands = speed < STANDS_MPS;
                if stands && way <= IN_PLACE_M {
                    return Going::HandOver;
                }
                let stops = self.entry.from_stand || (stands && way <= STAND_NEAR_M);
                self.state = State::Going { stops };
                self.steer(here, speed)
            }
            State::Going { stops } => {
                self.pass(here, speed);
                if self.entry.via.is_none() {
                    if stops && way <= (STOP_S * speed).max(STOP_M) {
                        return self.stop(here.frame);
                    }
                    if !stops && way <= (HAND_OVER_S * speed).max(HAND_OVER_M) && comes(here.velocity, left) {
                        return Going::HandOver;
                    }
                    if self.near_for(here.frame, way) > NEAR_FRAMES {
                        self.state = State::Going { stops: true };
                    }
                }
                self.steer(here, speed)
            }
            State::Stopping(since) => {
                let (fewest, most) = STOP_FRAMES;
                let stopped_for = here.frame - since;
                let off = wrap_angle(here.root.heading - self.entry.key.heading).abs();
                let faces = self.entry.anywhere || off < STOPPED_TURN;
                let stopped = speed < STOPPED_MPS && faces;
                match (stopped && stopped_for >= fewest) || stopped_for >= most {
                    true => Going::HandOver,
                    false => Going::On,
                }
            }
        }
    }

    /// Number of frames since the character came near.
    fn near_for(&mut self, frame: Frame, way: f32) -> Frame {
        match way <= NEAR_M {
            true => frame - *self.near_since.get_or_insert(frame),
            false => {
                self.near_since = None;
                0
            }
        }
    }

    /// Drops the place on the way once the character has passed it.
    fn pass(&mut self, here: &Here, speed: f32) {
        let (seconds, least) = PASSED;
        let there = |via: Vec3| flat(via - here.root.position).length() <= (seconds * speed).max(least);
        self.entry.via.take_if(|via| there(*via));
    }

    fn steer(&mut self, here: &Here, speed: f32) -> Going {
        let target = self.entry.via.unwrap_or(self.entry.key.position);
        let left = flat(target - here.root.position);
        let Some(direction) = left.try_normalize() else {
            return Going::On;
        };
        let pace = self.pace(left.length());
        let velocity = direction * pace;
        let turned = match &self.commanded {
            Some((_, at)) if here.frame - at < STEER_FRAMES => return Going::On,
            Some((before, _)) if same_speed(before.velocity, velocity) => {
                before.velocity.angle_between(velocity)
            }
            _ => f32::INFINITY,
        };
        if turned < STEER_TURN {
            return Going::On;
        }
        let first = self.commanded.is_none();
        let command = LocomotionCommand {
            velocity,
            ..LocomotionCommand::standing(&self.style)
        };
        self.commanded = Some((command.clone(), here.frame));
        // A slower speed alone can wait for the next plan. A character at rest has none coming.
        let replan = first || (turned.is_finite() && turned > SHARP_TURN) || speed < STOPPED_MPS;
        Going::Command {
            command,
            replan,
            stand_at: None,
        }
    }

    /// Speed with `way` metres to go, m/s.
    fn pace(&self, way: f32) -> f32 {
        let own = match self.style.default_speed_mps {
            speed if speed > STANDS_MPS => speed,
            _ => PACE_MPS,
        };
        match way <= NEAR_M {
            true => own.min(NEAR_MPS),
            false => own,
        }
    }

    fn stop(&mut self, frame: Frame) -> Going {
        self.state = State::Stopping(frame);
        let there = (!self.entry.anywhere).then_some(self.entry.key);
        let command = LocomotionCommand {
            facing: there.map(|key| key.heading),
            ..LocomotionCommand::standing(&self.style)
        };
        self.commanded = Some((command.clone(), frame));
        Going::Command {
            command,
            replan: true,
            stand_at: there.map(|key| key.position),
        }
    }
}

/// Whether a character moving at `velocity` is on its way along `left`, and slow enough for the
/// first set.
fn comes(velocity: Vec3, left: Vec3) -> bool {
    let velocity = flat(velocity);
    let speed = velocity.length();
    speed < STANDS_MPS || (speed <= HAND_OVER_MPS && velocity.angle_between(left) <= HAND_OVER_TURN)
}

fn flat(v: Vec3) -> Vec3 {
    v.with_y(0.0)
}

fn same_speed(a: Vec3, b: Vec3) -> bool {
    a.length() > 0.0 && (a.length() - b.length()).abs() < 0.05
}

#[cfg(test)]
#[path = "approach_tests.rs"]
mod tests;

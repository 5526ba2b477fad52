//! Playing a path: from the time and the character's place to what it should do.

use glam::{Vec2, Vec3};
use troupe_client::{Act, Locomotion};

use super::script::{AFTERMATH_S, MOMENT_S, Manner, Moment, Path, Waypoint, When};
use super::velocity::Velocity;

/// Least change of the direction to a waypoint that makes a new command, radians. Every command
/// makes a new plan, so smaller corrections wait.
const CORRECTION: f32 = 0.09;
/// A waypoint counts as reached this many seconds before it, so that the turn to the next, or the
/// halt at the last, begins before it.
const REACH_S: f32 = 0.35;
/// Nearest that a waypoint must be reached, metres.
const REACH_M: f32 = 0.15;

/// Plays a path.
#[derive(Debug)]
pub(crate) struct Player<'a> {
    path: &'a Path,
    next_command: usize,
    next_waypoint: usize,
    /// Time of the last command.
    given_s: f32,
    /// Time of the moment that the next command waits for, once it has come.
    came_s: Option<f32>,
    /// Whether it uses an object. Then it gets no locomotion.
    uses: bool,
    /// Whether it acts out a sentence, until the next command.
    performs: bool,
    /// Whether it holds a keyframe until the next command.
    holds: bool,
    /// Commands beside moving, which [`Self::take_acts`] takes.
    acts: Vec<&'a Act>,
    /// Time until which it stands at the waypoint that it has reached.
    waits_until_s: Option<f32>,
    velocity: Velocity,
    intent: Locomotion,
    ends_s: f32,
}

impl<'a> Player<'a> {
    pub(crate) fn new(path: &'a Path) -> Self {
        let mut player = Self {
            path,
            next_command: 0,
            next_waypoint: 0,
            given_s: 0.0,
            came_s: None,
            uses: false,
            performs: false,
            holds: false,
            acts: Vec::new(),
            waits_until_s: None,
            velocity: Velocity::at_rest(path.heading),
            intent: Locomotion {
                style: path.style.clone(),
                ..Locomotion::default()
            },
            ends_s: path.limit_s(),
        };
        if let Some(first) = path.waypoints.first() {
            player.set_manner(&first.manner);
        }
        player
    }

    /// The locomotion of the character at a time and a place (x, z). None while it uses an object
    /// or acts out a sentence. Other commands of that time are then in [`Self::take_acts`]. Times
    /// must not go back.
    pub(crate) fn intent(&mut self, time_s: f32, place: Vec2) -> Option<&Locomotion> {
        while let Some(command) = self.path.commands.get(self.next_command) {
            // The slack makes frame times count that are rounded down.
            if self.next_command_s().is_none_or(|due_s| due_s > time_s + 1e-4) {
                break;
            }
            self.performs = false;
            match &command.act {
                Some(act) => self.act(act),
                None => self.uses = false,
            }
            self.velocity.change(command.motion);
            // It puts an object down on the way, so its manner stays.
            if command.act != Some(Act::Drop) {
                self.set_manner(&command.manner);
            }
            self.next_command += 1;
            self.given_s = time_s;
            self.came_s = None;
        }
        if self.uses {
            self.end_after(time_s, self.holds);
            return None;
        }
        if self.performs {
            self.end_after(time_s, true);
            return None;
        }
        if self.path.waypoints.is_empty() {
            self.end_after(time_s, true);
        } else {
            self.steer(time_s, place);
        }
        let Vec2 { x, y: z } = self.velocity.vector();
        self.intent.velocity = Vec3::new(x, 0.0, z);
        Some(&self.intent)
    }

    fn act(&mut self, act: &'a Act) {
        match act {
            Act::Interact { .. } | Act::Skill { .. } | Act::EndInteraction => {
                self.uses = true;
                self.holds = false;
                self.velocity.speed_mps = 0.0;
            }
            Act::Cancel => {
                self.uses = false;
                self.velocity.speed_mps = 0.0;
            }
            // It moves by itself.
            Act::FollowPath(_) => self.velocity.speed_mps = 0.0,
            // A command to move would end it.
            Act::Perform(_) => self.performs = true,
            Act::Drop => {}
        }
        self.acts.push(act);
    }

    /// Commands beside moving since the last call.
    pub(crate) fn take_acts(&mut self) -> impl Iterator<Item = &'a Act> {
        self.acts.drain(..)
    }

    /// Whether the character uses an object, as far as the player knows.
    pub(crate) fn uses(&self) -> bool {
        self.uses
    }

    /// Takes a moment of an interaction. The first of each kind counts.
    pub(crate) fn came(&mut self, moment: Moment, time_s: f32) {
        match moment {
            Moment::Held => self.holds = true,
            Moment::Done => (self.uses, self.holds) = (false, false),
        }
        let next = self.path.commands.get(self.next_command);
        let waited = next.is_some_and(
            |command| matches!(command.when, When::Later { after: Some(after), .. } if after == moment),
        );
        if waited {
            self.came_s.get_or_insert(time_s);
        }
    }

    /// Lets a path with other commands than moving end soon after the last of them is through.
    fn end_after(&mut self, time_s: f32, is_through: bool) {
        let last = self.next_command == self.path.commands.len();
        if last && is_through && self.path.acts() && self.path.seconds.is_none() {
            self.ends_s = self.ends_s.min(time_s + AFTERMATH_S);
        }
    }

    fn set_manner(&mut self, manner: &Manner) {
        if manner.style.is_some() {
            self.intent.style.clone_from(&manner.style);
        }
        self.intent.facing = manner.facing;
        self.intent.gait.clone_from(&manner.gait);
        self.intent.height = manner.height_m;
    }

    /// Goes for the next waypoint.
    fn steer(&mut self, time_s: f32, place: Vec2) {
        if let Some(until) = self.waits_until_s {
            if time_s < until {
                return;
            }
            self.waits_until_s = None;
        }
        while let Some(target) = self.path.waypoints.get(self.next_waypoint) {
            if !self.is_reached(target, place) {
                self.go_for(target, place);
                return;
            }
            self.next_waypoint += 1;
            let next = self.path.waypoints.get(self.next_waypoint);
            if let Some(next) = next {
                self.set_manner(&next.manner);
            } else if self.path.seconds.is_none() && !self.path.acts() {
                self.ends_s = time_s + AFTERMATH_S;
            }
            if target.wait_s > 0.0 {
                self.waits_until_s = Some(time_s + target.wait_s);
                self.velocity.speed_mps = 0.0;
                return;
            }
        }
        self.velocity.speed_mps = 0.0;
        self.end_after(time_s, true);
    }

    /// Whether a waypoint is near, or the character has passed it.
    fn is_reached(&self, target: &Waypoint, place: Vec2) -> bool {
        let from = match self.next_waypoint.checked_sub(1) {
            Some(before) => self.path.waypoints[before].at,
            None => self.path.start,
        };
        let way = (target.at - from).normalize_or_zero();
        let ahead = (target.at - place).dot(way);
        let near = (target.speed_mps * REACH_S).max(REACH_M);
        target.at.distance(place) <= near || (way != Vec2::ZERO && ahead <= 0.0)
    }

    fn go_for(&mut self, target: &Waypoint, place: Vec2) {
        let way = target.at - place;
        let bearing = way.x.atan2(way.y);
        let off = troupe_motion::root::wrap_angle(bearing - self.velocity.direction).abs();
        if self.velocity.speed_mps != target.speed_mps || off > CORRECTION {
            self.velocity = Velocity {
                speed_mps: target.speed_mps,
                direction: bearing,
            };
        }
    }

    /// The command, counted from 1, that has waited too long, and the moment that did not come. A
    /// path of a given length may wait to its end.
    pub(crate) fn waits_in_vain(&self, time_s: f32) -> Option<(usize, Moment)> {
        let When::Later {
            after: Some(moment), ..
        } = self.path.commands.get(self.next_command)?.when
        else {
            return None;
        };
        let too_long = self.came_s.is_none() && time_s >= self.given_s + MOMENT_S;
        (too_long && self.path.seconds.is_none()).then_some((self.next_command + 1, moment))
    }

    /// Time of the end of the path, as far as the player knows.
    pub(crate) fn ends_s(&self) -> f32 {
        self.ends_s
    }

    /// Time of the next command, if the player knows it yet.
    pub(crate) fn next_command_s(&self) -> Option<f32> {
        match self.path.commands.get(self.next_command)?.when {
            When::At(time_s) => Some(time_s),
            When::Later { wait_s, after: None } => Some(self.given_s + wait_s),
            When::Later {
                wait_s,
                after: Some(_),
            } => Some(self.came_s? + wait_s),
        }
    }
}

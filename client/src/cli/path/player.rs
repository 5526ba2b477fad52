//! Playing a path: from the time and the character's place to what it should do.

use glam::{Vec2, Vec3};

use super::{AFTERMATH_S, Manner, Motion, Path, Waypoint};
use crate::live::Locomotion;

/// How far the way to a waypoint may turn from where the character is told to go before it is told anew, radians. Every
/// command makes a new plan, so small corrections are saved up.
const CORRECTION: f32 = 0.09;
/// A waypoint counts as reached this many seconds ahead of it, so that the turn to the next begins before it, and the
/// halt at the last.
const REACH_S: f32 = 0.35;
/// Nearest that a waypoint must be reached, metres.
const REACH_M: f32 = 0.15;

/// A velocity that may be changed by length and direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Velocity {
    speed_mps: f32,
    direction: f32,
}

impl Velocity {
    /// None, but the direction that a speed alone would take.
    pub(super) fn at_rest(direction: f32) -> Self {
        Self {
            speed_mps: 0.0,
            direction,
        }
    }

    pub(super) fn change(&mut self, motion: Motion) {
        match motion {
            Motion::AsBefore => {}
            Motion::Velocity(velocity) => {
                self.speed_mps = velocity.length();
                if velocity != Vec2::ZERO {
                    self.direction = velocity.x.atan2(velocity.y);
                }
            }
            Motion::Polar { speed_mps, direction } => {
                self.speed_mps = speed_mps.unwrap_or(self.speed_mps);
                self.direction = direction.unwrap_or(self.direction);
            }
        }
    }

    /// (x, z), m/s.
    pub(super) fn vector(self) -> Vec2 {
        let (sin, cos) = self.direction.sin_cos();
        Vec2::new(sin, cos) * self.speed_mps
    }
}

/// Plays a path.
#[derive(Debug)]
pub(in crate::cli) struct Player<'a> {
    path: &'a Path,
    next_command: usize,
    next_waypoint: usize,
    /// Until when it stands at the waypoint that it has reached.
    waits_until_s: Option<f32>,
    velocity: Velocity,
    intent: Locomotion,
    ends_s: f32,
}

impl<'a> Player<'a> {
    pub(in crate::cli) fn new(path: &'a Path) -> Self {
        let mut player = Self {
            path,
            next_command: 0,
            next_waypoint: 0,
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

    /// What the character should do at a time, being at a place (x, z). Times must not go back.
    pub(in crate::cli) fn intent(&mut self, time_s: f32, place: Vec2) -> &Locomotion {
        while let Some(command) = self.path.commands.get(self.next_command) {
            // A ten-thousandth of a second of slack, so that frame times that are rounded down count.
            if command.time_s > time_s + 1e-4 {
                break;
            }
            self.velocity.change(command.motion);
            self.set_manner(&command.manner);
            self.next_command += 1;
        }
        if !self.path.waypoints.is_empty() {
            self.steer(time_s, place);
        }
        let Vec2 { x, y: z } = self.velocity.vector();
        self.intent.velocity = Vec3::new(x, 0.0, z);
        &self.intent
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
            } else if self.path.seconds.is_none() {
                self.ends_s = time_s + AFTERMATH_S;
            }
            if target.wait_s > 0.0 {
                self.waits_until_s = Some(time_s + target.wait_s);
                self.velocity.speed_mps = 0.0;
                return;
            }
        }
        self.velocity.speed_mps = 0.0;
    }

    /// Whether a waypoint is near, or behind: the character went past it.
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

    /// When the path is at its end, as far as it is known.
    pub(in crate::cli) fn ends_s(&self) -> f32 {
        self.ends_s
    }

    /// Time of the next command that has not come yet.
    pub(in crate::cli) fn next_command_s(&self) -> Option<f32> {
        Some(self.path.commands.get(self.next_command)?.time_s)
    }
}

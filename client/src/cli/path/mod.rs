//! Scripted paths: what a character is told to do, in a file.

mod player;
mod read;

use std::path::Path as FilePath;

use glam::Vec2;

pub(super) use self::player::Player;

use super::failure::Failure;

/// A scripted path, checked. Places are (x, z) on the ground, metres; angles are in radians from +Z to +X.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    pub(super) title: Option<String>,
    pub(super) style: Option<String>,
    pub(super) seed: u64,
    pub(super) start: Vec2,
    pub(super) heading: f32,
    /// How long it goes on. None: until all is done, and a moment longer.
    pub(super) seconds: Option<f32>,
    /// By time.
    pub(super) commands: Vec<Timed>,
    pub(super) waypoints: Vec<Waypoint>,
}

/// A command at a time. Velocity and style stay as they were where it does not say them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Timed {
    pub(super) time_s: f32,
    pub(super) motion: Motion,
    pub(super) manner: Manner,
}

/// What a command says about the velocity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum Motion {
    /// Nothing.
    #[default]
    AsBefore,
    /// All of it, m/s.
    Velocity(Vec2),
    /// Its length and direction, where they change.
    Polar {
        speed_mps: Option<f32>,
        direction: Option<f32>,
    },
}

/// How to move.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Manner {
    pub(super) facing: Option<f32>,
    pub(super) style: Option<String>,
    pub(super) gait: Option<String>,
    pub(super) height_m: Option<f32>,
}

/// A place to go to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Waypoint {
    pub(super) at: Vec2,
    pub(super) speed_mps: f32,
    /// Time to stand there.
    pub(super) wait_s: f32,
    pub(super) manner: Manner,
}

/// Time that a path goes on after its last command or waypoint.
const AFTERMATH_S: f32 = 2.0;

impl Path {
    /// Reads a file.
    pub(super) fn read(path: &FilePath) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
        let mut read = Self::parse(&text).map_err(|why| Failure::file(path, why))?;
        if read.title.is_none() {
            read.title = path.file_stem().map(|name| name.to_string_lossy().into_owned());
        }
        Ok(read)
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// A sentence with the line and field at fault.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        read::parse(text)
    }

    /// The longest that it may take: with waypoints a character may come late.
    pub(super) fn limit_s(&self) -> f32 {
        if let Some(seconds) = self.seconds {
            return seconds;
        }
        let mut from = self.start;
        let mut on_the_way = 0.0;
        for point in &self.waypoints {
            on_the_way += from.distance(point.at) / point.speed_mps.max(0.1) + point.wait_s;
            from = point.at;
        }
        let spare = if self.waypoints.is_empty() {
            0.0
        } else {
            5.0 + on_the_way * 0.5
        };
        let last = self.commands.last().map_or(0.0, |c| c.time_s);
        last.max(on_the_way + spare) + AFTERMATH_S
    }

    /// The way that the root would go if it did at once what it is told, for a time: from waypoint to waypoint, or along
    /// the commanded velocities.
    pub(super) fn commanded(&self, seconds: f32) -> Vec<Vec2> {
        let mut at = self.start;
        let mut way = vec![at];
        if !self.waypoints.is_empty() {
            way.extend(self.waypoints.iter().map(|p| p.at));
            return way;
        }
        let mut velocity = player::Velocity::at_rest(self.heading);
        let ends = self.commands.iter().skip(1).map(|c| c.time_s);
        for (command, end) in self.commands.iter().zip(ends.chain([seconds])) {
            velocity.change(command.motion);
            let time = end.min(seconds) - command.time_s;
            if time > 0.0 {
                at += velocity.vector() * time;
                way.push(at);
            }
        }
        way
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;

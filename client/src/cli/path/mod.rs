//! Scripted paths: what a character is told to do, in a file.

mod player;
mod read;

use std::path::Path as FilePath;

use glam::Vec2;

pub(super) use self::player::Player;

use super::failure::Failure;
use crate::live::Act;

/// A scripted path, checked. Places are (x, z) on the ground, metres; angles are in radians from +Z to +X.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    pub(super) title: Option<String>,
    pub(super) style: Option<String>,
    /// Name of the scene on the server that the character lives in.
    pub(super) scene: Option<String>,
    pub(super) seed: u64,
    pub(super) start: Vec2,
    pub(super) heading: f32,
    /// How long it goes on. None: until all is done, and a moment longer.
    pub(super) seconds: Option<f32>,
    /// In order.
    pub(super) commands: Vec<Timed>,
    pub(super) waypoints: Vec<Waypoint>,
}

/// A command and its time. Velocity and style stay as they were where it does not say them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Timed {
    pub(super) when: When,
    /// What to do instead of moving.
    pub(super) act: Option<Act>,
    pub(super) motion: Motion,
    pub(super) manner: Manner,
}

/// When a command is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum When {
    /// At this time, seconds.
    At(f32),
    /// So long after the command before it, or after what came of that.
    Later { wait_s: f32, after: Option<Moment> },
}

/// What may come of a command that has the character use an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Moment {
    /// It holds a keyframe until the interaction is ended: it sits, or has the cup before its chest.
    Held,
    /// The interaction is over: through, failed or broken off.
    Done,
}

impl Moment {
    /// As files have it.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Done => "done",
        }
    }
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
/// Longest that a path waits for what comes of a command, unless it says how long it goes on; the server gives up an approach
/// after 20 s.
pub(super) const MOMENT_S: f32 = 30.0;

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
        let mut last = 0.0;
        for command in &self.commands {
            last = match command.when {
                When::At(time_s) => time_s,
                When::Later { wait_s, after } => last + wait_s + after.map_or(0.0, |_| MOMENT_S),
            };
        }
        let done = if self.commands.last().is_some_and(|c| c.act.is_some()) {
            MOMENT_S
        } else {
            0.0
        };
        // What is done on the way holds the way up.
        let on_the_way = if self.acts() {
            last + on_the_way
        } else {
            on_the_way
        };
        (last + done).max(on_the_way + spare) + AFTERMATH_S
    }

    /// Whether it does anything but move by time and place.
    pub(super) fn acts(&self) -> bool {
        let moves = |command: &Timed| command.act.is_none() && matches!(command.when, When::At(_));
        !self.commands.iter().all(moves)
    }

    /// The way that the root would go if it did at once what it is told, for a time: from waypoint to waypoint, or along
    /// the commanded velocities. Nothing where it uses objects and has no waypoints: nobody says where it goes then.
    pub(super) fn commanded(&self, seconds: f32) -> Vec<Vec2> {
        let mut at = self.start;
        let mut way = vec![at];
        if !self.waypoints.is_empty() {
            way.extend(self.waypoints.iter().map(|p| p.at));
            return way;
        }
        if self.acts() {
            return Vec::new();
        }
        let mut velocity = player::Velocity::at_rest(self.heading);
        let times = self.commands.iter().map(|command| match command.when {
            When::At(time_s) => time_s,
            When::Later { .. } => seconds,
        });
        let ends = times.clone().skip(1).chain([seconds]);
        for ((command, start), end) in self.commands.iter().zip(times).zip(ends) {
            velocity.change(command.motion);
            let time = end.min(seconds) - start;
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

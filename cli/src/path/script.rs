//! A scripted path in memory.

use glam::Vec2;
use troupe_client::Act;

/// A scripted path, checked. Places are (x, z) on the ground, metres; angles are in radians from +Z
/// to +X.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Path {
    pub(crate) title: Option<String>,
    /// Name of the pack that the character is of.
    pub(crate) pack: Option<String>,
    pub(crate) style: Option<String>,
    /// Name of the scene on the server that the character lives in.
    pub(crate) scene: Option<String>,
    pub(crate) seed: u64,
    pub(crate) start: Vec2,
    pub(crate) heading: f32,
    /// Length. None: until all commands and waypoints are through, and a moment longer.
    pub(crate) seconds: Option<f32>,
    /// In order.
    pub(crate) commands: Vec<Timed>,
    pub(crate) waypoints: Vec<Waypoint>,
}

/// A command and its time. Velocity and style that it leaves out stay as they were.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Timed {
    pub(crate) when: When,
    /// An action instead of moving.
    pub(crate) act: Option<Act>,
    pub(crate) motion: Motion,
    pub(crate) manner: Manner,
}

/// The time of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum When {
    /// At this time, seconds.
    At(f32),
    /// After a wait from the command before it, or from a moment of its interaction.
    Later { wait_s: f32, after: Option<Moment> },
}

/// A moment of an interaction that commands can wait for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Moment {
    /// The character holds a keyframe until the interaction is ended: it sits, or has the cup
    /// before its chest.
    Held,
    /// The interaction is over: through, failed or broken off.
    Done,
}

impl Moment {
    /// The word in files.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Done => "done",
        }
    }
}

/// The velocity of a command.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) enum Motion {
    /// It stays.
    #[default]
    AsBefore,
    /// All of it, m/s.
    Velocity(Vec2),
    /// A change of its length or direction.
    Polar {
        speed_mps: Option<f32>,
        direction: Option<f32>,
    },
}

/// Facing, style, gait and height of a movement.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Manner {
    pub(crate) facing: Option<f32>,
    pub(crate) style: Option<String>,
    pub(crate) gait: Option<String>,
    pub(crate) height_m: Option<f32>,
}

impl Manner {
    fn size(&mut self, by: f32) {
        if let Some(height_m) = &mut self.height_m {
            *height_m *= by;
        }
    }
}

/// A place to go to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Waypoint {
    pub(crate) at: Vec2,
    pub(crate) speed_mps: f32,
    /// Time to stand there.
    pub(crate) wait_s: f32,
    pub(crate) manner: Manner,
}

/// Time that a path goes on after its last command or waypoint.
pub(super) const AFTERMATH_S: f32 = 2.0;
/// Longest wait for a moment, unless the path has a given length. The server gives up an approach
/// after 20 s.
pub(crate) const MOMENT_S: f32 = 30.0;

impl Path {
    /// The longest time that it may take. With waypoints a character may come late.
    pub(crate) fn limit_s(&self) -> f32 {
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
        // Interactions on the way take time.
        let on_the_way = if self.acts() {
            last + on_the_way
        } else {
            on_the_way
        };
        (last + done).max(on_the_way + spare) + AFTERMATH_S
    }

    /// The path with all lengths and speeds multiplied.
    pub(crate) fn sized(&self, by: f32) -> Self {
        let mut path = self.clone();
        path.start *= by;
        for point in &mut path.waypoints {
            point.at *= by;
            point.speed_mps *= by;
            point.manner.size(by);
        }
        for command in &mut path.commands {
            match &mut command.motion {
                Motion::Velocity(velocity) => *velocity *= by,
                Motion::Polar {
                    speed_mps: Some(speed_mps),
                    ..
                } => *speed_mps *= by,
                Motion::AsBefore | Motion::Polar { .. } => {}
            }
            command.manner.size(by);
        }
        path
    }

    /// Whether it has a skill.
    pub(crate) fn does_skills(&self) -> bool {
        let is_skill = |command: &Timed| matches!(command.act, Some(Act::Skill { .. }));
        self.commands.iter().any(is_skill)
    }

    /// Whether it has anything but movements by time and place.
    pub(crate) fn acts(&self) -> bool {
        let moves = |command: &Timed| command.act.is_none() && matches!(command.when, When::At(_));
        !self.commands.iter().all(moves)
    }
}

//! What a scripted path is.

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
    /// How long it goes on. None: until all is done, and a moment longer.
    pub(crate) seconds: Option<f32>,
    /// In order.
    pub(crate) commands: Vec<Timed>,
    pub(crate) waypoints: Vec<Waypoint>,
}

/// A command and its time. Velocity and style stay as they were where it does not say them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Timed {
    pub(crate) when: When,
    /// What to do instead of moving.
    pub(crate) act: Option<Act>,
    pub(crate) motion: Motion,
    pub(crate) manner: Manner,
}

/// When a command is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum When {
    /// At this time, seconds.
    At(f32),
    /// So long after the command before it, or after what came of that.
    Later { wait_s: f32, after: Option<Moment> },
}

/// What may come of a command that has the character use an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Moment {
    /// It holds a keyframe until the interaction is ended: it sits, or has the cup before its
    /// chest.
    Held,
    /// The interaction is over: through, failed or broken off.
    Done,
}

impl Moment {
    /// As files have it.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Done => "done",
        }
    }
}

/// What a command says about the velocity.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) enum Motion {
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
pub(crate) struct Manner {
    pub(crate) facing: Option<f32>,
    pub(crate) style: Option<String>,
    pub(crate) gait: Option<String>,
    pub(crate) height_m: Option<f32>,
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
/// Longest that a path waits for what comes of a command, unless it says how long it goes on; the
/// server gives up an approach after 20 s.
pub(crate) const MOMENT_S: f32 = 30.0;

impl Path {
    /// The longest that it may take: with waypoints a character may come late.
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
        // What is done on the way holds the way up.
        let on_the_way = if self.acts() {
            last + on_the_way
        } else {
            on_the_way
        };
        (last + done).max(on_the_way + spare) + AFTERMATH_S
    }

    /// Whether it does a skill.
    pub(crate) fn does_skills(&self) -> bool {
        let is_skill = |command: &Timed| matches!(command.act, Some(Act::Skill { .. }));
        self.commands.iter().any(is_skill)
    }

    /// Whether it does anything but move by time and place.
    pub(crate) fn acts(&self) -> bool {
        let moves = |command: &Timed| command.act.is_none() && matches!(command.when, When::At(_));
        !self.commands.iter().all(moves)
    }
}

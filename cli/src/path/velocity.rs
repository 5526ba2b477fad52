//! The velocities that a path commands, and the way that they lead.

use glam::Vec2;

use super::script::{Motion, Path, When};

/// A velocity that may be changed by length and direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Velocity {
    pub(super) speed_mps: f32,
    pub(super) direction: f32,
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

impl Path {
    /// The way of a root that obeys at once, for a time: from waypoint to waypoint, or along the
    /// commanded velocities. Empty for a path that uses objects and has no waypoints, because the
    /// objects decide the way then.
    pub(crate) fn commanded(&self, seconds: f32) -> Vec<Vec2> {
        let mut at = self.start;
        let mut way = vec![at];
        if !self.waypoints.is_empty() {
            way.extend(self.waypoints.iter().map(|p| p.at));
            return way;
        }
        if self.acts() {
            return Vec::new();
        }
        let mut velocity = Velocity::at_rest(self.heading);
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

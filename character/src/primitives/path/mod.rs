//! A path that a character is to follow: positions and headings, point by point.
//!
//! A path is a smooth curve through its points ([`PathCommand::at`]). [`run`] has a character join
//! it, keep to it and fall behind it.

mod check;
pub(super) mod run;

use std::ops::RangeInclusive;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;
use troupe_motion::root::wrap_angle;

use crate::style::Style;

pub use check::AskedPoint;

/// Fewest and most points of a path.
pub const PATH_POINTS: RangeInclusive<usize> = 2..=1024;
/// Longest duration of a path, seconds.
pub const MAX_PATH_S: f32 = 600.0;
/// Highest speed of a path, m/s.
pub const MAX_PATH_MPS: f32 = 15.0;
/// Lowest speed of a path without times, m/s.
pub const MIN_PATH_MPS: f32 = 0.05;
/// Farthest that a path may begin from the character, metres.
pub const MAX_LEAD_M: f32 = 5.0;

/// Seconds over which a path begins and ends: half of them before the first or last point, half
/// after.
const EASE_S: f32 = 0.6;
/// A tangent is at most this many times as fast as the slower side of its point. A wider curve
/// would leave the way between two points.
const TANGENT_LIMIT: f32 = 2.0;
/// A slower path has no direction to face, m/s.
const FACING_MPS: f32 = 0.1;

/// A point of a path, in the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PathPoint {
    /// World position over the ground, metres; y is 0.
    pub position: Vec3,
    /// Heading, radians. `None`: the direction of the path.
    pub heading: Option<f32>,
    /// Time at the point, seconds from the command.
    pub time_s: f32,
}

/// A checked path and the style to follow it in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathCommand {
    /// Its gaits limit how fast the character can follow.
    #[serde(with = "crate::saved::style")]
    pub style: Arc<Style>,
    /// The points, as many as [`PATH_POINTS`] allows; times increase.
    pub points: Vec<PathPoint>,
    /// Seconds from the last point back to the first, to begin again. `None`: the path ends.
    pub closing_s: Option<f32>,
}

/// The state of a path at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathMoment {
    /// World position, metres; y is 0.
    pub(super) position: Vec3,
    /// Velocity over the ground, m/s.
    pub(super) velocity: Vec3,
    /// Heading, radians, not wrapped.
    pub(super) heading: f32,
}

impl PathCommand {
    /// Whether the path goes on for ever.
    pub fn is_loop(&self) -> bool {
        self.closing_s.is_some()
    }

    /// Distance of the first point from a place over the ground, metres.
    pub fn lead_m(&self, place: Vec3) -> f32 {
        let first = self.points.first().map_or(place, |point| point.position);
        (first - place).with_y(0.0).length()
    }

    fn first_s(&self) -> f32 {
        self.points.first().map_or(0.0, |point| point.time_s)
    }

    fn last_s(&self) -> f32 {
        self.points.last().map_or(0.0, |point| point.time_s)
    }

    /// Seconds of a round; none if the path ends.
    pub(super) fn round_s(&self) -> Option<f32> {
        let closing_s = self.closing_s?;
        Some(self.last_s() - self.first_s() + closing_s)
    }

    /// Seconds until it stands at its end; none if it does not end.
    pub(super) fn ends_s(&self) -> Option<f32> {
        let ease_s = self.ease_s();
        (!self.is_loop()).then(|| self.last_s() + ease_s)
    }

    fn ease_s(&self) -> f32 {
        (EASE_S / 2.0).min((self.last_s() - self.first_s()) / 2.0)
    }

    /// The path's own time, and its rate, at a time from the command. The path begins and ends
    /// smoothly.
    fn eased(&self, time_s: f32) -> (f32, f32) {
        let (first, last, ease) = (self.first_s(), self.last_s(), self.ease_s());
        let start = ease.min(first);
        if time_s < first + start && start > 0.0 {
            let part = ((time_s - first + start) / (2.0 * start)).max(0.0);
            return (first + start * part * part, part);
        }
        if self.is_loop() || time_s <= last - ease {
            return (time_s.max(first), 1.0);
        }
        let part = ((time_s - last + ease) / (2.0 * ease)).min(1.0);
        (last - ease + 2.0 * ease * (part - part * part / 2.0), 1.0 - part)
    }

    /// The state of the path at a time from the command, seconds.
    pub(super) fn at(&self, time_s: f32) -> PathMoment {
        let (mut own_s, rate) = self.eased(time_s);
        if let Some(round_s) = self.round_s() {
            own_s = self.first_s() + (own_s - self.first_s()).rem_euclid(round_s);
        }
        let after = self.points.partition_point(|point| point.time_s <= own_s);
        let from = after.saturating_sub(1);
        let ([a, b], length_s) = self.segment(from);
        let u = ((own_s - a.time_s) / length_s).clamp(0.0, 1.0);
        let (start, end) = (self.tangent(from) * length_s, self.tangent(from + 1) * length_s);
        let way = b.position - a.position;
        // The cubic curve between the two points, and its derivative.
        let position = a.position
            + way * (u * u * (3.0 - 2.0 * u))
            + start * (u * (1.0 - u) * (1.0 - u))
            + end * (u * u * (u - 1.0));
        let slope = way * (6.0 * u * (1.0 - u))
            + start * (1.0 - 4.0 * u + 3.0 * u * u)
            + end * (3.0 * u * u - 2.0 * u);
        let velocity = slope / length_s;
        let [before, behind] = [self.facing(from), self.facing(from + 1)];
        let given = a.heading.is_some() || b.heading.is_some();
        let heading = match velocity.length() > FACING_MPS && !given {
            true => velocity.x.atan2(velocity.z),
            false => before + wrap_angle(behind - before) * u,
        };
        PathMoment {
            position,
            velocity: velocity * rate,
            heading,
        }
    }

    /// Point `index`. On a loop, indices count on through further rounds.
    fn point(&self, index: usize) -> PathPoint {
        let count = self.points.len();
        match self.is_loop() {
            true => self.points[index % count],
            false => self.points[index.min(count - 1)],
        }
    }

    /// The two ends of the segment after point `from`, and its duration in seconds.
    fn segment(&self, from: usize) -> ([PathPoint; 2], f32) {
        let count = self.points.len();
        let length_s = match (from % count + 1 == count, self.closing_s) {
            (true, Some(closing_s)) => closing_s,
            (true, None) => 1.0,
            (false, _) => self.point(from + 1).time_s - self.point(from).time_s,
        };
        ([self.point(from), self.point(from + 1)], length_s)
    }

    /// Mean velocity of the segment after point `from`, and its duration in seconds. None if there
    /// is no such segment.
    fn slope(&self, from: Option<usize>) -> Option<(Vec3, f32)> {
        let from = from?;
        if !self.is_loop() && from + 1 >= self.points.len() {
            return None;
        }
        let ([a, b], length_s) = self.segment(from);
        Some(((b.position - a.position) / length_s, length_s))
    }

    /// Velocity at point `index`, m/s: from the point before to the point after, limited.
    fn tangent(&self, index: usize) -> Vec3 {
        let before = match self.is_loop() {
            true => Some(index + self.points.len() - 1),
            false => index.checked_sub(1),
        };
        match (self.slope(before), self.slope(Some(index))) {
            (Some((a, a_s)), Some((b, b_s))) => {
                let mean = (a * a_s + b * b_s) / (a_s + b_s);
                mean.clamp_length_max(TANGENT_LIMIT * a.length().min(b.length()))
            }
            (Some((only, _)), None) | (None, Some((only, _))) => only,
            (None, None) => Vec3::ZERO,
        }
    }

    /// Heading at point `index`, radians.
    fn facing(&self, index: usize) -> f32 {
        if let Some(heading) = self.point(index).heading {
            return heading;
        }
        let tangent = self.tangent(index);
        if tangent.length() > FACING_MPS {
            return tangent.x.atan2(tangent.z);
        }
        // The path stands at this point: it keeps the direction in which it came, or takes the one
        // in which it goes on.
        let count = self.points.len();
        let moves = |from: &usize| {
            self.slope(Some(*from))
                .is_some_and(|(v, _)| v.length() > FACING_MPS)
        };
        let earlier = (0..index.min(count)).rev().find(moves);
        let found = earlier.or_else(|| (index.min(count)..count).find(moves));
        let slope = found.and_then(|from| self.slope(Some(from)));
        slope.map_or(0.0, |(velocity, _)| velocity.x.atan2(velocity.z))
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;

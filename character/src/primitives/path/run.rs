//! A character on a path.
//!
//! The path has its own clock. It runs with time while the character keeps up. If the character is
//! off the path, or the path is faster than the character can be, the clock slows down, and from
//! then on the character is late.
//!
//! Every plan is a [`Leg`]: the path from the clock's time on, plus the character's distance from
//! it, which fades out.

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;
use troupe_motion::root::wrap_angle;

use super::super::heading::HeadingSpring;
use super::super::reach::{self, Feasible};
use super::super::recipe::{RESYNC_TURN, STANDING_MPS};
use super::{PathCommand, PathMoment};
use crate::style::Style;

/// Least time over which a distance from the path fades out, seconds.
const FADE_S: f32 = 0.5;
/// The same for headings: seconds, and more seconds for each radian.
const TURN_FADE_S: (f32, f32) = (0.5, 0.35);
/// A character nearer to the clock's place than the first value keeps up with it; from the second
/// value on the clock waits, metres.
const OFF_M: (f32, f32) = (0.25, 1.25);
/// A path has ended once the character is within this distance of its end, metres, or this many
/// seconds later.
const ARRIVED: (f32, f32) = (0.2, 1.0);
/// Step of numeric derivatives, seconds.
const STEP_S: f32 = 1.0 / 60.0;

/// A path, and how far a character has come on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::primitives) struct PathRun {
    pub(in crate::primitives) command: PathCommand,
    /// Frame of the command, from which time counts.
    since: u64,
    /// The newest plan's leg; none before the first.
    leg: Option<Leg>,
    /// Delay of the clock, seconds.
    late_s: f32,
}

/// The part of a path that one plan covers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Leg {
    /// The frame at which it begins.
    frame: u64,
    /// The path's time there, seconds.
    clock_s: f32,
    /// Rate of the clock, 0 to 1.
    rate: f32,
    off: Fade,
    /// Heading at its start, radians.
    heading: f32,
    turn_off: Fade,
    /// Heading on the way to a path that is far away, radians.
    towards: Option<f32>,
    /// Added to the path's headings, radians, because the style cannot step aside that far.
    aside: f32,
}

/// A difference that fades to zero. Headings use only x.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Fade {
    from: Vec3,
    rate: Vec3,
    length_s: f32,
}

impl Fade {
    fn at(&self, t: f32) -> Vec3 {
        let left = 1.0 - t / self.length_s;
        if left <= 0.0 {
            return Vec3::ZERO;
        }
        // The cubic curve that ends at 0, at rest.
        let u = 1.0 - left;
        self.from * (left * left * (1.0 + 2.0 * u)) + self.rate * (t * left * left)
    }
}

/// State of a character when a plan begins.
pub(in crate::primitives) struct Now {
    pub(in crate::primitives) frame: u64,
    pub(in crate::primitives) fps: f32,
    pub(in crate::primitives) position: Vec3,
    /// Velocity without the sway of steps, m/s.
    pub(in crate::primitives) velocity: Vec3,
    /// Heading of the pose, radians.
    pub(in crate::primitives) heading: f32,
}

/// A plan's course, by seconds from its start.
#[derive(Debug, Clone, Copy)]
pub(in crate::primitives) struct Way<'a> {
    path: &'a PathCommand,
    leg: Leg,
}

/// How a path ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PathEnd {
    /// Delay against the path's times, seconds.
    pub(crate) late_s: f32,
    /// Distance of the character from the last point, metres.
    pub(crate) off_m: f32,
    /// World position of the last point.
    pub(in crate::primitives) place: Vec3,
    /// Heading there, radians.
    pub(in crate::primitives) heading: f32,
}

impl PathRun {
    pub(in crate::primitives) fn new(frame: u64, command: PathCommand) -> Self {
        Self {
            command,
            since: frame,
            leg: None,
            late_s: 0.0,
        }
    }

    /// The clock at a frame, seconds from the command.
    fn clock_s(&self, frame: u64, fps: f32) -> f32 {
        let passed = |since: u64| frame.saturating_sub(since) as f32 / fps;
        match &self.leg {
            None => passed(self.since),
            Some(leg) => leg.clock_s + leg.rate * passed(leg.frame),
        }
    }

    /// Heading (radians) and turn rate (rad/s) at a frame; none before the first plan.
    pub(in crate::primitives) fn facing(&self, frame: u64, fps: f32) -> Option<(f32, f32)> {
        let way = self.way()?;
        Some(way.heading(frame.saturating_sub(way.leg.frame) as f32 / fps))
    }

    /// The newest plan's course; none before the first.
    pub(in crate::primitives) fn way(&self) -> Option<Way<'_>> {
        let path = &self.command;
        self.leg.map(|leg| Way { path, leg })
    }

    /// Begins a plan that starts now and lasts for `horizon_s`. `spring` has the heading before the
    /// first plan.
    pub(in crate::primitives) fn plan(&mut self, now: &Now, horizon_s: f32, spring: &HeadingSpring) {
        let mut clock_s = self.clock_s(now.frame, now.fps);
        if let Some(leg) = &self.leg {
            self.late_s += (1.0 - leg.rate) * now.frame.saturating_sub(leg.frame) as f32 / now.fps;
        }
        let path = &self.command;
        if let Some(round_s) = path.round_s()
            && clock_s > path.first_s() + round_s
        {
            clock_s -= round_s * ((clock_s - path.first_s()) / round_s).floor();
        }
        let facing = self.facing(now.frame, now.fps);
        let (mut heading, mut omega) = facing.unwrap_or_else(|| spring.at(now.frame, now.fps));
        if wrap_angle(heading - now.heading).abs() > RESYNC_TURN {
            (heading, omega) = (now.heading, 0.0);
        }
        let here = self.command.at(clock_s);
        let leg = Leg::new(&self.command, now, clock_s, here, (heading, omega), horizon_s);
        self.leg = Some(leg);
    }

    /// The end of the path, if the character at `position` has come to it at a frame.
    pub(in crate::primitives) fn end(&self, frame: u64, fps: f32, position: Vec3) -> Option<PathEnd> {
        let (ends_s, clock_s) = (self.command.ends_s()?, self.clock_s(frame, fps));
        let leg = self.leg.filter(|leg| leg.frame <= frame)?;
        let last = self.command.at(ends_s);
        let off_m = (position.with_y(0.0) - last.position).length();
        let (near_m, wait_s) = ARRIVED;
        if clock_s < ends_s || (off_m > near_m && clock_s < ends_s + wait_s) {
            return None;
        }
        Some(PathEnd {
            late_s: self.late_s + (1.0 - leg.rate) * (frame - leg.frame) as f32 / fps,
            off_m,
            place: last.position,
            heading: last.heading,
        })
    }
}

impl Leg {
    fn new(
        path: &PathCommand,
        now: &Now,
        clock_s: f32,
        here: PathMoment,
        (heading, omega): (f32, f32),
        horizon_s: f32,
    ) -> Self {
        let style = &path.style;
        let gap = (now.position - here.position).with_y(0.0);
        let off_m = gap.length();
        let (near, far) = OFF_M;
        let keeps_up = 1.0 - ((off_m - near) / (far - near)).clamp(0.0, 1.0);
        let ahead = path.at(clock_s + horizon_s);
        let rate = keeps_up * possible(style, &here).min(possible(style, &ahead));
        let speed = here.velocity.length().max(style.default_speed_mps);
        let lead_mps = speed.min(fastest(style, Vec3::Z, 0.0)).max(STANDING_MPS);
        let fade_s = (1.5 * off_m / lead_mps).max(FADE_S);
        let towards = (off_m > far).then(|| (-gap.x).atan2(-gap.z));
        let mut leg = Self {
            frame: now.frame,
            clock_s,
            rate,
            off: Fade {
                from: gap,
                rate: now.velocity.with_y(0.0) - here.velocity * rate,
                length_s: fade_s,
            },
            heading,
            turn_off: Fade {
                from: Vec3::ZERO,
                rate: Vec3::ZERO,
                length_s: FADE_S,
            },
            towards,
            aside: 0.0,
        };
        let way = Way { path, leg };
        let Feasible { facing, .. } = way.feasible(horizon_s);
        leg.aside = wrap_angle(facing - way.goal(horizon_s));
        let way = Way { path, leg };
        let turn = wrap_angle(heading - way.goal(0.0));
        let turning = wrap_angle(way.goal(STEP_S) - way.goal(0.0)) / STEP_S;
        let (least, more) = TURN_FADE_S;
        leg.turn_off = Fade {
            from: Vec3::X * turn,
            rate: Vec3::X * (omega - turning),
            length_s: least + more * turn.abs(),
        };
        leg
    }
}

/// How fast a style can move at a moment of a path, relative to the path: 0 to 1.
fn possible(style: &Style, moment: &PathMoment) -> f32 {
    let speed = moment.velocity.length();
    if speed < STANDING_MPS {
        return 1.0;
    }
    (fastest(style, moment.velocity / speed, moment.heading) / speed).min(1.0)
}

/// Highest speed of a style in a direction while facing another, m/s.
pub(super) fn fastest(style: &Style, direction: Vec3, facing: f32) -> f32 {
    /// Faster than any style.
    const FAST_MPS: f32 = 100.0;
    let most = reach::nearest(style, None, direction * FAST_MPS, facing);
    most.velocity.length()
}

impl Way<'_> {
    /// Position after `t` seconds, metres; y is 0.
    pub(in crate::primitives) fn position(&self, t: f32) -> Vec3 {
        let Leg {
            clock_s, rate, off, ..
        } = &self.leg;
        self.path.at(clock_s + rate * t).position + off.at(t)
    }

    /// Velocity after `t` seconds, m/s.
    pub(in crate::primitives) fn velocity(&self, t: f32) -> Vec3 {
        (self.position(t + STEP_S) - self.position(t - STEP_S)) / (2.0 * STEP_S)
    }

    /// Heading after `t` seconds without what is left of the character's own heading, radians.
    fn goal(&self, t: f32) -> f32 {
        let Leg {
            clock_s,
            rate,
            towards,
            aside,
            ..
        } = &self.leg;
        towards.unwrap_or_else(|| self.path.at(clock_s + rate * t).heading) + aside
    }

    /// Heading (radians, within half a turn of that at the start) and turn rate (rad/s) after `t`
    /// seconds.
    pub(in crate::primitives) fn heading(&self, t: f32) -> (f32, f32) {
        let at = |t: f32| {
            self.leg.heading + wrap_angle(self.goal(t) + self.leg.turn_off.at(t).x - self.leg.heading)
        };
        let heading = at(t);
        (heading, wrap_angle(at(t + STEP_S) - heading) / STEP_S)
    }

    /// Mean motion of the first `horizon_s` seconds, or the nearest that the style can do.
    pub(in crate::primitives) fn feasible(&self, horizon_s: f32) -> Feasible {
        let velocity = (self.position(horizon_s) - self.position(0.0)) / horizon_s;
        reach::nearest(&self.path.style, None, velocity, self.goal(horizon_s))
    }
}

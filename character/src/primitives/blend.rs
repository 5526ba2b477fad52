//! The blendspace: which gaits, how much of each, and how fast, for a velocity and a height (paper
//! appendix D).
//!
//! Weights are by gradient bands (Johansen 2009, "Automated semi-procedural animation", section
//! 6.3) over speed, direction, turning and height: a gait's weight falls from 1 at its own velocity
//! to 0 at any other gait's. Poses are then mixed in joint space at one phase. Standing is the
//! limit of any gait at no speed and takes its share by the ratio of the speeds.

use std::f32::consts::TAU;

use troupe_motion::root::wrap_angle;
use troupe_motion::{Quat, Vec3};

use super::recipe::{
    BLEND_ARC, DIRECTION_SCALE, HEIGHT_SCALE, RATE_POWER, RATE_RANGE, REVERSE_COSINE, STAND_FRAMES,
    STANDING_MPS, STARTING_MPS, STRIDE_POWER, TURN_SCALE,
};
use crate::style::cycles::{Cycles, MATCH_STEPS, Moment};
use crate::style::{Gait, MAX_GAITS, STANDING_GAIT_MPS, Style, TURN_RADIUS_M};

/// Frames a second that styles are given at.
pub(crate) const STYLE_FPS: f32 = 30.0;
/// Weights below this are left out.
const MIN_WEIGHT: f32 = 1e-4;
/// A sum of unscaled weights below this is none.
const LEAST_SUM: f32 = 1e-9;
/// Gaits closer together than this are one: the first is taken.
const SAME: f32 = 1e-3;

/// What to move like, in the frame of the heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    /// Velocity to the left, m/s.
    pub(crate) left_mps: f32,
    /// Velocity forward, m/s.
    pub(crate) forward_mps: f32,
    /// Turning rate, rad/s.
    pub(crate) turn_rps: f32,
    /// Height of the root joint, metres, where the command gives one.
    pub(crate) height_m: Option<f32>,
}

/// A gait's share of a blend.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Share {
    gait: usize,
    weight: f32,
    /// The gait stands: it has its own phase, or is held at one.
    stands: Option<Stand>,
}

/// How a standing gait passes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stand {
    /// With the time.
    Lives,
    /// A moving gait held at one key, for want of one that stands.
    Held(usize),
}

/// A mix of gaits.
#[derive(Debug, Clone)]
pub(crate) struct Blend<'a> {
    style: &'a Style,
    cycles: &'a Cycles,
    shares: [Share; MAX_GAITS + 1],
    len: usize,
    /// Phase that passes in a frame at 30 Hz, in cycles; below 0 for a gait that runs backwards, 0
    /// for one that stands.
    pub(crate) rate: f32,
    /// Mean period of the gaits that move, frames at 30 Hz.
    period_frames: f32,
    /// Share of gaits that move, 0 to 1.
    pub(crate) moving: f32,
}

impl<'a> Blend<'a> {
    /// The mix for `wanted`. `only`: the one gait to use, beside standing.
    pub(crate) fn new(style: &'a Style, cycles: &'a Cycles, only: Option<usize>, wanted: &Wanted) -> Self {
        let none = Share {
            gait: 0,
            weight: 0.0,
            stands: None,
        };
        let mut blend = Self {
            style,
            cycles,
            shares: [none; MAX_GAITS + 1],
            len: 0,
            rate: 0.0,
            period_frames: 0.0,
            moving: 0.0,
        };
        let x = Point::wanted(style, wanted);
        let mut weights = [0.0; MAX_GAITS];
        let takes = |gait: &Gait, index: usize| !gait.stands() && only.is_none_or(|only| only == index);
        if bands(style, &x, takes, &mut weights) {
            let pace = SpeedMatch::new(style, &weights, wanted);
            blend.moving = pace.share();
            if blend.moving > 0.0 {
                blend.rate = pace.rate();
            }
            blend.period_frames = pace.period_frames;
            blend.add(&weights, blend.moving, None);
        }
        if blend.moving < 1.0 {
            blend.add_standing(&x, only);
        }
        blend.normalise();
        blend
    }

    fn add(&mut self, weights: &[f32; MAX_GAITS], share: f32, stands: Option<Stand>) {
        for (gait, &weight) in weights.iter().enumerate() {
            if weight * share > MIN_WEIGHT && self.len < self.shares.len() {
                self.shares[self.len] = Share {
                    gait,
                    weight: weight * share,
                    stands,
                };
                self.len += 1;
            }
        }
    }

    /// What fell below the least weight goes to the others.
    fn normalise(&mut self) {
        let sum: f32 = self.shares().iter().map(|share| share.weight).sum();
        for share in &mut self.shares[..self.len] {
            share.weight /= sum;
        }
    }

    fn add_standing(&mut self, x: &Point, only: Option<usize>) {
        let still = Point {
            speed: 0.0,
            turn: 0.0,
            ..*x
        };
        let only = only.filter(|&index| self.style.gaits[index].stands());
        let takes = |gait: &Gait, index: usize| gait.stands() && only.is_none_or(|only| only == index);
        let mut weights = [0.0; MAX_GAITS];
        if bands(self.style, &still, takes, &mut weights) {
            self.add(&weights, 1.0 - self.moving, Some(Stand::Lives));
        } else {
            let slowest = self.style.slowest_gait();
            weights[slowest] = 1.0;
            let key = self.style.gaits[slowest].highest_key();
            self.add(&weights, 1.0 - self.moving, Some(Stand::Held(key)));
        }
    }

    fn shares(&self) -> &[Share] {
        &self.shares[..self.len]
    }

    /// How fast the gaits run against how they were captured; below 0 backwards, 0 for one that
    /// stands.
    pub(crate) fn hurry(&self) -> f32 {
        self.rate * self.period_frames
    }

    /// Runs so many times as fast, as far as the networks make the steps: those that are followed
    /// would slide.
    pub(crate) fn hurry_by(&mut self, times: f32) {
        self.rate *= 1.0 + (times - 1.0) * (1.0 - self.built());
    }

    /// How much of what moves is of gaits that were worked out, 0 to 1.
    pub(crate) fn built(&self) -> f32 {
        let moving = || self.shares().iter().filter(|share| share.stands.is_none());
        let built = moving().filter(|share| self.style.gaits[share.gait].built);
        let all: f32 = moving().map(|share| share.weight).sum();
        built.map(|share| share.weight).sum::<f32>() / all.max(MIN_WEIGHT)
    }

    /// The names of the gaits with their weights, which sum to 1; a gait is named once.
    pub(crate) fn named(&self) -> Vec<(String, f32)> {
        let mut named: Vec<(String, f32)> = Vec::with_capacity(self.len);
        for share in self.shares() {
            let name = &self.style.gaits[share.gait].name;
            match named.iter_mut().find(|(there, _)| there == name) {
                Some((_, weight)) => *weight += share.weight,
                None => named.push((name.clone(), share.weight)),
            }
        }
        named
    }

    /// Phase of a share's gait, where the moving ones are at `phase` and the time is `frame` (at 30
    /// Hz).
    fn phase_of(&self, share: &Share, phase: f32, frame: u64) -> f32 {
        let gait = &self.style.gaits[share.gait];
        let keys = gait.keys.len() as u64;
        let cycle = &self.cycles.gaits[share.gait];
        match share.stands {
            None => phase,
            Some(Stand::Held(key)) => cycle.phase_of_key(key),
            Some(Stand::Lives) if gait.period_frames >= 1.0 => {
                (frame as f64 / f64::from(gait.period_frames)).rem_euclid(1.0) as f32
            }
            Some(Stand::Lives) => cycle.phase_of_key((frame / STAND_FRAMES % keys) as usize),
        }
    }

    /// The mix at a phase: the pose, joint 0 facing +Z without the sway, into `pose`; the rest
    /// comes back.
    pub(crate) fn sample(&self, phase: f32, frame: u64, pose: &mut [Quat]) -> Moment {
        let mut mixed = Moment::default();
        for (index, share) in self.shares().iter().enumerate() {
            let gait = &self.style.gaits[share.gait];
            let at = self.phase_of(share, phase, frame);
            let moment = self.cycles.gaits[share.gait].sample(gait, at, |joint, q| {
                let Some(sum) = pose.get_mut(joint) else { return };
                if index == 0 {
                    *sum = q * share.weight;
                } else {
                    // q and -q are one rotation: the one on the side of the others.
                    let side = if sum.dot(q) < 0.0 { -1.0 } else { 1.0 };
                    *sum += q * (side * share.weight);
                }
            });
            mixed.add(&share.of(moment), share.weight);
        }
        for q in pose.iter_mut() {
            let length = q.length();
            *q = if length > 1e-6 {
                *q / length
            } else {
                Quat::IDENTITY
            };
        }
        mixed
    }

    /// The mix at a phase without the pose.
    pub(crate) fn moment(&self, phase: f32, frame: u64) -> Moment {
        let mut mixed = Moment::default();
        for share in self.shares() {
            let at = self.phase_of(share, phase, frame);
            let moment = self.cycles.gaits[share.gait].moment(&self.style.gaits[share.gait], at);
            mixed.add(&share.of(moment), share.weight);
        }
        mixed
    }

    /// The squared distance of each matching step of the mix to a pose: positions relative to the
    /// projected root, facing +Z, and velocities, both one a joint. `velocity_s` weighs velocities
    /// against positions.
    pub(crate) fn distances(
        &self,
        positions: &[Vec3],
        velocities: &[Vec3],
        velocity_s: f32,
        frame: u64,
        out: &mut [f32; MATCH_STEPS],
    ) {
        let direction = if self.rate < 0.0 { -1.0 } else { 1.0 };
        let joints = positions.len();
        let mut rows = [0; MAX_GAITS + 1];
        for (step, out) in out.iter_mut().enumerate() {
            for (row, share) in rows.iter_mut().zip(self.shares()) {
                let phase = self.phase_of(share, step as f32 / MATCH_STEPS as f32, frame);
                let nearest = (phase.rem_euclid(1.0) * MATCH_STEPS as f32).round() as usize;
                *row = nearest % MATCH_STEPS * joints;
            }
            *out = 0.0;
            for joint in 0..joints {
                let (mut p, mut v) = (Vec3::ZERO, Vec3::ZERO);
                for (row, share) in rows.iter().zip(self.shares()) {
                    let cycle = &self.cycles.gaits[share.gait];
                    p += cycle.positions[row + joint] * share.weight;
                    if !matches!(share.stands, Some(Stand::Held(_))) {
                        v += cycle.velocities[row + joint] * (share.weight * direction);
                    }
                }
                let apart = p.distance_squared(positions[joint])
                    + v.distance_squared(velocities[joint]) * (velocity_s * velocity_s);
                *out += apart * self.cycles.joint_weights[joint];
            }
        }
    }
}

impl Share {
    /// What a gait's moment adds: one that is held does not move.
    fn of(&self, moment: Moment) -> Moment {
        match self.stands {
            Some(Stand::Held(_)) => Moment {
                height_m: moment.height_m,
                ..Moment::default()
            },
            _ => moment,
        }
    }
}

/// The speed of a mix of moving gaits against the wanted one.
struct SpeedMatch {
    /// Wanted and mixed speed over the ground with the turning in it, m/s.
    wanted_mps: f32,
    mixed_mps: f32,
    period_frames: f32,
    backwards: bool,
}

impl SpeedMatch {
    fn new(style: &Style, weights: &[f32; MAX_GAITS], wanted: &Wanted) -> Self {
        let (mut speed, mut turn, mut left, mut forward) = (0.0, 0.0, 0.0, 0.0);
        let (mut period, mut timed) = (0.0, 0.0);
        for (gait, &weight) in style.gaits.iter().zip(weights) {
            // Sizes, not vectors: gaits of opposite directions do not make a slow one.
            speed += weight * gait.speed_mps();
            turn += weight * gait.turn_rps.abs();
            left += weight * gait.left_mps;
            forward += weight * gait.forward_mps;
            if gait.period_frames >= 1.0 {
                period += weight * gait.period_frames;
                timed += weight;
            }
        }
        let wanted_speed = wanted.left_mps.hypot(wanted.forward_mps);
        // Turning counts only as far as the gaits turn: walking a curve is no faster than walking
        // straight on.
        let wanted_turn = wanted.turn_rps.abs().min(turn * RATE_RANGE.1);
        let dot = wanted.left_mps * left + wanted.forward_mps * forward;
        Self {
            wanted_mps: wanted_speed.hypot(TURN_RADIUS_M * wanted_turn),
            mixed_mps: speed.hypot(TURN_RADIUS_M * turn).max(STANDING_GAIT_MPS),
            period_frames: if timed > 0.0 { period / timed } else { 0.0 },
            backwards: dot < REVERSE_COSINE * wanted_speed * left.hypot(forward),
        }
    }

    fn ratio(&self) -> f32 {
        self.wanted_mps / self.mixed_mps
    }

    /// Share of the moving gaits: all from their own speed on, none below [`STANDING_MPS`].
    fn share(&self) -> f32 {
        let full = STARTING_MPS.min(self.mixed_mps);
        let start = (self.wanted_mps - STANDING_MPS) / (full - STANDING_MPS).max(SAME);
        self.ratio().min(1.0).powf(STRIDE_POWER) * start.clamp(0.0, 1.0)
    }

    /// Cycles in a frame at 30 Hz.
    fn rate(&self) -> f32 {
        if self.period_frames < 1.0 {
            return 0.0;
        }
        let rate = self.ratio().clamp(RATE_RANGE.0, RATE_RANGE.1).powf(RATE_POWER) / self.period_frames;
        if self.backwards { -rate } else { rate }
    }
}

/// A place in the blendspace.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    speed: f32,
    /// Direction against the heading, radians.
    angle: f32,
    turn: f32,
    /// 0 where the style's gaits are of one height.
    height: f32,
}

impl Point {
    fn wanted(style: &Style, wanted: &Wanted) -> Self {
        let height = style.height_range_m().map_or(0.0, |(low, high)| {
            let own = || style.gaits[style.slowest_gait()].height_m();
            wanted.height_m.unwrap_or_else(own).clamp(low, high)
        });
        Self {
            speed: wanted.left_mps.hypot(wanted.forward_mps),
            angle: wanted.left_mps.atan2(wanted.forward_mps),
            turn: wanted.turn_rps,
            height,
        }
    }

    fn of(gait: &Gait, ranges_in_height: bool) -> Self {
        Self {
            speed: gait.speed_mps(),
            angle: gait.left_mps.atan2(gait.forward_mps),
            turn: gait.turn_rps,
            height: if ranges_in_height { gait.height_m() } else { 0.0 },
        }
    }

    /// How far `x` is on the way from `self` to `other`: 0 here, 1 there. `None`: both are the same
    /// place.
    fn towards(&self, other: &Self, x: &Self) -> Option<f32> {
        let height = HEIGHT_SCALE * (other.height - self.height);
        let x_height = HEIGHT_SCALE * (x.height - self.height);
        let (along, length) = if self.goes() && other.goes() {
            self.towards_over_ground(other, x)
        } else {
            self.towards_on_the_spot(other, x)
        };
        let length = length + height * height;
        (length > SAME * SAME).then(|| (along + height * x_height) / length)
    }

    /// Between two gaits that go somewhere: speeds against their mean, direction and turning. Gaits
    /// of one direction are told apart by their speeds, gaits of quite different ones by the
    /// direction alone. The way along, and the whole way, squared.
    fn towards_over_ground(&self, other: &Self, x: &Self) -> (f32, f32) {
        let between = wrap_angle(other.angle - self.angle).abs();
        let aligned = (1.0 - between / BLEND_ARC).max(0.0);
        let per_mean = 2.0 * aligned / (self.speed + other.speed);
        let speed = (other.speed - self.speed) * per_mean;
        let angle = between * DIRECTION_SCALE;
        let turn = (other.turn - self.turn) * TURN_SCALE;
        let along = speed * (x.speed - self.speed) * per_mean
            + angle * angle * self.share_of_arc(other, between, x)
            + turn * (x.turn - self.turn) * TURN_SCALE;
        (along, speed * speed + angle * angle + turn * turn)
    }

    /// Between two gaits of which one at least only turns or stands: how much of the motion is
    /// turning, or where that does not differ, how fast it turns.
    fn towards_on_the_spot(&self, other: &Self, x: &Self) -> (f32, f32) {
        let lean = other.lean() - self.lean();
        if lean.abs() > SAME {
            (lean * (x.lean() - self.lean()), lean * lean)
        } else {
            let turn = (other.turn - self.turn) * TURN_SCALE;
            (turn * (x.turn - self.turn) * TURN_SCALE, turn * turn)
        }
    }

    fn goes(&self) -> bool {
        self.speed > STANDING_GAIT_MPS
    }

    /// From going straight on, 0, to turning on the spot, a quarter of a turn to either side.
    fn lean(&self) -> f32 {
        (self.turn * TURN_RADIUS_M).atan2(self.speed)
    }

    /// How far the direction of `x` is from this one's to `other`'s, the way round that it lies on,
    /// 0 to 1. Over a way longer than [`BLEND_ARC`] it changes only in the middle of it.
    fn share_of_arc(&self, other: &Self, between: f32, x: &Self) -> f32 {
        let here = wrap_angle(x.angle - self.angle).abs();
        let there = wrap_angle(x.angle - other.angle).abs();
        let inside = here + there <= between + SAME;
        let (way, gone) = if inside {
            (between, here)
        } else {
            // Round the back: from here away from the other.
            let way = TAU - between;
            let gone = if here <= there { here } else { way - there };
            (way, gone)
        };
        let share = gone / way.max(SAME);
        ((share - 0.5) * (way / BLEND_ARC).max(1.0) + 0.5).clamp(0.0, 1.0)
    }
}

/// Gradient band weights of the gaits that `takes` chooses, summing to 1. `false`: it chooses none.
///
/// A gait's weight is the product of what is left of it on the way to each other gait. The smallest
/// of these, as in the original, would make directions change the faster the less all of them
/// count.
fn bands(
    style: &Style,
    x: &Point,
    takes: impl Fn(&Gait, usize) -> bool,
    weights: &mut [f32; MAX_GAITS],
) -> bool {
    let in_height = style.height_range_m().is_some();
    let mut points = [None; MAX_GAITS];
    for (index, gait) in style.gaits.iter().enumerate().take(MAX_GAITS) {
        points[index] = takes(gait, index).then(|| Point::of(gait, in_height));
    }
    let mut best = None;
    for (index, point) in points.iter().enumerate() {
        let Some(point) = point else { continue };
        let (mut product, mut least) = (1.0, 1.0f32);
        for (other_index, other) in points.iter().enumerate() {
            let Some(other) = other else { continue };
            let left = match point.towards(other, x) {
                Some(share) => 1.0 - share,
                // Of gaits in one place the first counts.
                None if other_index < index => f32::NEG_INFINITY,
                None => 1.0,
            };
            product *= left.clamp(0.0, 1.0);
            least = least.min(left);
        }
        weights[index] = product;
        if best.is_none_or(|(_, most)| least > most) {
            best = Some((index, least));
        }
    }
    let Some((best, _)) = best else { return false };
    if weights.iter().sum::<f32>() < LEAST_SUM {
        // Outside of all bands.
        weights.fill(0.0);
        weights[best] = 1.0;
    }
    let sum: f32 = weights.iter().sum();
    for weight in weights {
        *weight /= sum;
    }
    true
}

#[cfg(test)]
#[path = "blend_tests.rs"]
mod tests;

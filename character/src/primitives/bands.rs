//! Gradient bands: how much of each gait a velocity takes (Johansen 2009, "Automated
//! semi-procedural animation", section 6.3).
//!
//! They run over speed, direction, turning and height: a gait's weight falls from 1 at its own
//! velocity to 0 at any other gait's.

use std::f32::consts::TAU;

use troupe_motion::root::wrap_angle;

use super::blend::Wanted;
use super::recipe::{BLEND_ARC, DIRECTION_SCALE, HEIGHT_SCALE, TURN_SCALE};
use crate::style::{Gait, MAX_GAITS, STANDING_GAIT_MPS, Style, TURN_RADIUS_M};

/// A smaller sum of weights, before scaling, counts as 0.
const LEAST_SUM: f32 = 1e-9;
/// Gaits closer together than this count as one: the first is taken.
pub(super) const SAME: f32 = 1e-3;

/// A point of the blendspace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub(super) speed: f32,
    /// Direction relative to the heading, radians.
    pub(super) angle: f32,
    pub(super) turn: f32,
    /// 0 if all gaits of the style have the same height.
    pub(super) height: f32,
}

impl Point {
    pub(super) fn wanted(style: &Style, wanted: &Wanted) -> Self {
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

    /// How far `x` is on the way from `self` to `other`: 0 here, 1 there. `None` if both are the
    /// same point.
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

    /// Between two gaits that travel: speeds relative to their mean, direction and turning. Gaits
    /// of similar direction differ by speed; gaits of quite different directions by direction
    /// alone. Returns the way along and the whole way, squared.
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

    /// Between two gaits of which at least one only turns or stands: by the share of turning in the
    /// motion, or, if that is the same, by the rate of turning.
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

    /// From 0, straight ahead, to a quarter of a turn to either side, turning on the spot.
    fn lean(&self) -> f32 {
        (self.turn * TURN_RADIUS_M).atan2(self.speed)
    }

    /// How far the direction of `x` is on the way from this direction to `other`'s, going the way
    /// round on which it lies, 0 to 1. If the arc is longer than [`BLEND_ARC`], the share changes
    /// only in its middle.
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

/// Gradient band weights of the gaits that `takes` accepts, with sum 1. `false` if it accepts none.
///
/// A gait's weight is the product of its remaining shares on the way to each other gait. The
/// original takes the smallest of them, which makes directions change faster the smaller all
/// weights are.
pub(super) fn bands(
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
                // Of gaits at one point, the first counts.
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

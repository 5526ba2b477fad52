//! What a style can do: how fast in which direction, and with which heading.

use std::f32::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;

use super::recipe::{
    BACK_ARC, FAST_ARC, FORWARD_ARC, GAIT_ARC, OFF_AXIS_PACE_MPS, SPEED_MARGIN, STANDING_MPS,
};
use crate::style::{Gait, Style};

/// Angles from a gait's direction, and the share of walking pace left there.
const WALKING_ARC: [(f32, f32); 3] = [(0.35, 1.0), (1.57, 0.7), (3.15, 0.5)];
/// Slower gaits do not count as a walking pace, m/s.
const LEAST_PACE_MPS: f32 = 0.2;
/// If a gait travels within this angle of straight aside, radians, the character need not turn.
const STRAIGHT_ASIDE: f32 = 0.52;
/// A difference between a command and what is done instead is reported if the speed is lower by
/// more than this share, or the heading off by more than the angle, radians.
const REPORTED_SHARE: f32 = 0.05;
const REPORTED_TURN: f32 = 0.087;

/// A motion that a style can do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Feasible {
    /// World velocity over the ground, m/s.
    pub(crate) velocity: Vec3,
    /// Heading, radians.
    pub(crate) facing: f32,
}

/// What a character does instead of a command that its style cannot follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instead {
    /// Speed over the ground that the command asks for, m/s.
    pub wanted_mps: f32,
    /// Speed over the ground that it gets, m/s.
    pub speed_mps: f32,
    /// Heading that it gets, radians. None if the command gives no heading, or gets it.
    pub facing: Option<f32>,
}

impl Feasible {
    /// What this motion is instead of a command, if the two differ visibly.
    pub(crate) fn instead_of(&self, velocity: Vec3, facing: Option<f32>) -> Option<Instead> {
        let (wanted_mps, speed_mps) = (velocity.with_y(0.0).length(), self.velocity.length());
        let slower = wanted_mps >= STANDING_MPS && wanted_mps - speed_mps > REPORTED_SHARE * wanted_mps;
        let facing = facing
            .filter(|facing| wrap_angle(facing - self.facing).abs() > REPORTED_TURN)
            .map(|_| self.facing);
        (slower || facing.is_some()).then_some(Instead {
            wanted_mps,
            speed_mps,
            facing,
        })
    }
}

/// The motion nearest to `velocity` (world, m/s) and `facing` that `style` has gaits for, or the
/// gait `only`. It is slower if the velocity is too high, and faces more in the direction of travel
/// if the character would have to step aside.
pub(crate) fn nearest(style: &Style, only: Option<usize>, velocity: Vec3, facing: f32) -> Feasible {
    let still = Feasible {
        velocity: Vec3::ZERO,
        facing,
    };
    let velocity = velocity.with_y(0.0);
    let speed = velocity.length();
    if speed < STANDING_MPS {
        return still;
    }
    let local = yaw(-facing) * velocity;
    let off = local.x.atan2(local.z);
    let gaits = || {
        let chosen = style.gaits.iter().enumerate();
        chosen
            .filter(move |(index, _)| only.is_none_or(|only| only == *index))
            .map(|(_, gait)| gait)
            .filter(|gait| gait.speed_mps() > STANDING_MPS)
    };
    if let Some(words) = &style.words {
        return Feasible {
            velocity: velocity.clamp_length_max(words.max_speed_mps),
            facing,
        };
    }
    let most = fastest(gaits, off) * SPEED_MARGIN;
    if most < STANDING_MPS {
        return still;
    }
    let arc = forward_arc(gaits, off);
    let turned = if off.abs() > arc && off.abs() < BACK_ARC {
        off.signum() * (off.abs() - arc)
    } else {
        0.0
    };
    Feasible {
        velocity: velocity * (most / speed).min(1.0),
        facing: wrap_angle(facing + turned),
    }
}

/// Highest speed in a direction `off` radians to the left of the heading, m/s.
fn fastest<'a, I: Iterator<Item = &'a Gait>>(gaits: impl Fn() -> I, off: f32) -> f32 {
    let pace = gaits()
        .filter(|gait| !gait.built)
        .map(Gait::speed_mps)
        .filter(|&speed| speed > LEAST_PACE_MPS)
        .fold(OFF_AXIS_PACE_MPS, f32::min);
    gaits()
        .map(|gait| {
            let apart = wrap_angle(off - direction(gait)).abs();
            let walking = gait.speed_mps().min(pace);
            walking * walking_share(apart) + (gait.speed_mps() - walking) * fast_share(apart)
        })
        .fold(0.0, f32::max)
}

/// Largest angle of the velocity to the heading, on the side of `off`, radians.
fn forward_arc<'a, I: Iterator<Item = &'a Gait>>(gaits: impl Fn() -> I, off: f32) -> f32 {
    // With a gait straight aside this side goes up to it: what lies beyond belongs to gaits that go
    // backwards.
    if gaits().any(|gait| (direction(gait) * off.signum() - FRAC_PI_2).abs() < STRAIGHT_ASIDE) {
        return PI;
    }
    gaits()
        .map(|gait| direction(gait) * off.signum() + GAIT_ARC)
        .filter(|&arc| arc < BACK_ARC)
        .fold(FORWARD_ARC, f32::max)
}

fn direction(gait: &Gait) -> f32 {
    gait.left_mps.atan2(gait.forward_mps)
}

fn fast_share(apart: f32) -> f32 {
    let (full, gone) = FAST_ARC;
    ((gone - apart) / (gone - full)).clamp(0.0, 1.0)
}

/// Piecewise linear in the angle.
fn walking_share(apart: f32) -> f32 {
    let [(near, full), rest @ ..] = WALKING_ARC;
    let mut from = (near, full);
    for to in rest {
        if apart <= to.0 {
            let share = ((apart - from.0) / (to.0 - from.0)).max(0.0);
            return from.1 + (to.1 - from.1) * share;
        }
        from = to;
    }
    from.1
}

#[cfg(test)]
#[path = "reach_tests.rs"]
mod tests;

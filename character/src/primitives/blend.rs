//! The blendspace: which gaits, how much of each, and how fast, for a velocity and a height (paper
//! appendix D).
//!
//! Weights are gradient bands ([`super::bands`]). Poses are then mixed in joint space at one phase.
//! Standing is the limit of every gait at speed 0. Its share follows from the ratio of the speeds.

use troupe_motion::{Quat, Vec3};

use super::bands::{Point, SAME, bands};
use super::recipe::{
    RATE_POWER, RATE_RANGE, REVERSE_COSINE, STAND_FRAMES, STANDING_MPS, STARTING_MPS, STRIDE_POWER,
};
use crate::style::cycles::{Cycles, MATCH_STEPS, Moment};
use crate::style::{Gait, MAX_GAITS, STANDING_GAIT_MPS, Style, TURN_RADIUS_M};

/// Frame rate of the gaits of styles, Hz.
pub(crate) const STYLE_FPS: f32 = 30.0;
/// Smaller weights are dropped.
const MIN_WEIGHT: f32 = 1e-4;

/// The motion that is wanted, in the frame of reference of the heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    /// Velocity to the left, m/s.
    pub(crate) left_mps: f32,
    /// Velocity forward, m/s.
    pub(crate) forward_mps: f32,
    /// Turning rate, rad/s.
    pub(crate) turn_rps: f32,
    /// Height of the root joint, metres. `None`: the gaits' own.
    pub(crate) height_m: Option<f32>,
}

/// A gait's share of a blend.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Share {
    gait: usize,
    weight: f32,
    /// How the gait stands; none if it moves.
    stands: Option<Stand>,
}

/// How a standing gait runs.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stand {
    /// By time: it is a standing gait.
    Lives,
    /// Not at all: a moving gait held at one key, in a style without a standing one.
    Held(usize),
}

/// A weighted mix of gaits at one phase.
#[derive(Debug, Clone)]
pub(crate) struct Blend<'a> {
    style: &'a Style,
    cycles: &'a Cycles,
    shares: [Share; MAX_GAITS + 1],
    len: usize,
    /// Cycles a frame at 30 Hz. Negative for a gait that runs backwards, 0 for one that stands.
    pub(crate) rate: f32,
    /// Mean period of the moving gaits, frames at 30 Hz.
    period_frames: f32,
    /// Share of the moving gaits, 0 to 1.
    pub(crate) moving: f32,
}

impl<'a> Blend<'a> {
    /// The mix for `wanted`. `only` limits it to one moving gait; standing stays.
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

    /// Scales the weights to a sum of 1 after small ones were dropped.
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

    /// Speed of the gaits relative to their capture: negative if they run backwards, 0 if they
    /// stand.
    pub(crate) fn hurry(&self) -> f32 {
        self.rate * self.period_frames
    }

    /// Speeds the gaits up by a factor, as far as the networks make the steps. Gaits that are
    /// followed directly would slide.
    pub(crate) fn hurry_by(&mut self, times: f32) {
        self.rate *= 1.0 + (times - 1.0) * (1.0 - self.built());
    }

    /// Share of built gaits among the moving ones, 0 to 1.
    pub(crate) fn built(&self) -> f32 {
        let moving = || self.shares().iter().filter(|share| share.stands.is_none());
        let built = moving().filter(|share| self.style.gaits[share.gait].built);
        let all: f32 = moving().map(|share| share.weight).sum();
        built.map(|share| share.weight).sum::<f32>() / all.max(MIN_WEIGHT)
    }

    /// The names of the gaits with their weights, which sum to 1. Each name comes once.
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

    /// Phase of a share's gait when the moving gaits are at `phase` and the time is `frame`, at 30
    /// Hz.
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

    /// The mix at a phase. Writes the pose to `pose`, with joint 0 facing +Z without the sway, and
    /// returns the rest.
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
                    // q and -q are the same rotation: take the one on the side of the others.
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

    /// The mix at a phase, without the pose.
    pub(crate) fn moment(&self, phase: f32, frame: u64) -> Moment {
        let mut mixed = Moment::default();
        for share in self.shares() {
            let at = self.phase_of(share, phase, frame);
            let moment = self.cycles.gaits[share.gait].moment(&self.style.gaits[share.gait], at);
            mixed.add(&share.of(moment), share.weight);
        }
        mixed
    }

    /// Squared distance of each matching step of the mix to a pose. The pose has positions relative
    /// to the projected root, facing +Z, and velocities, both one a joint. `velocity_s` weighs
    /// velocities against positions.
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
    /// What a gait's moment adds; a held gait adds no motion.
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

/// The speed of a mix of moving gaits, compared with the wanted speed.
struct SpeedMatch {
    /// Wanted and mixed speed over the ground, with turning, m/s.
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
            // Lengths, not vectors: gaits of opposite directions do not make a slow one.
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
        // Turning counts only as far as the gaits turn: a curve is walked no faster than a straight
        // line.
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

    /// Share of the moving gaits: 1 from their own speed on, 0 below [`STANDING_MPS`].
    fn share(&self) -> f32 {
        let full = STARTING_MPS.min(self.mixed_mps);
        let start = (self.wanted_mps - STANDING_MPS) / (full - STANDING_MPS).max(SAME);
        self.ratio().min(1.0).powf(STRIDE_POWER) * start.clamp(0.0, 1.0)
    }

    /// Cycles a frame at 30 Hz.
    fn rate(&self) -> f32 {
        if self.period_frames < 1.0 {
            return 0.0;
        }
        let rate = self.ratio().clamp(RATE_RANGE.0, RATE_RANGE.1).powf(RATE_POWER) / self.period_frames;
        if self.backwards { -rate } else { rate }
    }
}

#[cfg(test)]
#[path = "blend_tests.rs"]
mod tests;

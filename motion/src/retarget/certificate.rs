//! What a retargeted clip keeps of its source, in figures.

use glam::{Quat, Vec3};
use serde::Serialize;

use super::Figure;
use crate::anatomy::Limb;
use crate::clip::Clip;
use crate::fk::WorldMotion;

/// A foot stands while it is nearer to its height in the neutral pose than this share of the leg.
const STANDS_SHARE: f32 = 0.015;
/// Faster feet do not stand: leg lengths a second.
const STANDS_PER_S: f32 = 0.4;
/// Largest mean angle between bones that passes, and that of a single bone, degrees.
const MOST_DEG: [f32; 2] = [5.0, 15.0];
/// Standing feet may slide by this factor of the source's speed, and this much more, m/s.
const MOST_SKATE: (f32, f32) = (1.2, 0.02);
/// Feet may be this far under the ground, and short of their places, metres.
const MOST_M: f32 = 0.02;

/// What a retargeted clip keeps of its source. Lengths and speeds are in the target's size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Mean angle between the bones of limbs in the source and in the target, degrees.
    pub directions_deg: f32,
    /// The largest mean of a single bone, degrees.
    pub worst_deg: f32,
    /// Mean speed of the target's feet over the ground while the source's stand, m/s.
    pub skate_mps: f32,
    /// The same of the source's feet, scaled.
    pub source_skate_mps: f32,
    /// Farthest that a foot is under the ground, deeper than in the source, metres.
    pub under_m: f32,
    /// Farthest that a foot remains from its place, metres.
    pub short_m: f32,
}

impl Figures {
    /// The figures of a clip and what a retargeter made of it. `short_m` is its largest.
    pub fn of(figures: [&Figure; 2], clips: [&Clip; 2], short_m: f32) -> Self {
        let [source, target] = figures;
        let scale = target.leg_m / source.leg_m;
        let worlds = clips.map(WorldMotion::from_clip);
        let pairs = limbs(source, target);
        let angles: Vec<f32> = pairs
            .iter()
            .flat_map(|&limbs| bones(figures, &worlds, limbs))
            .collect();
        let feet = Feet::of(figures, &worlds, scale, clips[0].fps);
        Self {
            directions_deg: angles.iter().sum::<f32>() / angles.len().max(1) as f32,
            worst_deg: angles.iter().copied().fold(0.0, f32::max),
            skate_mps: feet.mean(1),
            source_skate_mps: feet.mean(0),
            under_m: feet.under_m,
            short_m,
        }
    }

    /// Each figure with what it is, for people.
    pub fn rows(&self) -> [(&'static str, String); 5] {
        [
            (
                "angle between bones of limbs, mean (of the worst bone)",
                format!("{:.1}° ({:.1}°)", self.directions_deg, self.worst_deg),
            ),
            (
                "speed of standing feet",
                format!("{:.1} cm/s", 1e2 * self.skate_mps),
            ),
            (
                "the same in the clip, scaled",
                format!("{:.1} cm/s", 1e2 * self.source_skate_mps),
            ),
            (
                "feet under the ground, deeper than in the clip",
                format!("{:.1} cm", 1e2 * self.under_m),
            ),
            (
                "feet short of their places",
                format!("{:.1} cm", 1e2 * self.short_m),
            ),
        ]
    }

    /// What is beyond the bar: each as a sentence. Empty if all is well.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let mut most = |what: &str, value: f32, most: f32, unit: &str| {
            if value > most || value.is_nan() {
                faults.push(format!("{what} is {value:.3}{unit}; allowed: {most:.3}{unit}"));
            }
        };
        most(
            "the mean difference of bones",
            self.directions_deg,
            MOST_DEG[0],
            "°",
        );
        most(
            "the largest difference of a bone",
            self.worst_deg,
            MOST_DEG[1],
            "°",
        );
        let skate = self.source_skate_mps * MOST_SKATE.0 + MOST_SKATE.1;
        most("sliding of standing feet", self.skate_mps, skate, " m/s");
        most("depth of feet under the ground", self.under_m, MOST_M, " m");
        most("distance of feet from their places", self.short_m, MOST_M, " m");
        faults
    }
}

/// The limbs of both bodies, one beside the other.
fn limbs<'a>(source: &'a Figure, target: &'a Figure) -> Vec<[&'a Limb; 2]> {
    let arms = source
        .parts
        .arms
        .iter()
        .flatten()
        .zip(target.parts.arms.iter().flatten());
    let legs = source.parts.legs.iter().zip(&target.parts.legs);
    legs.chain(arms).map(|(from, to)| [from, to]).collect()
}

/// Mean angles between the upper bones of two limbs and between the lower ones, degrees. Legs of
/// bodies on four are compared by their turns from the neutral pose.
fn bones(figures: [&Figure; 2], worlds: &[WorldMotion; 2], limbs: [&Limb; 2]) -> [f32; 2] {
    // On two legs they hang in the neutral pose. Legs of four are bent there, and are seen by their
    // joints' places.
    let on_fours = figures[0].parts.on_fours;
    let directions = |which: usize, places: &[Vec3]| {
        let [upper, middle, end] = limbs[which].chain();
        [places[middle] - places[upper], places[end] - places[middle]].map(Vec3::normalize_or_zero)
    };
    let hanging = |which: usize, frame: usize| {
        let rotations = worlds[which].rotations_at(frame);
        [limbs[which].upper[0], limbs[which].lower[0]]
            .map(|joint| rotations[joint] * (figures[which].neutral[joint].conjugate() * Vec3::NEG_Y))
    };
    let neutral = [0, 1].map(|which| directions(which, &figures[which].places));
    let mut sums = [0.0; 2];
    let frames = worlds[0].frames();
    for frame in 0..frames {
        let now = [0, 1].map(|which| match on_fours {
            true => directions(which, worlds[which].positions_at(frame)),
            false => hanging(which, frame),
        });
        for (bone, sum) in sums.iter_mut().enumerate() {
            let wanted = match on_fours {
                true => Quat::from_rotation_arc(neutral[0][bone], now[0][bone]) * neutral[1][bone],
                false => now[0][bone],
            };
            *sum += wanted.angle_between(now[1][bone]).to_degrees();
        }
    }
    sums.map(|sum| sum / frames.max(1) as f32)
}

/// Speeds of standing feet.
#[derive(Default)]
struct Feet {
    sums: [f32; 2],
    count: usize,
    under_m: f32,
}

impl Feet {
    fn of(figures: [&Figure; 2], worlds: &[WorldMotion; 2], scale: f32, fps: f32) -> Self {
        let mut feet = Self::default();
        let [source, target] = figures;
        for [from, to] in limbs(source, target) {
            let points = [from.toe.zip(to.toe), Some((from.end, to.end))];
            for (a, b) in points.into_iter().flatten().filter(|_| from.toe.is_some()) {
                feet.add([a, b], figures, worlds, scale, fps);
            }
        }
        feet
    }

    /// Adds a point of a foot, in the source and in the target.
    fn add(
        &mut self,
        points: [usize; 2],
        figures: [&Figure; 2],
        worlds: &[WorldMotion; 2],
        scale: f32,
        fps: f32,
    ) {
        let at = |which: usize, frame: usize| worlds[which].positions_at(frame)[points[which]];
        let height = |which: usize, frame: usize| {
            let figure = figures[which];
            at(which, frame).y - figure.skeleton.ground_y_m - figure.places[points[which]].y
        };
        let leg_m = figures[0].leg_m;
        for frame in 0..worlds[0].frames() {
            let under = (-height(1, frame)) - (-height(0, frame) * scale).max(0.0);
            self.under_m = self.under_m.max(under);
            if frame == 0 {
                continue;
            }
            let speed = |which: usize| {
                let way: Vec3 = at(which, frame) - at(which, frame - 1);
                way.with_y(0.0).length() * fps
            };
            let stands = height(0, frame) <= STANDS_SHARE * leg_m && speed(0) <= STANDS_PER_S * leg_m;
            if stands {
                self.sums[0] += speed(0) * scale;
                self.sums[1] += speed(1);
                self.count += 1;
            }
        }
    }

    fn mean(&self, which: usize) -> f32 {
        self.sums[which] / self.count.max(1) as f32
    }
}

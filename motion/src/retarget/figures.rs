//! What a retargeted clip keeps of its source, in figures.

use glam::{Quat, Vec3};
use serde::Serialize;

use super::{Figure, feet};
use crate::anatomy::Limb;
use crate::clip::Clip;
use crate::fk::WorldMotion;

/// A foot stands while it is nearer to its height in the neutral pose than this share of the leg.
const STANDS_SHARE: f32 = 0.015;
/// Faster feet do not stand: leg lengths a second.
const STANDS_PER_S: f32 = 0.4;
/// Largest mean angle between bones that passes, and that of a single bone, degrees.
const MOST_DEG: [f32; 2] = [5.0, 15.0];
/// Largest mean angle between lines across the bodies that passes, degrees. Trunks of other builds
/// differ by 20°; limbs on the wrong side by 180°.
const MOST_LINE_DEG: f32 = 45.0;
/// Sine of the pitch from which a foot has no direction over the ground.
const STEEP: f32 = 0.8;
/// Standing feet may slide by this factor of the source's speed, and this much more, m/s.
const MOST_SKATE: (f32, f32) = (1.2, 0.02);
/// Feet may be this far under the ground, and short of their places, metres.
const MOST_M: f32 = 0.02;
/// Legs for which lengths and speeds are allowed as they stand, metres. For others they grow and
/// shrink with the legs.
const USUAL_LEGS_M: (f32, f32) = (0.5, 1.0);

/// What a retargeted clip keeps of its source. Lengths and speeds are in the target's size.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Mean angle between the bones of limbs in the source and in the target, degrees.
    pub directions_deg: f32,
    /// The largest mean of a single bone, degrees.
    pub worst_deg: f32,
    /// The largest mean angle between a line through the body in the source and in the target,
    /// degrees: from the right hip and shoulder to the left ones, up the trunk, and along the feet.
    pub lines_deg: f32,
    /// Mean speed of the target's feet over the ground while the source's stand, m/s.
    pub skate_mps: f32,
    /// The same of the source's feet, scaled.
    pub source_skate_mps: f32,
    /// Farthest that a foot is under the ground, deeper than in the source, metres.
    pub under_m: f32,
    /// Farthest that a foot remains from its place, metres.
    pub short_m: f32,
    /// Which joints these are.
    pub joints: WorstJoints,
    /// Length of the target's legs, metres.
    #[serde(skip)]
    pub leg_m: f32,
}

/// The joints of the target whose figures are worst, by name. Empty if no joint has the figure.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorstJoints {
    /// Of [`Figures::worst_deg`]: where the bone begins.
    pub bone: String,
    /// Of [`Figures::lines_deg`]: the left end of a line across the body, or its beginning.
    pub line: String,
    /// Of [`Figures::skate_mps`]: the point of a foot that slides most beyond the source's.
    pub skate: String,
    /// Of [`Figures::under_m`].
    pub under: String,
    /// Of [`Figures::short_m`].
    pub short: String,
}

impl Figures {
    /// The figures of a clip and what a retargeter made of it. `short` is the farthest that a limb
    /// of the target remained from its place, metres, and its last joint.
    pub fn of(figures: [&Figure; 2], clips: [&Clip; 2], short: (f32, Option<usize>)) -> Self {
        let [source, target] = figures;
        let scale = target.leg_m / source.leg_m;
        let worlds = clips.map(WorldMotion::from_clip);
        let pairs = limbs(source, target);
        let starts = pairs.iter().flat_map(|[_, to]| [to.upper[0], to.lower[0]]);
        let angles = pairs.iter().flat_map(|&limbs| bones(figures, &worlds, limbs));
        let angles: Vec<(f32, usize)> = angles.zip(starts).collect();
        let bone = worst(angles.iter().copied(), 0.0);
        let line = worst(lines(figures, &worlds), MOST_LINE_DEG);
        let feet = Feet::of(figures, &worlds, scale, clips[0].fps);
        let name = |joint: Option<usize>| joint.map_or("", |joint| &*target.skeleton.joints[joint].name);
        let sum: f32 = angles.iter().map(|angle| angle.0).sum();
        Self {
            directions_deg: sum / angles.len().max(1) as f32,
            worst_deg: bone.0,
            lines_deg: line.0,
            skate_mps: feet.mean(1),
            source_skate_mps: feet.mean(0),
            under_m: feet.under.0,
            short_m: short.0,
            joints: WorstJoints {
                bone: name(bone.1).to_owned(),
                line: name(line.1).to_owned(),
                skate: name(feet.fastest.1).to_owned(),
                under: name(feet.under.1).to_owned(),
                short: name(short.1).to_owned(),
            },
            leg_m: target.leg_m,
        }
    }

    /// The figures of a motion that could not be carried over at all.
    pub(super) fn nothing_kept() -> Self {
        Self {
            directions_deg: 180.0,
            ..Self::default()
        }
    }

    /// Each figure with what it is, for people.
    pub fn rows(&self) -> [(&'static str, String); 6] {
        [
            (
                "angle between bones of limbs, mean (of the worst bone)",
                format!("{:.1}° ({:.1}°)", self.directions_deg, self.worst_deg),
            ),
            (
                "angle between lines across the body, of the worst line",
                format!("{:.1}°", self.lines_deg),
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

    /// What is beyond the bar: each as a sentence with the joint. Empty if all is well.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let mut most = |what: &str, joint: &str, value: f32, most: f32, unit: &str| {
            if value > most || value.is_nan() {
                let at = match joint {
                    "" => String::new(),
                    joint => format!(" at {joint}"),
                };
                faults.push(format!(
                    "{what}{at} is {value:.3}{unit}; allowed: {most:.3}{unit}"
                ));
            }
        };
        let joints = &self.joints;
        let [mean, single] = MOST_DEG;
        most("the mean difference of bones", "", self.directions_deg, mean, "°");
        most(
            "the largest difference of a bone",
            &joints.bone,
            self.worst_deg,
            single,
            "°",
        );
        most(
            "the difference of a line across the body",
            &joints.line,
            self.lines_deg,
            MOST_LINE_DEG,
            "°",
        );
        let size = self.leg_m / self.leg_m.clamp(USUAL_LEGS_M.0, USUAL_LEGS_M.1);
        let skate = self.source_skate_mps * MOST_SKATE.0 + size * MOST_SKATE.1;
        most(
            "sliding of standing feet",
            &joints.skate,
            self.skate_mps,
            skate,
            " m/s",
        );
        most(
            "depth of feet under the ground",
            &joints.under,
            self.under_m,
            size * MOST_M,
            " m",
        );
        most(
            "distance of feet from their places",
            &joints.short,
            self.short_m,
            size * MOST_M,
            " m",
        );
        faults
    }
}

/// The largest of some values, and the joint of the first that is less than `alike` below it.
fn worst(of: impl IntoIterator<Item = (f32, usize)>, alike: f32) -> (f32, Option<usize>) {
    let mut worst = (0.0_f32, None);
    let mut named = f32::NEG_INFINITY;
    for (value, joint) in of {
        worst.0 = worst.0.max(value);
        if value > named + alike {
            (worst.1, named) = (Some(joint), value);
        }
    }
    worst
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

/// Mean angles between lines through both bodies, degrees, with a joint of the target. They show
/// limbs on the wrong side, which no angle between bones does.
fn lines(figures: [&Figure; 2], worlds: &[WorldMotion; 2]) -> Vec<(f32, usize)> {
    let parts = figures.map(|figure| &figure.parts);
    let across = |places: &[Vec3], [left, right]: [usize; 2]| places[left] - places[right];
    let middle = |places: &[Vec3], [left, right]: [usize; 2]| 0.5 * (places[left] + places[right]);
    let hips = figures.map(Figure::hips);
    let shoulders = [0, 1].map(|which: usize| {
        let arms = parts[which].arms.as_ref();
        arms.map(|arms| [arms[0].top, arms[1].top])
    });
    let toes = |side: usize| [0, 1].map(|which: usize| parts[which].legs[side].toe);
    let mut angles = Vec::new();
    let mut add = |joint: usize, line: &dyn Fn(usize, &[Vec3]) -> Vec3| {
        let frames = worlds[0].frames();
        let angle = |frame: usize| {
            let [a, b] = [0, 1].map(|which| line(which, worlds[which].positions_at(frame)));
            // Lines without length have no direction.
            let (a, b) = (a.try_normalize()?, b.try_normalize()?);
            Some(a.angle_between(b).to_degrees())
        };
        let (mut sum, mut count) = (0.0, 0);
        for angle in (0..frames).filter_map(angle) {
            sum += angle;
            count += 1;
        }
        angles.push((sum / count.max(1) as f32, joint));
    };
    // Feet come first: if they point backwards, so do the shoulders, because the hips' sides say
    // what is ahead.
    if !parts[0].on_fours {
        for side in [0, 1] {
            if let [Some(_), Some(_)] = toes(side) {
                let leg = |which: usize| &parts[which].legs[side];
                // A foot that hangs down points nowhere.
                let foot = |which: usize, places: &[Vec3]| {
                    let toe = leg(which).toe.unwrap_or(leg(which).end);
                    let foot = (places[toe] - places[leg(which).end]).normalize_or_zero();
                    match foot.y.abs() < STEEP {
                        true => foot.with_y(0.0),
                        false => Vec3::ZERO,
                    }
                };
                add(leg(1).end, &foot);
            }
        }
    }
    add(hips[1][0], &|which, places| across(places, hips[which]));
    if let [Some(from), Some(to)] = shoulders {
        let shoulders = [from, to];
        add(to[0], &|which, places| across(places, shoulders[which]));
        add(parts[1].trunk[0], &|which, places| {
            middle(places, shoulders[which]) - middle(places, hips[which])
        });
    }
    angles
}

/// Speeds of standing feet.
#[derive(Default)]
struct Feet {
    sums: [f32; 2],
    count: usize,
    /// Farthest under the ground, metres, and the joint.
    under: (f32, Option<usize>),
    /// The largest sum of a point's speeds beyond the source's, m/s, and the joint.
    fastest: (f32, Option<usize>),
}

impl Feet {
    fn of(figures: [&Figure; 2], worlds: &[WorldMotion; 2], scale: f32, fps: f32) -> Self {
        let mut feet = Self::default();
        let [source, target] = figures;
        // Arms have no feet.
        let count = if source.parts.on_fours { 4 } else { 2 };
        for [from, to] in limbs(source, target).into_iter().take(count) {
            let points = [from.toe.zip(to.toe), Some((from.end, to.end))];
            for (a, b) in points.into_iter().flatten() {
                feet.add([a, b], figures, worlds, scale, fps);
            }
            feet.see_points([from, to], figures, worlds, scale);
        }
        feet
    }

    /// Sees how deep the points of a foot beyond ankle and toes are under the ground.
    fn see_points(
        &mut self,
        [from, to]: [&Limb; 2],
        [source, target]: [&Figure; 2],
        worlds: &[WorldMotion; 2],
        scale: f32,
    ) {
        let points = feet::points(target, to);
        let known = [Some(from.end), from.toe].into_iter().flatten();
        let known: Vec<(usize, Vec3)> = known.map(|joint| (joint, Vec3::ZERO)).collect();
        let depth = |figure: &Figure, world: &WorldMotion, frame: usize, (joint, way): (usize, Vec3)| {
            let still = figure.places[joint].y + (figure.neutral[joint] * way).y;
            let turned = world.rotations_at(frame)[joint] * way;
            let now = world.positions_at(frame)[joint].y + turned.y;
            still - (now - figure.skeleton.ground_y_m)
        };
        for frame in 0..worlds[0].frames() {
            let of_source = known.iter().map(|&point| depth(source, &worlds[0], frame, point));
            let allowed = of_source.fold(0.0, f32::max) * scale;
            for &point in &points {
                let under = depth(target, &worlds[1], frame, point) - allowed;
                if under > self.under.0 {
                    self.under = (under, Some(point.0));
                }
            }
        }
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
        let mut beyond = 0.0;
        for frame in 0..worlds[0].frames() {
            let under = (-height(1, frame)) - (-height(0, frame) * scale).max(0.0);
            if under > self.under.0 {
                self.under = (under, Some(points[1]));
            }
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
                beyond += speed(1) - speed(0) * scale;
            }
        }
        if beyond > self.fastest.0 {
            self.fastest = (beyond, Some(points[1]));
        }
    }

    fn mean(&self, which: usize) -> f32 {
        self.sums[which] / self.count.max(1) as f32
    }
}

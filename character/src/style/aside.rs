//! Builds gaits aside and backwards for a style that has none.
//!
//! In clips, people who walk "to the left" turn their hips that way: in the default pack's data,
//! travel is 8 to 46° off the hips. A character that must face ahead and move straight to the side
//! therefore needs a built gait. It takes the body of the style's walk, with less swing, over legs
//! that open and close. The foot on the side of travel steps out and the other follows; they never
//! pass each other. Legs are bent to their feet, and the hips are as low as the wider of the two
//! legs needs.

use std::f32::consts::{PI, TAU};

use troupe_motion::fk::world_transforms;
use troupe_motion::ik::{Leg, legs, place_end};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::{align_sign, yaw};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::{Gait, MAX_GAITS, Style, StyleKey};

/// Names of the gaits and their directions, degrees to the left of ahead.
const WAYS: [(&str, f32); 5] = [
    ("step-left", 90.0),
    ("step-right", -90.0),
    ("step-back-left", 135.0),
    ("step-back-right", -135.0),
    ("step-back", 180.0),
];
/// Keys of a cycle.
const KEYS: usize = 24;
/// A gait is not built if the style has one within this angle, radians, that reaches at least this
/// share of the built one's speed.
const NEAR: f32 = 0.4;
const SLOWER: f32 = 0.86;
/// A gait farther from ahead than this, radians, takes its upper body from a walk backwards, if the
/// style has one.
const BACKWARDS: f32 = 1.8;
/// A gait goes straight ahead if its travel is within the first value of its hips, radians, and it
/// turns by less than the second, rad/s.
const STRAIGHT_AHEAD: (f32, f32) = (0.3, 0.3);
/// Speed relative to the walk, and highest speed, m/s: legs that do not pass each other cannot be
/// faster.
const SPEED: (f32, f32) = (0.9, 1.25);
/// Travel of a foot in a cycle: metres at speed 0, and more metres for each m/s.
const STRIDE: (f32, f32) = (0.42, 0.33);
/// Share of a cycle for which a foot stands.
const STANDING: f32 = 0.5;
/// Least distance between the two ankles, metres.
const CLOSED_M: f32 = 0.16;
/// Height to which a foot is lifted, metres.
const LIFT_M: f32 = 0.07;
/// Greatest length of a leg, as a share of its straight length.
const STRAIGHT: f32 = 0.985;
/// Largest vertical movement of the hips from their mean, metres.
const BOB_M: f32 = 0.02;
/// Share of the walk's swing that the upper body keeps.
const SWING: f32 = 0.4;
/// Frame rate of the gaits of styles, Hz.
const FPS: f32 = 30.0;

/// The gaits aside that a style lacks. Empty if it has them, does not walk, or its skeleton does
/// not have two legs with knees.
pub(super) fn build(style: &Style, skeleton: &Skeleton) -> Vec<Gait> {
    let legs = legs(skeleton);
    let goes = |gait: &&Gait, way: f32| {
        !gait.stands() && wrap_angle(gait.left_mps.atan2(gait.forward_mps) - way).abs() < NEAR
    };
    let fits = style.words.is_none() && !style.is_static;
    let (Some(walk), [one, other]) = (walk(style), &legs[..]) else {
        return Vec::new();
    };
    if !fits || skeleton.robot.is_some() {
        return Vec::new();
    }
    let back = style.gaits.iter().find(|gait| goes(gait, PI));
    let body = |gait| SideSteps::new(skeleton, [one, other], style.idle(), gait);
    let (Some(ahead), Some(back)) = (body(walk), body(back.unwrap_or(walk))) else {
        return Vec::new();
    };
    let ways = WAYS
        .into_iter()
        .map(|(name, degrees)| (name, degrees.to_radians()));
    let suffices = |gait: &Gait, way: f32| goes(&gait, way) && gait.speed_mps() > SLOWER * speed_mps(walk);
    ways.filter(|&(name, way)| {
        style
            .gaits
            .iter()
            .all(|gait| !suffices(gait, way) && gait.name != name)
    })
    .map(|(name, way)| match way.abs() > BACKWARDS {
        true => back.gait(name, way, speed_mps(walk)),
        false => ahead.gait(name, way, speed_mps(walk)),
    })
    .take(MAX_GAITS.saturating_sub(style.gaits.len()))
    .collect()
}

/// The style's walk: the gait of this name, otherwise the slowest that goes straight ahead.
fn walk(style: &Style) -> Option<&Gait> {
    let ahead = |gait: &&Gait| {
        let off = gait.left_mps.atan2(gait.forward_mps).abs();
        !gait.stands() && off < STRAIGHT_AHEAD.0 && gait.turn_rps.abs() < STRAIGHT_AHEAD.1
    };
    let slowest = || {
        style
            .gaits
            .iter()
            .filter(ahead)
            .min_by(|a, b| a.speed_mps().total_cmp(&b.speed_mps()))
    };
    style.gait("walk").filter(ahead).or_else(slowest)
}

/// Speed of the gaits that are built for a style with this walk, m/s.
fn speed_mps(walk: &Gait) -> f32 {
    (walk.speed_mps() * SPEED.0).min(SPEED.1)
}

/// A body that steps aside: what is needed of its walk and its stand.
struct SideSteps<'a> {
    skeleton: &'a Skeleton,
    /// The left leg and the right one.
    legs: [&'a Leg; 2],
    /// The pose that the legs stand in, joint 0 facing +Z.
    stand: Vec<Quat>,
    /// Place and rotation of each foot in that pose, relative to the root on the ground.
    feet: [(Vec3, Quat); 2],
    walk: &'a Gait,
    /// The walk's keys with joint 0 facing +Z, and their mean.
    keys: Vec<Vec<Quat>>,
    mean: Vec<Quat>,
}

impl<'a> SideSteps<'a> {
    /// `None` if both legs are on one side of the body.
    fn new(skeleton: &'a Skeleton, legs: [&'a Leg; 2], stand: &StyleKey, walk: &'a Gait) -> Option<Self> {
        let ahead = |rotations: &[Quat]| {
            let mut rotations = rotations.to_vec();
            rotations[0] = yaw(-heading_of(rotations[0], skeleton.left_axis)) * rotations[0];
            rotations
        };
        let standing = ahead(&stand.rotations);
        let (positions, turns) = places(skeleton, stand.height_m, &standing);
        let [first, second] = legs;
        let legs = match positions[first.upper].x > positions[second.upper].x {
            true => [first, second],
            false => [second, first],
        };
        let [left, right] = legs.map(|leg| positions[leg.upper].x);
        let keys: Vec<Vec<Quat>> = walk.keys.iter().map(|key| ahead(&key.rotations)).collect();
        let mean = (0..skeleton.joint_count())
            .map(|joint| {
                let first = keys[0][joint];
                let sum = keys.iter().fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, key| {
                    sum + align_sign(key[joint], first)
                });
                sum.normalize()
            })
            .collect();
        (left > 0.0 && right < 0.0).then(|| Self {
            skeleton,
            legs,
            feet: legs.map(|leg| (positions[leg.foot], turns[leg.foot])),
            stand: standing,
            walk,
            keys,
            mean,
        })
    }

    /// The gait in direction `way`, radians to the left of ahead, at a speed in m/s.
    fn gait(&self, name: &str, way: f32, speed: f32) -> Gait {
        let stride = STRIDE.0 + STRIDE.1 * speed;
        let phases = (0..KEYS).map(|key| key as f32 / KEYS as f32);
        let heights = self.heights(way, stride);
        let velocity = yaw(way) * Vec3::Z * speed;
        let keys = phases
            .zip(heights)
            .map(|(phase, height_m)| StyleKey {
                rotations: self.pose(phase, way, stride, height_m),
                height_m,
                left_mps: velocity.x,
                forward_mps: velocity.z,
                turn_rps: 0.0,
            })
            .collect();
        Gait {
            name: name.to_owned(),
            left_mps: velocity.x,
            forward_mps: velocity.z,
            turn_rps: 0.0,
            period_frames: stride / speed * FPS,
            keys,
            built: true,
        }
    }

    /// Places of the ankles at a phase, left and right, relative to the root on the ground.
    fn ankles(&self, phase: f32, way: f32, stride: f32) -> [Vec3; 2] {
        let apart = CLOSED_M + 0.5 * stride * way.sin().abs();
        let side = if way < 0.0 { -1.0 } else { 1.0 };
        let middle = 0.5 * (self.feet[0].0.z + self.feet[1].0.z);
        [1.0, -1.0].map(|which: f32| {
            // The foot on the side of travel comes down at phase 0, the other half a cycle later.
            let leads = which == side;
            let (along, lift) = step(if leads { phase } else { phase - 0.5 }, stride);
            let (stand, _) = self.feet[usize::from(which < 0.0)];
            Vec3::new(which * 0.5 * apart, stand.y + lift, middle) + yaw(way) * Vec3::Z * along
        })
    }

    /// The pose above the legs at a phase.
    fn upper(&self, phase: f32) -> Vec<Quat> {
        let place = phase * self.keys.len() as f32;
        let from = place as usize % self.keys.len();
        let to = (from + 1) % self.keys.len();
        let joints = self.mean.iter().enumerate();
        joints
            .map(|(joint, mean)| {
                let swung = self.keys[from][joint].slerp(
                    align_sign(self.keys[to][joint], self.keys[from][joint]),
                    place.fract(),
                );
                mean.slerp(align_sign(swung, *mean), SWING)
            })
            .collect()
    }

    fn pose(&self, phase: f32, way: f32, stride: f32, height_m: f32) -> Vec<Quat> {
        let mut pose = self.upper(phase);
        let root = Vec3::Y * height_m;
        let ankles = self.ankles(phase, way, stride);
        for ((leg, ankle), (_, turn)) in self.legs.into_iter().zip(ankles).zip(self.feet) {
            let below = [Some(leg.upper), Some(leg.lower), Some(leg.foot), leg.toe];
            for joint in below.into_iter().flatten() {
                pose[joint] = self.stand[joint];
            }
            place_end(
                self.skeleton,
                root,
                &mut pose,
                leg.chain(),
                (ankle, 0.0),
                Vec3::Z,
                turn,
            );
        }
        pose
    }

    /// Heights of the root in a cycle: the walk's if the legs reach the ground, otherwise as low as
    /// they need, up and down twice a cycle.
    fn heights(&self, way: f32, stride: f32) -> Vec<f32> {
        let most: Vec<f32> = (0..KEYS)
            .map(|key| self.reach_m(key as f32 / KEYS as f32, way, stride))
            .collect();
        let (mut mean, mut cosine, mut sine) = (0.0, 0.0, 0.0);
        for (key, most) in most.iter().enumerate() {
            let (sin, cos) = (2.0 * TAU * key as f32 / KEYS as f32).sin_cos();
            mean += most / KEYS as f32;
            cosine += 2.0 * most * cos / KEYS as f32;
            sine += 2.0 * most * sin / KEYS as f32;
        }
        let shrink = (BOB_M / cosine.hypot(sine).max(BOB_M)).min(1.0);
        let wave = |key: usize| {
            let (sin, cos) = (2.0 * TAU * key as f32 / KEYS as f32).sin_cos();
            mean + shrink * (cosine * cos + sine * sin)
        };
        let over = (0..KEYS).map(|key| wave(key) - most[key]).fold(0.0, f32::max);
        (0..KEYS).map(|key| wave(key) - over).collect()
    }

    /// Highest root at a phase from which the legs reach their feet, metres.
    fn reach_m(&self, phase: f32, way: f32, stride: f32) -> f32 {
        let (hips, _) = places(self.skeleton, 0.0, &self.upper(phase));
        let ankles = self.ankles(phase, way, stride);
        let each = self.legs.into_iter().zip(ankles).map(|(leg, ankle)| {
            let hip = hips[leg.upper];
            let length = STRAIGHT * leg.length_m(self.skeleton);
            let aside = (ankle - hip).with_y(0.0).length();
            ankle.y - hip.y + (length * length - aside * aside).max(0.0).sqrt()
        });
        each.fold(self.walk.height_m(), f32::min)
    }
}

/// Place of a foot along the direction of travel, relative to the root, and its height over its
/// stand, metres. It comes down at phase 0.
fn step(phase: f32, stride: f32) -> (f32, f32) {
    let phase = phase.rem_euclid(1.0);
    let half = 0.5 * STANDING * stride;
    if phase < STANDING {
        return (half - stride * phase, 0.0);
    }
    let swung = (phase - STANDING) / (1.0 - STANDING);
    let gone = swing(swung);
    let lift = (PI * swung).sin();
    (
        -half + stride * gone - stride * (phase - STANDING),
        LIFT_M * lift * lift,
    )
}

/// Travel of a foot in a share of its swing, 0 to 1, by modified trapezoidal acceleration. Of the
/// smooth cam profiles this one accelerates least: 4.9 times the travel over the time squared.
fn swing(share: f32) -> f32 {
    if share > 0.5 {
        return 1.0 - swing(1.0 - share);
    }
    const MOST: f32 = 8.0 * PI / (2.0 + PI);
    let turned = 4.0 * PI;
    let (rise, hold) = (0.125, 0.375);
    let risen = MOST / turned;
    let (at_rise, at_hold) = (risen * (rise - 1.0 / turned), risen + MOST * 0.25);
    if share < rise {
        risen * (share - (turned * share).sin() / turned)
    } else if share < hold {
        let since = share - rise;
        at_rise + risen * since + 0.5 * MOST * since * since
    } else {
        let since = share - hold;
        let held = at_rise + 0.25 * risen + 0.5 * MOST * 0.0625;
        held + at_hold * since + MOST * (1.0 - (turned * since).cos()) / (turned * turned)
    }
}

/// Places and rotations of all joints in a pose with its root at a height.
fn places(skeleton: &Skeleton, height_m: f32, pose: &[Quat]) -> (Vec<Vec3>, Vec<Quat>) {
    let mut positions = vec![Vec3::ZERO; pose.len()];
    let mut rotations = vec![Quat::IDENTITY; pose.len()];
    world_transforms(skeleton, Vec3::Y * height_m, pose, &mut positions, &mut rotations);
    (positions, rotations)
}

#[cfg(test)]
#[path = "aside_tests.rs"]
mod tests;

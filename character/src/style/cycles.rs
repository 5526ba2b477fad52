//! What planning needs of a style's gaits beyond their values, worked out once for each style.
//!
//! **Common phase.** Gaits are blended at one phase, so phase 0 must be the same moment of a step
//! in all of them. It is the moment at which the left foot is foremost in the direction of travel,
//! by the first harmonic of the distance between the feet.
//!
//! **Sway.** The pelvis turns with every step. A key's pose is stored without its own heading, and
//! that heading beside it. The heading is what joint 0 of the key still turns by. If all keys face
//! +Z, it is the sum of the keys' turning over the cycle.
//!
//! **Matching.** Joint positions relative to the projected root, facing +Z, and their velocities,
//! at equal steps of the common phase. With them the nearest moment of the gait is found.

use std::f32::consts::TAU;

use troupe_motion::fk::world_transforms;
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::{slerp, yaw};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::{Gait, Style, StyleKey};

/// Steps of a cycle at which it is compared with a pose.
pub(crate) const MATCH_STEPS: usize = 32;
/// Seconds of a joint's velocity that count as much as a metre of its position.
pub(crate) const MATCH_VELOCITY_S: f32 = 0.1;
/// Weight of feet and shins relative to other joints.
const LEG_WEIGHT: f32 = 3.0;
/// Joints nearer to each other than this count as one, metres.
const LEAST_BONE_M: f32 = 0.04;
/// Frame rate of the gaits of styles, Hz.
const FPS: f32 = 30.0;
/// If the headings of a gait's keys differ by less than this, they were taken out before, radians.
const SWAY_IN_KEYS: f32 = 0.005;
/// Largest sway of the pelvis to either side, radians.
const MAX_SWAY: f32 = 0.6;
/// Feet pass each other while they are this near to each other along the direction of travel,
/// metres.
const PASSING_M: f32 = 0.25;
/// A step in which the feet move apart by less than this has no phase, metres.
const MIN_STEP_M: f32 = 0.01;

/// Cycles of all gaits of a style.
#[derive(Debug)]
pub(crate) struct Cycles {
    /// One for each gait, in the style's order.
    pub(crate) gaits: Vec<Cycle>,
    /// Weight of each joint in matching.
    pub(crate) joint_weights: Vec<f32>,
    /// How the feet are lifted for steps on the spot. `None` if no gait goes forwards, or the
    /// skeleton has no feet.
    pub(crate) steps: Option<Steps>,
}

/// Where a walk lifts its passing feet highest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Steps {
    /// Index of the walk among the style's gaits.
    pub(crate) gait: usize,
    /// Common phases with the left and the right foot highest, cycles.
    pub(crate) left_right: [f32; 2],
}

/// One gait as planning sees it.
#[derive(Debug)]
pub(crate) struct Cycle {
    /// Share of the gait's own cycle at common phase 0.
    offset: f32,
    /// Joint 0 of each key without its own heading.
    pelvis: Vec<Quat>,
    /// Heading of each key, radians.
    sway: Vec<f32>,
    /// `MATCH_STEPS * joints`: positions, metres.
    pub(crate) positions: Vec<Vec3>,
    /// `MATCH_STEPS * joints`: velocities, m/s.
    pub(crate) velocities: Vec<Vec3>,
}

/// A gait at a phase, without its rotations.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Moment {
    /// Heading of the pelvis, radians.
    pub(crate) sway: f32,
    /// Height of the root joint, metres.
    pub(crate) height_m: f32,
    /// Velocity to the left beyond the gait's mean, m/s.
    pub(crate) left_mps: f32,
    /// Velocity forward beyond the gait's mean, m/s.
    pub(crate) forward_mps: f32,
    /// Turning rate beyond the gait's mean, rad/s.
    pub(crate) turn_rps: f32,
}

impl Moment {
    /// Adds `other` with the weight `weight`.
    pub(crate) fn add(&mut self, other: &Self, weight: f32) {
        self.sway += weight * other.sway;
        self.height_m += weight * other.height_m;
        self.left_mps += weight * other.left_mps;
        self.forward_mps += weight * other.forward_mps;
        self.turn_rps += weight * other.turn_rps;
    }
}

impl Cycles {
    /// Works out every gait of `style`, whose poses belong to `skeleton`.
    pub(crate) fn new(style: &Style, skeleton: &Skeleton) -> Self {
        let mut joint_weights = vec![1.0; skeleton.joint_count()];
        for &joint in skeleton.contacts.iter().flat_map(|contacts| &contacts.joints) {
            joint_weights[joint] = LEG_WEIGHT;
            // The bone above it. A robot may have several joints at one place.
            let mut at = joint;
            while let Some(parent) = skeleton.joints[at].parent {
                joint_weights[parent] = LEG_WEIGHT;
                if skeleton.joints[at].offset_m.length() >= LEAST_BONE_M {
                    break;
                }
                at = parent;
            }
        }
        let gaits: Vec<Cycle> = style
            .gaits
            .iter()
            .map(|gait| Cycle::new(gait, skeleton))
            .collect();
        Self {
            steps: find_steps(style, &gaits, skeleton),
            gaits,
            joint_weights,
        }
    }
}

/// Phases of the slowest forward gait with the highest feet.
fn find_steps(style: &Style, cycles: &[Cycle], skeleton: &Skeleton) -> Option<Steps> {
    let forward = |gait: &Gait| gait.forward_mps > 2.0 * gait.left_mps.abs() && !gait.stands();
    let (gait, _) = style
        .gaits
        .iter()
        .enumerate()
        .filter(|(_, gait)| forward(gait))
        .min_by(|(_, a), (_, b)| a.speed_mps().total_cmp(&b.speed_mps()))?;
    let cycle = &cycles[gait];
    let joints = skeleton.joint_count();
    let feet = |step: usize| mean_feet(&cycle.positions[step * joints..(step + 1) * joints], skeleton);
    let highest = |side: f32| {
        let lift = |step: usize| {
            let [left, right] = feet(step)?;
            let passing = (left.z - right.z).abs() < PASSING_M;
            passing.then_some((step, side * (left.y - right.y)))
        };
        let steps = (0..MATCH_STEPS).filter_map(lift);
        let (step, _) = steps.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        Some(step as f32 / MATCH_STEPS as f32)
    };
    Some(Steps {
        gait,
        left_right: [highest(1.0)?, highest(-1.0)?],
    })
}

/// Mean positions of the left and the right contact joints.
fn mean_feet(positions: &[Vec3], skeleton: &Skeleton) -> Option<[Vec3; 2]> {
    let mut sums = [(Vec3::ZERO, 0); 2];
    for &joint in &skeleton.contacts.as_ref()?.joints {
        let side = usize::from(positions[joint].x < 0.0);
        sums[side].0 += positions[joint];
        sums[side].1 += 1;
    }
    let [(left, lefts), (right, rights)] = sums;
    (lefts > 0 && rights > 0).then(|| [left / lefts as f32, right / rights as f32])
}

impl Cycle {
    fn new(gait: &Gait, skeleton: &Skeleton) -> Self {
        let headings: Vec<f32> = gait
            .keys
            .iter()
            .map(|key| heading_of(key.rotations[0], skeleton.left_axis))
            .collect();
        let pelvis: Vec<Quat> = gait
            .keys
            .iter()
            .zip(&headings)
            .map(|(key, heading)| yaw(-heading) * key.rotations[0])
            .collect();
        let positions: Vec<Vec3> = gait
            .keys
            .iter()
            .zip(&pelvis)
            .flat_map(|(key, &pelvis)| key_positions(key, pelvis, skeleton))
            .collect();
        let mut cycle = Self {
            offset: foremost_phase(gait, &positions, skeleton).unwrap_or(0.0),
            sway: sway(gait, &headings),
            pelvis,
            positions: Vec::new(),
            velocities: Vec::new(),
        };
        cycle.fill_matching(gait, &positions, skeleton.joint_count());
        cycle
    }

    /// Resamples the keys' positions at equal steps of the common phase.
    fn fill_matching(&mut self, gait: &Gait, keys: &[Vec3], joints: usize) {
        let at = |phase: f32, joint: usize| {
            let (a, b, t) = self.between(phase);
            keys[a * joints + joint].lerp(keys[b * joints + joint], t)
        };
        let frame = if gait.period_frames > 0.0 {
            1.0 / gait.period_frames
        } else {
            0.0
        };
        let steps = (0..MATCH_STEPS).flat_map(|step| (0..joints).map(move |joint| (step, joint)));
        let (positions, velocities) = steps
            .map(|(step, joint)| {
                let phase = step as f32 / MATCH_STEPS as f32;
                let now = at(phase, joint);
                (now, (now - at(phase - frame, joint)) * FPS)
            })
            .unzip();
        (self.positions, self.velocities) = (positions, velocities);
    }

    /// The keys on either side of a common phase (in cycles, wrapped), and the weight of the
    /// second.
    fn between(&self, phase: f32) -> (usize, usize, f32) {
        let keys = self.pelvis.len();
        let place = (phase + self.offset).rem_euclid(1.0) * keys as f32;
        let first = (place as usize).min(keys - 1);
        (first, (first + 1) % keys, (place - first as f32).clamp(0.0, 1.0))
    }

    /// The common phase at which the gait is at its key `key`.
    pub(crate) fn phase_of_key(&self, key: usize) -> f32 {
        key as f32 / self.pelvis.len() as f32 - self.offset
    }

    /// Samples `gait`, whose cycle this is, at a common phase. Calls `joint` with every joint's
    /// rotation, joint 0 facing +Z.
    pub(crate) fn sample(&self, gait: &Gait, phase: f32, mut joint: impl FnMut(usize, Quat)) -> Moment {
        let (a, b, t) = self.between(phase);
        let (from, to) = (&gait.keys[a], &gait.keys[b]);
        joint(0, slerp(self.pelvis[a], self.pelvis[b], t));
        let others = from.rotations.iter().zip(&to.rotations).enumerate().skip(1);
        for (index, (&from, &to)) in others {
            joint(index, slerp(from, to, t));
        }
        self.moment_between(gait, (a, b, t))
    }

    /// The gait at a common phase, without its rotations.
    pub(crate) fn moment(&self, gait: &Gait, phase: f32) -> Moment {
        self.moment_between(gait, self.between(phase))
    }

    fn moment_between(&self, gait: &Gait, (a, b, t): (usize, usize, f32)) -> Moment {
        let (from, to) = (&gait.keys[a], &gait.keys[b]);
        let mix = |from: f32, to: f32| from + (to - from) * t;
        Moment {
            sway: mix(self.sway[a], self.sway[b]),
            height_m: mix(from.height_m, to.height_m),
            left_mps: mix(from.left_mps, to.left_mps) - gait.left_mps,
            forward_mps: mix(from.forward_mps, to.forward_mps) - gait.forward_mps,
            turn_rps: mix(from.turn_rps, to.turn_rps) - gait.turn_rps,
        }
    }
}

/// Joint positions of a key that faces +Z, relative to the projected root.
fn key_positions(key: &StyleKey, pelvis: Quat, skeleton: &Skeleton) -> Vec<Vec3> {
    let mut local = key.rotations.clone();
    local[0] = pelvis;
    let mut positions = vec![Vec3::ZERO; local.len()];
    let mut rotations = vec![Quat::IDENTITY; local.len()];
    let root = Vec3::new(0.0, key.height_m, 0.0);
    world_transforms(skeleton, root, &local, &mut positions, &mut rotations);
    positions
}

/// Heading of each key apart from the gait's own turning; the mean is 0.
fn sway(gait: &Gait, headings: &[f32]) -> Vec<f32> {
    let keys = headings.len();
    let off = |heading: f32| wrap_angle(heading - headings[0]);
    let mut sway: Vec<f32> = if headings.iter().any(|&heading| off(heading).abs() > SWAY_IN_KEYS) {
        headings.iter().map(|&heading| off(heading)).collect()
    } else {
        let mean = gait.keys.iter().map(|key| key.turn_rps).sum::<f32>() / keys as f32;
        let step_s = gait.period_frames / keys as f32 / FPS;
        let mut before = 0.0;
        let mut sum = 0.0;
        let mut integral = Vec::with_capacity(keys);
        for (index, key) in gait.keys.iter().enumerate() {
            let turn = key.turn_rps - mean;
            if index > 0 {
                sum += 0.5 * (before + turn) * step_s;
            }
            before = turn;
            integral.push(sum);
        }
        integral
    };
    let mean = sway.iter().sum::<f32>() / keys as f32;
    for value in &mut sway {
        *value = (*value - mean).clamp(-MAX_SWAY, MAX_SWAY);
    }
    sway
}

/// Share of the gait's cycle at which the left foot is foremost in the direction of travel. `None`
/// for a gait that does not travel, or hardly steps.
fn foremost_phase(gait: &Gait, positions: &[Vec3], skeleton: &Skeleton) -> Option<f32> {
    let direction = Vec3::new(gait.left_mps, 0.0, gait.forward_mps).try_normalize()?;
    let contacts = &skeleton.contacts.as_ref()?.joints;
    let (joints, keys) = (skeleton.joint_count(), gait.keys.len());
    // Left feet are on the left on average over the whole cycle.
    let side = |joint: usize| -> f32 {
        let x: f32 = (0..keys).map(|key| positions[key * joints + joint].x).sum();
        x.signum()
    };
    let (mut cosine, mut sine) = (0.0, 0.0);
    for &joint in contacts {
        let side = side(joint);
        for key in 0..keys {
            let reach = side * positions[key * joints + joint].dot(direction);
            let (sin, cos) = (TAU * key as f32 / keys as f32).sin_cos();
            cosine += reach * cos;
            sine += reach * sin;
        }
    }
    // Each foot swings by `amplitude`, and both count.
    let amplitude = 2.0 * cosine.hypot(sine) / (keys * contacts.len().max(1)) as f32;
    (amplitude > MIN_STEP_M).then(|| (sine.atan2(cosine) / TAU).rem_euclid(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::testing::{walker, walker_style};
    use proptest::prelude::*;
    use troupe_motion::rotation::angle_between;

    fn cycle<'a>(style: &'a Style, name: &str) -> (&'a Gait, &'a Cycle) {
        let index = style.gaits.iter().position(|gait| gait.name == name).unwrap();
        (&style.gaits[index], &style.cycles(&walker()).gaits[index])
    }

    #[test]
    fn phases_of_all_gaits_start_with_the_left_foot_foremost() {
        let style = walker_style();
        for name in ["walk", "run", "walk-back", "walk-left"] {
            let (gait, cycle) = cycle(&style, name);
            let direction = Vec3::new(gait.left_mps, 0.0, gait.forward_mps).normalize();
            let apart = |step: usize| {
                let at = |joint| cycle.positions[step * 6 + joint];
                (at(3) - at(5)).dot(direction)
            };
            let foremost = (0..MATCH_STEPS)
                .max_by(|&a, &b| apart(a).total_cmp(&apart(b)))
                .unwrap();
            assert!(
                [0, 1, MATCH_STEPS - 1].contains(&foremost),
                "{name}: step {foremost}"
            );
            assert!(apart(0) > 0.3 && apart(MATCH_STEPS / 2) < 0.0, "{name}");
        }
        assert!(
            (cycle(&style, "run").1.offset - 0.75).abs() < 1e-3,
            "phase 0 is a quarter later"
        );
    }

    #[test]
    fn sway_is_the_sum_of_the_turning() {
        let style = walker_style();
        let (gait, walk) = cycle(&style, "walk");
        // If turning is the cosine, the heading is the sine: 0.15 rad at a quarter of the cycle.
        for (phase, want) in [(0.0, 0.0), (0.25, 0.15), (0.5, 0.0), (0.75, -0.15)] {
            let sway = walk.moment(gait, phase).sway;
            assert!((sway - want).abs() < 0.005, "{phase}: {sway}");
        }
        // The same if the poses themselves sway.
        let mut swaying = style.clone();
        let index = swaying.gaits.iter().position(|gait| gait.name == "walk").unwrap();
        for (key, &sway) in swaying.gaits[index].keys.iter_mut().zip(&walk.sway) {
            key.rotations[0] = yaw(sway + 0.3) * key.rotations[0];
            key.turn_rps = 0.0;
        }
        let (_, other) = cycle(&swaying, "walk");
        for (a, b) in walk.sway.iter().zip(&other.sway) {
            assert!((a - b).abs() < 1e-5);
        }
        assert!(other.pelvis.iter().all(|&q| heading_of(q, Vec3::X).abs() < 1e-5));
    }

    #[test]
    fn a_gait_of_one_key_is_the_same_at_any_phase() {
        let style = walker_style();
        let (gait, idle) = cycle(&style, "idle");
        for phase in [-1.3, 0.0, 0.4, 0.999_999_9] {
            let mut seen = 0;
            let moment = idle.sample(gait, phase, |joint, q| {
                seen += 1;
                assert!(angle_between(q, gait.keys[0].rotations[joint]) < 1e-4);
            });
            assert_eq!(
                (seen, moment.height_m, moment.sway),
                (6, gait.keys[0].height_m, 0.0)
            );
        }
        assert!(idle.velocities.iter().all(|v| *v == Vec3::ZERO));
    }

    #[test]
    fn a_skeleton_without_contacts_leaves_the_phases_as_given() {
        let plain = walker();
        let plain = Skeleton::new(plain.joints.clone(), plain.left_axis, 0.0, None).unwrap();
        let cycles = Cycles::new(&walker_style(), &plain);
        assert!(cycles.gaits.iter().all(|cycle| cycle.offset == 0.0));
        assert!(cycles.joint_weights.iter().all(|&weight| weight == 1.0));
    }

    proptest! {
        #[test]
        fn phases_wrap_and_poses_are_continuous(phase in -3.0f32..3.0, whole in -3i8..3) {
            let style = walker_style();
            let (gait, walk) = cycle(&style, "walk");
            let sample = |phase| {
                let mut pose = vec![Quat::IDENTITY; 6];
                let moment = walk.sample(gait, phase, |joint, q| pose[joint] = q);
                (pose, moment)
            };
            let ((a, am), (b, bm)) = (sample(phase), sample(phase + f32::from(whole)));
            let (c, cm) = sample(phase + 1e-4);
            for joint in 0..6 {
                prop_assert!(angle_between(a[joint], b[joint]) < 1e-3);
                prop_assert!(angle_between(a[joint], c[joint]) < 2e-3);
            }
            prop_assert!((am.sway - bm.sway).abs() < 1e-4 && (am.sway - cm.sway).abs() < 1e-3);
            prop_assert!((am.height_m - cm.height_m).abs() < 1e-3);
        }
    }
}

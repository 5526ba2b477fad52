//! How near a body's limbs come to each other, and how hard it accelerates over the ground.

use std::ops::Range;

use glam::Vec3;

use super::{MetricError, check_range};
use crate::bones::nearest_points;
use crate::fk::WorldMotion;
use crate::ik::{Leg, Torso, legs};
use crate::skeleton::Skeleton;

/// Frames of the two running means that remove the noise of single frames from the path of the
/// root.
const PATH_FRAMES: usize = 5;

/// Two joints and the straight bone between them.
type Bone = [usize; 2];

/// The bones whose distances show whether a body passes through itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limbs {
    /// Knee to ankle, by leg.
    shins: Vec<Bone>,
    /// Ankle to toes, by leg; only the ankle if it has no children.
    feet: Vec<Bone>,
    torso: Option<Torso>,
}

/// Distances between the axes of limbs in one frame, metres; infinite if the body lacks such limbs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbDistances {
    /// Between the two nearest shins.
    pub shins_m: f32,
    /// Between the two nearest feet.
    pub feet_m: f32,
    /// Between the trunk and the nearest forearm.
    pub arms_m: f32,
}

impl Limbs {
    /// The limbs of a skeleton, as far as they are found ([`legs`], [`Torso::of`]).
    pub fn of(skeleton: &Skeleton) -> Self {
        let legs = legs(skeleton);
        let foot = |leg: &Leg| [leg.foot, leg.toe.unwrap_or(leg.foot)];
        Self {
            shins: legs.iter().map(|leg| [leg.lower, leg.foot]).collect(),
            feet: legs.iter().map(foot).collect(),
            torso: Torso::of(skeleton),
        }
    }

    /// The distances in a frame, from the positions of its joints.
    pub fn distances(&self, positions: &[Vec3]) -> LimbDistances {
        let between = |a: &Bone, b: &Bone| {
            let [a, b] = nearest_points(a.map(|j| positions[j]), b.map(|j| positions[j]));
            a.distance(b)
        };
        let nearest = |bones: &[Bone]| {
            let pairs = bones
                .iter()
                .enumerate()
                .flat_map(|(nth, a)| bones[nth + 1..].iter().map(move |b| (a, b)));
            pairs.map(|(a, b)| between(a, b)).fold(f32::INFINITY, f32::min)
        };
        let to_trunk = |torso: &Torso| {
            let forearms = torso.arms.iter().map(|&[_, elbow, hand]| [elbow, hand]);
            let apart = forearms.map(|forearm| between(&forearm, &torso.trunk));
            apart.fold(f32::INFINITY, f32::min)
        };
        LimbDistances {
            shins_m: nearest(&self.shins),
            feet_m: nearest(&self.feet),
            arms_m: self.torso.as_ref().map_or(f32::INFINITY, to_trunk),
        }
    }

    /// The least of each distance over the frames of `range`.
    ///
    /// # Errors
    /// [`MetricError`] if the range does not fit.
    pub fn nearest(&self, motion: &WorldMotion, range: Range<usize>) -> Result<LimbDistances, MetricError> {
        check_range(motion, &range)?;
        let frames = range.map(|frame| self.distances(motion.positions_at(frame)));
        Ok(frames.fold(LimbDistances::FAR, LimbDistances::min))
    }
}

impl LimbDistances {
    /// Distances of a body without limbs.
    const FAR: Self = Self {
        shins_m: f32::INFINITY,
        feet_m: f32::INFINITY,
        arms_m: f32::INFINITY,
    };

    fn min(self, other: Self) -> Self {
        Self {
            shins_m: self.shins_m.min(other.shins_m),
            feet_m: self.feet_m.min(other.feet_m),
            arms_m: self.arms_m.min(other.arms_m),
        }
    }
}

/// Acceleration of the root over the ground, m/s², for each frame of `range` that has
/// [`ROOT_ACCELERATION_REACH`] frames on either side: the change of the velocity over 5 frames from
/// one such stretch to the next. That of a single frame ([`super::root_jitter_mps2`]) is mostly
/// noise.
///
/// # Errors
/// [`MetricError`] if the range does not fit.
pub fn root_accelerations_mps2(
    motion: &WorldMotion,
    range: Range<usize>,
    fps: f32,
) -> Result<Vec<f64>, MetricError> {
    check_range(motion, &range)?;
    let ground = |frame: usize| motion.positions_at(frame)[0] * Vec3::new(1.0, 0.0, 1.0);
    let per_s = fps / PATH_FRAMES as f32;
    let first = range.start.max(ROOT_ACCELERATION_REACH);
    let last = range
        .end
        .min(motion.frames().saturating_sub(ROOT_ACCELERATION_REACH));
    let at = |frame: usize| {
        let [before, now, after] = [frame - PATH_FRAMES, frame, frame + PATH_FRAMES].map(ground);
        f64::from(((after - now) - (now - before)).length() * per_s * per_s)
    };
    Ok((first..last).map(at).collect())
}

/// Frames on either side that [`root_accelerations_mps2`] reads.
pub const ROOT_ACCELERATION_REACH: usize = PATH_FRAMES;

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::clip::Clip;
    use crate::ik::testing::{person, standing};
    use crate::testing;

    #[test]
    fn legs_side_by_side_are_as_far_apart_as_the_hips() {
        let (skeleton, pose) = (person(), standing());
        let limbs = Limbs::of(&skeleton);
        let arms = limbs.torso.as_ref().map(|torso| torso.arms.len());
        assert_eq!((limbs.shins.len(), limbs.feet.len(), arms), (2, 2, Some(2)));
        let clip = Clip::new(skeleton.clone(), 30.0, vec![Vec3::Y; 3], pose.repeat(3)).unwrap();
        let motion = WorldMotion::from_clip(&clip);
        let hips: Vec<Vec3> = legs(&skeleton)
            .iter()
            .map(|leg| motion.positions_at(0)[leg.upper])
            .collect();
        let apart = limbs.nearest(&motion, 0..3).unwrap();
        assert!(
            (apart.shins_m - hips[0].distance(hips[1])).abs() < 0.02,
            "{apart:?}"
        );
        assert!(
            apart.feet_m <= apart.shins_m + 1e-3 && apart.arms_m > 0.05,
            "{apart:?}"
        );
        assert!(limbs.nearest(&motion, 0..4).is_err());
    }

    #[test]
    fn only_a_change_of_direction_accelerates() {
        let skeleton = testing::biped();
        let joints = skeleton.joint_count();
        // 1.5 m/s along Z, and from frame 20 on along X.
        let place = |frame: usize| {
            let (ahead, aside) = (frame.min(20), frame.saturating_sub(20));
            Vec3::new(aside as f32, 20.0, ahead as f32) * 0.05
        };
        let clip = Clip::new(
            skeleton,
            30.0,
            (0..40).map(place).collect(),
            vec![Quat::IDENTITY; 40 * joints],
        )
        .unwrap();
        let motion = WorldMotion::from_clip(&clip);
        let all = root_accelerations_mps2(&motion, 0..40, 30.0).unwrap();
        assert_eq!(all.len(), 30);
        // The velocity changes by 1.5 √2 m/s in a sixth of a second.
        let most = all.iter().copied().fold(0.0, f64::max);
        assert!((most - 1.5 * 2f64.sqrt() * 6.0).abs() < 1e-3, "{most}");
        assert!(all[..5].iter().all(|&a| a < 1e-3));
    }
}

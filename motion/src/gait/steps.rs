//! Finds left strikes in a clip, and smooths its motion.

use glam::Vec3;

use super::GaitError;
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::root::wrap_angle;
use crate::rotation::yaw;
use crate::skeleton::Skeleton;

/// Time over which the root's path is smoothed to separate travel from sway, seconds.
const TRAVEL_WINDOW_S: f32 = 0.7;
/// A strike is the largest lead of the left foot within this time on either side, seconds.
const STRIKE_WINDOW_S: f32 = 0.2;
/// A strike leads by at least this share of the clip's largest lead.
const STRIKE_SHARE: f32 = 0.3;
/// A joint this near to the middle of the body is on neither side, metres.
const MIDDLE_M: f32 = 0.01;
/// A slower clip stands, m/s.
const STANDING_MPS: f32 = 0.12;

/// A clip with everything that the search for cycles needs.
pub(super) struct Steps {
    pub(super) motion: WorldMotion,
    /// The pelvis' heading without jumps of a whole turn, radians.
    pub(super) headings: Vec<f32>,
    /// Median speed over the ground of the smoothed path, m/s.
    pub(super) median_speed: f32,
    /// Frames of left strikes, ascending.
    pub(super) strikes: Vec<usize>,
}

impl Steps {
    /// Finds the left strikes of a clip.
    pub(super) fn of(clip: &Clip) -> Result<Self, GaitError> {
        let motion = WorldMotion::from_clip(clip);
        let feet = feet(&clip.skeleton)?;
        let headings = unwrapped(clip);
        let path = smooth(&clip.root_positions, frames_of(TRAVEL_WINDOW_S, clip.fps));
        let velocities = slopes(&path, clip.fps);
        let speeds: Vec<f32> = velocities.iter().map(|v| v.length()).collect();
        let median_speed = median(&speeds);
        if median_speed < STANDING_MPS {
            return Err(GaitError::Stands {
                speed_mps: median_speed,
            });
        }
        let leads: Vec<f32> = velocities
            .iter()
            .enumerate()
            .map(|(f, v)| feet.lead_m(motion.positions_at(f), v.normalize_or_zero()))
            .collect();
        let strikes = peaks(&smooth(&leads, 3), frames_of(STRIKE_WINDOW_S, clip.fps));
        Ok(Self {
            motion,
            headings,
            median_speed,
            strikes,
        })
    }

    /// Joint positions of a frame relative to the root's place on the ground, facing `heading`,
    /// into `out`.
    pub(super) fn pose_along(&self, frame: usize, heading: f32, out: &mut Vec<Vec3>) {
        let positions = self.motion.positions_at(frame);
        let ground = positions[0] * Vec3::new(1.0, 0.0, 1.0);
        let turn = yaw(-heading);
        out.clear();
        out.extend(positions.iter().map(|&p| turn * (p - ground)));
    }
}

/// The contact joints of both feet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Feet {
    /// Indices of the left foot's contact joints.
    pub left: Vec<usize>,
    /// Indices of the right foot's contact joints.
    pub right: Vec<usize>,
}

impl Feet {
    /// How far the left foot is ahead of the right in a direction, metres, from the joints' world
    /// positions.
    pub fn lead_m(&self, positions: &[Vec3], direction: Vec3) -> f32 {
        let middle = |joints: &[usize]| {
            joints.iter().map(|&j| positions[j]).sum::<Vec3>() / joints.len().max(1) as f32
        };
        (middle(&self.left) - middle(&self.right)).dot(direction)
    }
}

/// Finds the contact joints of the left and of the right foot: those of the legs on the pelvis'
/// left and right.
///
/// # Errors
/// [`GaitError::NoFeet`] if one side has none.
pub fn feet(skeleton: &Skeleton) -> Result<Feet, GaitError> {
    let joints = skeleton.contacts.iter().flat_map(|c| &c.joints).copied();
    let (left, right): (Vec<_>, Vec<_>) = joints
        .filter(|&j| side(skeleton, j) != 0.0)
        .partition(|&j| side(skeleton, j) > 0.0);
    if left.is_empty() || right.is_empty() {
        return Err(GaitError::NoFeet);
    }
    Ok(Feet { left, right })
}

/// How far to the left of its parent the limb of a joint begins, metres. Of the joints on the way
/// to the pelvis, the one nearest to it that is not in the middle of the body decides. 0 if there
/// is none.
fn side(skeleton: &Skeleton, joint: usize) -> f32 {
    let up = std::iter::successors(Some(joint), |&j| skeleton.joints[j].parent);
    up.filter(|&j| skeleton.joints[j].parent.is_some())
        .map(|j| skeleton.joints[j].offset_m.dot(skeleton.left_axis))
        .filter(|offset| offset.abs() > MIDDLE_M)
        .last()
        .unwrap_or(0.0)
}

/// Headings without jumps by a whole turn.
pub(super) fn unwrapped(clip: &Clip) -> Vec<f32> {
    let mut last: Option<f32> = None;
    (0..clip.frames())
        .map(|f| {
            let heading = clip.root_at(f).heading;
            let heading = last.map_or(heading, |before| before + wrap_angle(heading - before));
            last = Some(heading);
            heading
        })
        .collect()
}

/// Whole frames of a time span, at least 1.
fn frames_of(span_s: f32, fps: f32) -> usize {
    ((span_s * fps).round() as usize).max(1)
}

/// The mean over `window` frames around each; the ends repeat.
fn smooth<T>(values: &[T], window: usize) -> Vec<T>
where
    T: Copy + Default + std::ops::Add<Output = T> + std::ops::Div<f32, Output = T>,
{
    let last = values.len().saturating_sub(1);
    let before = window / 2;
    (0..values.len())
        .map(|f| {
            let near = (0..window).map(|k| values[(f + k).saturating_sub(before).min(last)]);
            near.fold(T::default(), |sum, v| sum + v) / window as f32
        })
        .collect()
}

/// Central differences of a path over the ground, m/s; height is ignored.
fn slopes(path: &[Vec3], fps: f32) -> Vec<Vec3> {
    let last = path.len().saturating_sub(1);
    (0..path.len())
        .map(|f| {
            let (from, to) = (f.saturating_sub(1), (f + 1).min(last));
            let step = (path[to] - path[from]) * Vec3::new(1.0, 0.0, 1.0);
            step * fps / to.abs_diff(from).max(1) as f32
        })
        .collect()
}

/// Frames whose value is the largest within `window` frames, and at least [`STRIKE_SHARE`] of the
/// overall largest.
fn peaks(values: &[f32], window: usize) -> Vec<usize> {
    let most = values.iter().copied().fold(0.0, f32::max);
    let mut found: Vec<usize> = Vec::new();
    for f in window..values.len().saturating_sub(window) {
        let near = &values[f - window..=f + window];
        let largest = near.iter().all(|&v| v <= values[f]);
        // Two equal values next to each other are one peak.
        let apart = found.last().is_none_or(|&before| f - before > window);
        if largest && apart && values[f] > STRIKE_SHARE * most {
            found.push(f);
        }
    }
    found
}

/// The middle value; 0 without values.
pub(super) fn median(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

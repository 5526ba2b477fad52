//! The search for a standing frame.

use glam::Vec3;

use super::GaitError;
use super::steps::{Feet, feet};
use crate::clip::Clip;
use crate::fk::WorldMotion;

/// Which frames count as standing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandOptions {
    /// Highest speed of any joint, m/s.
    pub max_speed_mps: f32,
    /// Largest difference in height between the feet, metres.
    pub level_m: f32,
}

impl Default for StandOptions {
    /// At most 0.4 m/s, with feet level within 3 cm.
    fn default() -> Self {
        Self {
            max_speed_mps: 0.4,
            level_m: 0.03,
        }
    }
}

/// A frame that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// Index of the frame in the clip.
    pub frame: usize,
    /// Speed of its fastest joint, m/s.
    pub speed_mps: f32,
    /// Height of the root joint, metres.
    pub height_m: f32,
}

/// The stillest frame of a clip with both feet down and every other joint above them.
///
/// # Errors
/// [`GaitError::Restless`] if no frame is still enough, [`GaitError::NoFeet`], or
/// [`GaitError::TooShort`] for a single frame.
pub fn find_stand(clip: &Clip, options: &StandOptions) -> Result<Stand, GaitError> {
    if clip.frames() < 2 {
        return Err(GaitError::TooShort {
            frames: clip.frames(),
            least: 2,
        });
    }
    let motion = WorldMotion::from_clip(clip);
    let Feet { left, right } = feet(&clip.skeleton)?;
    let lowest =
        |joints: &[usize], at: &[Vec3]| joints.iter().map(|&j| at[j].y).fold(f32::INFINITY, f32::min);
    let still = |f: usize| {
        // Forward difference at the first frame, backward elsewhere.
        let (a, b) = (f.max(1) - 1, f.max(1));
        let pairs = motion.positions_at(a).iter().zip(motion.positions_at(b));
        pairs.map(|(p, q)| p.distance(*q) * clip.fps).fold(0.0, f32::max)
    };
    let level = |f: usize| {
        let at = motion.positions_at(f);
        let (l, r) = (lowest(&left, at), lowest(&right, at));
        let grounded = at
            .iter()
            .enumerate()
            .all(|(j, p)| left.contains(&j) || right.contains(&j) || p.y > l.min(r));
        grounded && (l - r).abs() <= options.level_m
    };
    let best = (0..clip.frames())
        .filter(|&f| level(f))
        .map(|frame| Stand {
            frame,
            speed_mps: still(frame),
            height_m: clip.root_positions[frame].y,
        })
        .min_by(|a, b| a.speed_mps.total_cmp(&b.speed_mps));
    match best {
        Some(stand) if stand.speed_mps <= options.max_speed_mps => Ok(stand),
        best => Err(GaitError::Restless {
            speed_mps: best.map_or(f32::INFINITY, |s| s.speed_mps),
            limit_mps: options.max_speed_mps,
        }),
    }
}

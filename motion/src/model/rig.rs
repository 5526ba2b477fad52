//! The body that a model animates, and how it plans.

use std::sync::Arc;

use glam::Quat;

use super::Dims;
use crate::Skeleton;
use crate::feasibility::Limits;
use crate::ik::{Leg, Torso, legs};
use crate::stance::low_hips_m;

/// The body that a pack animates, and the sizes of its segments: everything that a character knows
/// of its model.
#[derive(Debug, Clone)]
pub struct Rig {
    /// Name of the pack, or of the body.
    pub name: String,
    /// Frame rate, Hz.
    pub fps: f32,
    /// Lengths of segments, and widths of tensors.
    pub dims: Dims,
    /// The skeleton of poses and frames.
    pub skeleton: Arc<Skeleton>,
    /// The skeleton's legs, whose standing feet are held.
    pub legs: Arc<[Leg]>,
    /// The trunk and the arms that are kept off it.
    pub torso: Option<Arc<Torso>>,
    /// Hips lower than this over the ground belong to a seated or crouching pose, metres.
    pub low_hips_m: f32,
    /// How its plans are asked for by paths; none if they are asked for by keyframes.
    pub by_path: Option<ByPath>,
    /// The extremes of its pack's data; none if the pack has no such table.
    pub limits: Option<Arc<Limits>>,
}

/// What planning needs of a body that moves along paths, without keyframes.
#[derive(Debug, Clone, PartialEq)]
pub struct ByPath {
    /// Speed of a walk, m/s: estimated from its size.
    pub usual_speed_mps: f32,
    /// Highest speed of a path, m/s: estimated from its size.
    pub max_speed_mps: f32,
    /// The words that its clips show.
    pub words: Vec<String>,
    /// The pose to stand in: joint 0 facing +Z, others relative to their parents.
    pub neutral: Box<[Quat]>,
    /// Height of the root in that pose, metres.
    pub height_m: f32,
}

impl Rig {
    /// The rig of a skeleton. Legs, torso and the height of low hips follow from it.
    pub fn new(name: &str, fps: f32, dims: Dims, skeleton: Skeleton) -> Self {
        Self {
            name: name.to_owned(),
            fps,
            dims,
            low_hips_m: low_hips_m(&skeleton),
            legs: legs(&skeleton).into(),
            torso: Torso::of(&skeleton).map(Arc::new),
            skeleton: Arc::new(skeleton),
            by_path: None,
            limits: None,
        }
    }

    /// Name of the pack, or of the body.
    pub fn name(&self) -> &str {
        &self.name
    }
}

//! What a model animates.

use std::sync::Arc;

use glam::Quat;

use super::Dims;
use crate::Skeleton;
use crate::feasibility::Limits;
use crate::ik::{Leg, legs};
use crate::stance::low_hips_m;

/// The body that a pack animates, and the sizes of its segments: all that a character knows of its
/// model.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The pack's name.
    pub name: String,
    /// Frames a second.
    pub fps: f32,
    /// Sizes of segments.
    pub dims: Dims,
    /// The skeleton that poses and frames are of.
    pub skeleton: Arc<Skeleton>,
    /// The skeleton's legs, whose feet are held still where they stand.
    pub legs: Arc<[Leg]>,
    /// Hips lower than this over the ground are those of one who sits or crouches, metres.
    pub low_hips_m: f32,
    /// How its plans are asked for, where that is by paths; by keyframes otherwise.
    pub by_path: Option<ByPath>,
    /// What the data of its pack does at most; none where the pack does not say.
    pub limits: Option<Arc<Limits>>,
}

/// What planning needs of a body that moves along paths, with no keyframes to go to.
#[derive(Debug, Clone, PartialEq)]
pub struct ByPath {
    /// Speed of a walk, m/s: a guess from its size.
    pub usual_speed_mps: f32,
    /// Fastest path that it is asked to follow, m/s: a guess from its size.
    pub max_speed_mps: f32,
    /// The words that its clips show.
    pub words: Vec<String>,
    /// The pose to stand in: joint 0 as it faces +Z, others relative to their parents.
    pub neutral: Box<[Quat]>,
    /// Height of the root in that pose, metres.
    pub height_m: f32,
}

impl Rig {
    /// The rig of a skeleton; legs and the height of low hips follow from it.
    pub fn new(name: &str, fps: f32, dims: Dims, skeleton: Skeleton) -> Self {
        Self {
            name: name.to_owned(),
            fps,
            dims,
            low_hips_m: low_hips_m(&skeleton),
            legs: legs(&skeleton).into(),
            skeleton: Arc::new(skeleton),
            by_path: None,
            limits: None,
        }
    }

    /// The pack's name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

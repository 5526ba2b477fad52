//! What a model animates.

use std::sync::Arc;

use super::Dims;
use crate::Skeleton;
use crate::ik::{Leg, legs};
use crate::stance::low_hips_m;

/// The body that a pack animates, and the sizes of its segments: all that a character knows of its model.
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
        }
    }

    /// The pack's name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

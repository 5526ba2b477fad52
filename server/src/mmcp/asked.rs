//! A checked request: the motion to make, and how it is answered.

use std::sync::Arc;

use troupe_character::take::{Note, Take};

use super::model::Model;
use super::skeleton::Joints;

/// A checked request.
#[derive(Debug, Clone)]
pub struct Asked {
    /// What animates it.
    pub model: Model,
    /// How the request orders the joints.
    pub joints: Arc<Joints>,
    /// The motion.
    pub take: Arc<Take>,
    /// Motions to make, 1 to `MAX_SAMPLES`.
    pub samples: usize,
    /// What the check did otherwise than asked.
    pub notes: Vec<Note>,
}

//! A checked request: the motion to make, and the form of its answer.

use std::sync::Arc;

use troupe_character::take::{Note, Take};
use troupe_live::packs::LoadedPack;

use super::model::Model;
use super::skeleton::Joints;

/// A checked request.
#[derive(Debug, Clone)]
pub struct Asked {
    /// The model that the request names.
    pub model: Model,
    /// The pack that makes the motion: the model's, or another one that plans its path.
    pub by: Arc<LoadedPack>,
    /// The joints of the request.
    pub joints: Arc<Joints>,
    /// The motion to make.
    pub take: Arc<Take>,
    /// Number of motions to make, 1 to `MAX_SAMPLES`.
    pub samples: usize,
    /// Where the check deviated from the request.
    pub notes: Vec<Note>,
}

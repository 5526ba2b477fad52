//! The interface to the graph of a pack.

use super::Inputs;
use crate::EngineError;

/// Runs the graph of one pack: one robot a call.
pub trait Planner: Send {
    /// Writes the frames that the graph predicts into `qpos`: 36 numbers each, and as many frames
    /// as the graph counts.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails.
    fn plan(&mut self, inputs: &Inputs, qpos: &mut Vec<f32>) -> Result<(), EngineError>;
}

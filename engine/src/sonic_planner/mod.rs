//! NVIDIA's planner for the G1 (`planner_sonic.onnx`): one graph that continues four frames of a
//! robot, by a mode, a direction and a speed (docs/decisions/official-networks.md).
//!
//! It was never run with the published weights: they are not in the repository. Tests have a small
//! graph with the same inputs and outputs, which `training/tests/planner_support.py` makes.

mod generator;
mod inputs;
mod motion;
mod network;
mod probe;
mod translation;

pub use generator::SonicPlanner;
pub use inputs::Inputs;
pub use network::Planner;
pub use probe::probe_task;

use troupe_motion::Robot;
use troupe_motion::model::Body;

use crate::EngineError;

/// Frames of a live character's window.
pub(crate) const LIVE_FRAMES: usize = 36;
/// Numbers of a frame.
pub(crate) const QPOS: usize = troupe_motion::robot::ROOT_QPOS + crate::pack::sonic_planner::HINGES;

/// The robot of a task's body.
///
/// # Errors
/// [`EngineError::WrongTask`] if the body is no robot.
fn robot_of(body: &Body) -> Result<&Robot, EngineError> {
    body.rig.skeleton.robot.as_ref().ok_or(EngineError::WrongTask)
}

#[cfg(test)]
mod tests;

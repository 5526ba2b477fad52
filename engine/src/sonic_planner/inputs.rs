//! The inputs of one call, with the graph's names.

use super::QPOS;
use crate::pack::sonic_planner::{CONTEXT_FRAMES, TOKENS};

/// Token counts that a plan may have.
pub(super) const COUNTS: usize = TOKENS[1] - TOKENS[0] + 1;
/// Frames of the graph's target.
pub(super) const TARGETS: usize = 4;

/// A tensor: name, shape, numbers.
pub(crate) type Tensor<'a, T> = (&'static str, &'static [usize], &'a [T]);

/// The inputs of one call. Places are in metres, in MuJoCo's axes: X ahead, Y to the left, Z up.
#[derive(Debug, Clone, PartialEq)]
pub struct Inputs {
    /// Four frames: place, rotation (w, x, y, z), angles of the hinges.
    pub context_mujoco_qpos: Vec<f32>,
    /// Speed, m/s; 0 or less for that of the mode.
    pub target_vel: [f32; 1],
    /// Number of the mode.
    pub mode: [i64; 1],
    /// Unit length; zero to stay in place.
    pub movement_direction: [f32; 3],
    /// Unit length.
    pub facing_direction: [f32; 3],
    /// Height of the root, metres; below 0 for that of the mode.
    pub height: [f32; 1],
    /// Below 10,000.
    pub random_seed: [i64; 1],
    /// 1 if the targets count.
    pub has_specific_target: [i64; 1],
    /// Places of the last four frames.
    pub specific_target_positions: [[f32; 3]; TARGETS],
    /// Headings of the last four frames, radians.
    pub specific_target_headings: [f32; TARGETS],
    /// 1 for each allowed number of tokens, from the fewest on.
    pub allowed_pred_num_tokens: [i64; COUNTS],
}

impl Default for Inputs {
    /// A robot without a command: every number that a frame decides is 0.
    fn default() -> Self {
        Self {
            context_mujoco_qpos: vec![0.0; CONTEXT_FRAMES * QPOS],
            target_vel: [-1.0],
            mode: [0],
            movement_direction: [0.0; 3],
            facing_direction: [0.0; 3],
            height: [-1.0],
            random_seed: [0],
            has_specific_target: [0],
            specific_target_positions: [[0.0; 3]; TARGETS],
            specific_target_headings: [0.0; TARGETS],
            allowed_pred_num_tokens: [0; COUNTS],
        }
    }
}

impl Inputs {
    /// The float tensors.
    pub(crate) fn floats(&self) -> [Tensor<'_, f32>; 7] {
        [
            (
                "context_mujoco_qpos",
                &[1, CONTEXT_FRAMES, QPOS],
                &self.context_mujoco_qpos,
            ),
            ("target_vel", &[1], &self.target_vel),
            ("movement_direction", &[1, 3], &self.movement_direction),
            ("facing_direction", &[1, 3], &self.facing_direction),
            ("height", &[1], &self.height),
            (
                "specific_target_positions",
                &[1, TARGETS, 3],
                self.specific_target_positions.as_flattened(),
            ),
            (
                "specific_target_headings",
                &[1, TARGETS],
                &self.specific_target_headings,
            ),
        ]
    }

    /// The integer tensors.
    pub(crate) fn integers(&self) -> [Tensor<'_, i64>; 4] {
        [
            ("mode", &[1], &self.mode),
            ("random_seed", &[1], &self.random_seed),
            ("has_specific_target", &[1, 1], &self.has_specific_target),
            (
                "allowed_pred_num_tokens",
                &[1, COUNTS],
                &self.allowed_pred_num_tokens,
            ),
        ]
    }
}

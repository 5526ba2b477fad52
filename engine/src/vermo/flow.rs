//! The flow decoder: Euler steps from noise to frames, one a call.

use super::motion::Frames;
use super::network::{FlowCall, Networks};
use crate::EngineError;
use crate::pack::{FLOW_FILE, FRAMES_PER_TOKEN};
use crate::random::{normal, step64};

/// A run of the flow decoder for one motion.
#[derive(Debug)]
pub(super) struct Flow {
    codes: Vec<u32>,
    seed: u64,
    steps: u32,
    done: u32,
    /// `[frames, D]`; empty before the first step.
    state: Vec<f32>,
    frames: Frames,
}

impl Flow {
    pub(super) fn new(codes: Vec<u32>, seed: u64, steps: u32) -> Self {
        Self {
            codes,
            seed,
            steps: steps.max(1),
            done: 0,
            state: Vec::new(),
            frames: Frames::default(),
        }
    }

    /// Whether all steps have been taken.
    pub(super) fn is_done(&self) -> bool {
        self.done == self.steps
    }

    /// The frames after the latest step.
    pub(super) fn frames(&self) -> &Frames {
        &self.frames
    }

    /// Takes one Euler step.
    pub(super) fn step(&mut self, networks: &mut dyn Networks) -> Result<(), EngineError> {
        let width = networks.flow_width().ok_or_else(|| EngineError::Network {
            file: FLOW_FILE,
            problem: "the pack has no flow decoder".to_owned(),
        })?;
        if self.done == 0 {
            self.state = vec![0.0; self.codes.len() * FRAMES_PER_TOKEN * width];
            // The noise of a frame depends on the seed and the frame's index alone.
            for (frame, state) in self.state.chunks_exact_mut(width).enumerate() {
                normal(step64(self.seed, frame as u64), state);
            }
        }
        let call = FlowCall {
            codes: &self.codes,
            state: &self.state,
            time: self.done as f32 / self.steps as f32,
            delta: 1.0 / self.steps as f32,
        };
        (self.state, self.frames) = networks.flow(&call)?;
        self.done += 1;
        Ok(())
    }
}

//! Windows of motion codes that a step decodes: windows of equal length share a call.

use super::motion::Frames;
use super::network::Networks;
use crate::EngineError;
use crate::generator::JobId;

/// Most windows of a call.
const MOST_ROWS: usize = 32;

/// The windows that one step decodes.
#[derive(Debug, Default)]
pub(super) struct Windows {
    windows: Vec<Window>,
}

#[derive(Debug)]
struct Window {
    job: JobId,
    agent: usize,
    codes: Vec<u32>,
    /// Empty before decoding.
    frames: Frames,
}

impl Windows {
    /// Adds a window for an agent of a job.
    pub(super) fn add(&mut self, job: JobId, agent: usize, codes: Vec<u32>) {
        self.windows.push(Window {
            job,
            agent,
            codes,
            frames: Frames::default(),
        });
    }

    /// Decodes all windows.
    ///
    /// # Errors
    /// [`EngineError`] if the network fails.
    pub(super) fn decode(&mut self, networks: &mut dyn Networks) -> Result<(), EngineError> {
        self.windows.sort_by_key(|window| window.codes.len());
        for alike in self.windows.chunk_by_mut(|a, b| a.codes.len() == b.codes.len()) {
            for call in alike.chunks_mut(MOST_ROWS) {
                let codes: Vec<&[u32]> = call.iter().map(|window| &*window.codes).collect();
                let decoded = networks.decode(&codes)?;
                for (window, frames) in call.iter_mut().zip(decoded) {
                    window.frames = frames;
                }
            }
        }
        Ok(())
    }

    /// The frames of an agent's window; none if the agent added no window.
    pub(super) fn take(&mut self, job: JobId, agent: usize) -> Option<Frames> {
        let wanted = |window: &&mut Window| window.job == job && window.agent == agent;
        let window = self.windows.iter_mut().find(wanted)?;
        Some(std::mem::take(&mut window.frames))
    }
}

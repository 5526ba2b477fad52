//! The interface to the networks of a pack.

use super::motion::Frames;
use crate::EngineError;

/// Inputs of one call of the language model, with the names of docs/vermo-pack.md.
#[derive(Debug, Clone, Copy)]
pub struct LanguageCall<'a> {
    /// Number of sequences S.
    pub sequences: usize,
    /// Columns L that the call reads.
    pub columns: usize,
    /// Columns C of the cache.
    pub cached: usize,
    /// `[S, L]`.
    pub tokens: &'a [i64],
    /// `[S]`.
    pub count: &'a [i64],
    /// `[S]`.
    pub start: &'a [i64],
    /// `[S, layers, 2, key_heads, C, head_width]`.
    pub cache: &'a [f32],
}

/// Outputs of a call. The buffers are reused.
#[derive(Debug, Default)]
pub struct LanguageAnswer {
    /// `[S, V]`.
    pub logits: Vec<f32>,
    /// `[S, layers, 2, key_heads, L, head_width]`.
    pub columns: Vec<f32>,
}

/// One Euler step of the flow decoder.
#[derive(Debug, Clone, Copy)]
pub struct FlowCall<'a> {
    /// Motion codes `[T]`.
    pub codes: &'a [u32],
    /// `[4 T, D]`.
    pub state: &'a [f32],
    /// Time of the state, from 0 to 1.
    pub time: f32,
    /// Length of the step, in the same unit.
    pub delta: f32,
}

/// Runs the networks of one pack.
///
/// The answer for a sequence or a window must not depend on the others of a call or on its index
/// among them, to the last bit.
pub trait Networks: Send {
    /// Writes the logits after the last tokens and the tokens' columns for the cache into `answer`,
    /// whose buffers already have the right length.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails; the whole call fails with it.
    fn language(&mut self, call: &LanguageCall<'_>, answer: &mut LanguageAnswer) -> Result<(), EngineError>;

    /// Motion codes of frames. The number of frames must be a multiple of four.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails, or gives codes that the pack does not have.
    fn encode(&mut self, frames: &Frames) -> Result<Vec<u32>, EngineError>;

    /// Frames of several windows of motion codes, each relative to its first root. All windows have
    /// one length.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails.
    fn decode(&mut self, windows: &[&[u32]]) -> Result<Vec<Frames>, EngineError>;

    /// Numbers D of a frame in the flow decoder's state; none for a pack without flow decoder.
    fn flow_width(&self) -> Option<usize>;

    /// The next state of the flow decoder, and its frames.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails, or the pack has no flow decoder.
    fn flow(&mut self, call: &FlowCall<'_>) -> Result<(Vec<f32>, Frames), EngineError>;
}

//! The networks of a pack.

use super::motion::Frames;
use crate::EngineError;

/// Inputs of one call of the language model, as docs/vermo-pack.md names them.
#[derive(Debug, Clone, Copy)]
pub struct LanguageCall<'a> {
    /// Sequences S.
    pub sequences: usize,
    /// Columns L.
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

/// What a call gives. Its buffers are used again.
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
    /// From 0 to 1.
    pub time: f32,
    /// Length of the step.
    pub delta: f32,
}

/// Runs the networks of one pack.
///
/// A sequence's answer, and a window's, must not depend on the others of a call, nor on its place
/// among them, to the last bit.
pub trait Networks: Send {
    /// Logits after the last tokens, and their columns for the cache. Both have the right length
    /// when it is called.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails; the whole call fails with it.
    fn language(&mut self, call: &LanguageCall<'_>, answer: &mut LanguageAnswer) -> Result<(), EngineError>;

    /// Motion codes of frames, whose number is a multiple of four.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails, or gives codes that the pack does not have.
    fn encode(&mut self, frames: &Frames) -> Result<Vec<u32>, EngineError>;

    /// Frames of each of some windows of motion codes, in the frame of its first root. All windows
    /// are of one length.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails.
    fn decode(&mut self, windows: &[&[u32]]) -> Result<Vec<Frames>, EngineError>;

    /// Numbers D of a frame in the flow decoder's state; none for a pack without one.
    fn flow_width(&self) -> Option<usize>;

    /// The next state and its frames.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails, or the pack has no flow decoder.
    fn flow(&mut self, call: &FlowCall<'_>) -> Result<(Vec<f32>, Frames), EngineError>;
}

//! The interface to the networks of a pack.

use super::Call;
use crate::EngineError;

/// Runs the networks of one pack: one denoising step of several characters, each at a step of its
/// own.
///
/// A character's answer must not depend on the other characters of a call, to the last bit.
pub trait Denoiser: Send {
    /// Whether the first call of a shape is as fast as later ones. Otherwise the warm-up makes some
    /// calls.
    fn any_shape(&self) -> bool {
        true
    }

    /// Writes the clean rows that the network predicts, `[R, T, 6]`, into `clean`. Its length is
    /// that of the call's `x`.
    ///
    /// # Errors
    /// [`EngineError`] if the engine fails; the whole call fails with it.
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError>;
}

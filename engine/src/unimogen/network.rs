//! The network of a pack.

use super::Call;
use crate::EngineError;

/// Runs the network of one pack: one denoising step of any mixture of characters, each at a step of
/// its own.
///
/// A character's answer must not depend on the others of a call, to the last bit.
pub trait Denoiser: Send {
    /// Whether a call of any shape is as fast as one that was made before. Else the warm-up makes
    /// some.
    fn any_shape(&self) -> bool {
        true
    }

    /// Puts the rows `[R, T, 6]` that the network takes for clean into `clean`, whose length is
    /// that of the call's `x`.
    ///
    /// # Errors
    /// [`EngineError`] where the engine fails; the whole call fails with it.
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError>;
}

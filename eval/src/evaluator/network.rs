//! Running the evaluator's network: pure Rust, on the processor.

use rten::{LoadError, Model, NodeId, RunError};
use rten_tensor::Tensor;
use rten_tensor::prelude::*;
use sha2::{Digest as _, Sha256};

use super::inputs::Inputs;

/// Why an evaluator cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum NetworkError {
    /// It is no network that can be read.
    #[error("is no ONNX file that can be run here: {0}")]
    Load(#[from] LoadError),
    /// It does not run, or not on this skeleton.
    #[error("does not run as an evaluator of this pack: {0}")]
    Run(#[from] RunError),
    /// It answers with something else than latents.
    #[error("gives no latent [batch, numbers]")]
    Output,
}

/// A network with the inputs and the output of an evaluator.
pub(super) struct Network {
    model: Model,
    root: NodeId,
    positions: NodeId,
    six_d: NodeId,
    latent: NodeId,
}

impl Network {
    /// From the bytes of an ONNX file.
    pub(super) fn load(bytes: Vec<u8>) -> Result<Self, NetworkError> {
        let model = Model::load(bytes)?;
        Ok(Self {
            root: model.node_id("root")?,
            positions: model.node_id("positions")?,
            six_d: model.node_id("six_d")?,
            latent: model.node_id("latent")?,
            model,
        })
    }

    /// The latents of windows, frames and joints as many as `shape` says.
    pub(super) fn run(
        &self,
        inputs: Inputs,
        [windows, frames, joints]: [usize; 3],
    ) -> Result<Vec<Vec<f32>>, NetworkError> {
        let root = Tensor::from_data(&[windows, frames, 5], inputs.root);
        let positions = Tensor::from_data(&[windows, frames, joints, 3], inputs.positions);
        let six_d = Tensor::from_data(&[windows, frames, joints, 6], inputs.six_d);
        let inputs = vec![
            (self.root, root.into()),
            (self.positions, positions.into()),
            (self.six_d, six_d.into()),
        ];
        let [latent] = self.model.run_n(inputs, [self.latent], None)?;
        let latent: Tensor<f32> = latent.try_into().map_err(|_| NetworkError::Output)?;
        match *latent.shape() {
            [rows, numbers] if rows == windows && numbers > 0 => {
                let all = latent.to_vec();
                Ok(all.chunks_exact(numbers).map(<[f32]>::to_vec).collect())
            }
            _ => Err(NetworkError::Output),
        }
    }
}

/// The digest of a file, in hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

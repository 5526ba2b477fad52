//! The networks of a UniMoGen pack on ONNX Runtime: one session each, for all shapes.

use std::borrow::Cow;

use ort::session::{Session, SessionInputValue};
use ort::value::{Outlet, TensorElementType, TensorRef};
use troupe_motion::model::{DESCRIPTION, SLOTS};

use super::outlets::OPEN;
use super::{Runtime, SessionOptions, exit, one_line, outlets, session};
use crate::pack::Pack;
use crate::unimogen::{Call, Denoiser, PATH_FEATURES, ROW_CHANNELS};
use crate::{EngineError, EngineKind};

/// Number of kernels that OpenVINO keeps. Callers bring their own skeletons, and the kernels of
/// each shape take 3 MiB. With OpenVINO's own limit a session grew by 530 MiB over 164 shapes.
const KERNELS: usize = 500;
/// Name of the output.
const CLEAN: &str = "clean";

/// The sessions of one worker.
pub struct OnnxDenoiser {
    engine: EngineKind,
    /// File and session of each network, in the order of [`Pack::files`].
    networks: Vec<(&'static str, Session)>,
}

impl OnnxDenoiser {
    /// Loads the networks of `pack`, and checks their tensors.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`].
    pub fn load(runtime: &Runtime, pack: &Pack, options: SessionOptions) -> Result<Self, EngineError> {
        let load = |file| {
            let session = session::open(runtime, options, &pack.folder.join(file), Some(KERNELS))
                .map_err(|reason| EngineError::Load { file, reason })?;
            check(pack.words.len(), session.inputs(), session.outputs())
                .map_err(|problem| EngineError::Signature { file, problem })?;
            Ok((file, session))
        };
        Ok(Self {
            engine: options.engine,
            networks: pack
                .files()
                .into_iter()
                .map(load)
                .collect::<Result<_, EngineError>>()?,
        })
    }
}

/// One call of a network.
fn run(session: &mut Session, call: &Call, clean: &mut [f32]) -> Result<(), String> {
    let mut inputs: Vec<(Cow<'_, str>, SessionInputValue<'_>)> = Vec::new();
    for (name, shape, numbers) in call.floats() {
        let tensor = TensorRef::from_array_view((shape, numbers)).map_err(|error| one_line(&error))?;
        inputs.push((name.into(), tensor.into()));
    }
    for (name, shape, numbers) in call.integers() {
        let tensor = TensorRef::from_array_view((shape, numbers)).map_err(|error| one_line(&error))?;
        inputs.push((name.into(), tensor.into()));
    }
    let _call = exit::enter();
    let outputs = session.run(inputs).map_err(|error| one_line(&error))?;
    let value = outputs.get(CLEAN).ok_or_else(|| format!("it gave no {CLEAN}"))?;
    let (_, found) = value
        .try_extract_tensor::<f32>()
        .map_err(|error| one_line(&error))?;
    if found.len() != clean.len() {
        let wanted = clean.len();
        return Err(format!(
            "it gave {CLEAN} of {} elements, expected {wanted}",
            found.len()
        ));
    }
    clean.copy_from_slice(found);
    Ok(())
}

impl Denoiser for OnnxDenoiser {
    /// OpenVINO makes kernels for each shape: 20 to 25 ms the first time.
    fn any_shape(&self) -> bool {
        self.engine == EngineKind::Cpu
    }

    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError> {
        let (file, session) = &mut self.networks[call.network];
        run(session, call, clean).map_err(|problem| EngineError::Network { file, problem })
    }
}

/// Compares the tensors with those for a pack with `words` words.
fn check(words: usize, inputs: &[Outlet], outputs: &[Outlet]) -> Result<(), String> {
    use TensorElementType::{Float32, Int64};
    let (channels, path) = (ROW_CHANNELS as i64, PATH_FEATURES as i64);
    let (described, slots, words) = (DESCRIPTION as i64, SLOTS as i64, words as i64);
    let wanted = [
        ("x", Float32, &[OPEN, OPEN, channels][..]),
        ("given", Float32, &[OPEN, OPEN]),
        ("path", Float32, &[OPEN, OPEN, path]),
        ("step", Float32, &[OPEN]),
        ("style", Float32, &[OPEN, words]),
        ("description", Float32, &[OPEN, described]),
        ("owner", Int64, &[OPEN]),
        ("rows", Int64, &[OPEN, slots]),
        ("reads", Float32, &[OPEN, slots]),
    ];
    let clean = (CLEAN, Float32, &[OPEN, OPEN, channels][..]);
    outlets::check((&wanted, &[clean]), inputs, outputs)
}

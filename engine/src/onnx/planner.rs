//! The graph of a pack with NVIDIA's planner on ONNX Runtime.

use std::borrow::Cow;

use ort::session::{Session, SessionInputValue};
use ort::value::{DynValue, Outlet, TensorElementType, TensorRef};

use super::outlets::OPEN;
use super::{Runtime, SessionOptions, exit, one_line, outlets, session};
use crate::EngineError;
use crate::pack::{PLANNER_FILE, Pack};
use crate::sonic_planner::{Inputs, Planner, QPOS};

/// Name of the output with the frames.
const FRAMES: &str = "mujoco_qpos";
/// Name of the output with their number. Further frames are padding.
const COUNT: &str = "num_pred_frames";

/// The session of one worker.
pub struct OnnxPlanner(Session);

impl OnnxPlanner {
    /// Loads the graph of `pack`, and checks its tensors.
    ///
    /// # Errors
    /// [`EngineError::Load`] or [`EngineError::Signature`].
    pub fn load(runtime: &Runtime, pack: &Pack, options: SessionOptions) -> Result<Self, EngineError> {
        let file = PLANNER_FILE;
        let session = session::open(runtime, options, &pack.folder.join(file), None)
            .map_err(|reason| EngineError::Load { file, reason })?;
        check(session.inputs(), session.outputs())
            .map_err(|problem| EngineError::Signature { file, problem })?;
        Ok(Self(session))
    }

    fn run(&mut self, inputs: &Inputs, qpos: &mut Vec<f32>) -> Result<(), String> {
        let mut given: Vec<(Cow<'_, str>, SessionInputValue<'_>)> = Vec::new();
        for (name, shape, numbers) in inputs.floats() {
            let tensor =
                TensorRef::from_array_view((shape.to_vec(), numbers)).map_err(|error| one_line(&error))?;
            given.push((name.into(), tensor.into()));
        }
        for (name, shape, numbers) in inputs.integers() {
            let tensor =
                TensorRef::from_array_view((shape.to_vec(), numbers)).map_err(|error| one_line(&error))?;
            given.push((name.into(), tensor.into()));
        }
        let _call = exit::enter();
        let outputs = self.0.run(given).map_err(|error| one_line(&error))?;
        let frames = count(outputs.get(COUNT).ok_or_else(|| format!("it gave no {COUNT}"))?)?;
        let value = outputs
            .get(FRAMES)
            .ok_or_else(|| format!("it gave no {FRAMES}"))?;
        let (_, made) = value
            .try_extract_tensor::<f32>()
            .map_err(|error| one_line(&error))?;
        let wanted = frames.checked_mul(QPOS).and_then(|numbers| made.get(..numbers));
        let wanted = wanted.ok_or_else(|| {
            let room = made.len() / QPOS;
            format!("{COUNT} is {frames}, and {FRAMES} has {room} frames")
        })?;
        qpos.clear();
        qpos.extend_from_slice(wanted);
        Ok(())
    }
}

impl Planner for OnnxPlanner {
    fn plan(&mut self, inputs: &Inputs, qpos: &mut Vec<f32>) -> Result<(), EngineError> {
        self.run(inputs, qpos).map_err(|problem| EngineError::Network {
            file: PLANNER_FILE,
            problem,
        })
    }
}

/// The number of frames. The release documents 64 bits, and its own program reads 32.
fn count(value: &DynValue) -> Result<usize, String> {
    let long = value
        .try_extract_tensor::<i64>()
        .map(|(_, numbers)| numbers.first().copied());
    let number = match long {
        Ok(number) => number,
        Err(_) => {
            let (_, numbers) = value
                .try_extract_tensor::<i32>()
                .map_err(|error| one_line(&error))?;
            numbers.first().map(|&number| i64::from(number))
        }
    };
    let number = number.ok_or_else(|| format!("it gave an empty {COUNT}"))?;
    usize::try_from(number).map_err(|_| format!("it gave {COUNT} of {number}, expected 0 or more"))
}

/// Compares the tensors with those of the release.
fn check(inputs: &[Outlet], outputs: &[Outlet]) -> Result<(), String> {
    use TensorElementType::{Float32, Int32, Int64};
    let own = Inputs::default();
    let axes = |shape: &[usize]| -> Vec<i64> { shape.iter().map(|&size| size as i64).collect() };
    let floats = own.floats().map(|(name, shape, _)| (name, Float32, axes(shape)));
    let integers = own.integers().map(|(name, shape, _)| (name, Int64, axes(shape)));
    let all: Vec<_> = floats.into_iter().chain(integers).collect();
    let wanted: Vec<outlets::Wanted<'_>> = all
        .iter()
        .map(|(name, ty, axes)| (*name, *ty, &axes[..]))
        .collect();
    // A graph may fix the number of frames: every call checks that there are enough.
    let room = match outputs
        .iter()
        .find(|output| output.name() == FRAMES)
        .map(outlets::axes)
    {
        Some([1, frames, _]) => *frames,
        _ => OPEN,
    };
    let frames = (FRAMES, Float32, &[1, room, QPOS as i64][..]);
    outlets::check((&wanted, &[frames]), inputs, outputs)?;
    let counts = [Int64, Int32]
        .into_iter()
        .flat_map(|ty| [&[][..], &[1][..]].map(|axes| (COUNT, ty, axes)));
    let found: Vec<_> = counts
        .map(|count| outlets::check((&wanted, &[count]), inputs, outputs))
        .collect();
    match found.iter().any(Result::is_ok) {
        true => Ok(()),
        false => found.into_iter().next().unwrap_or(Ok(())),
    }
}

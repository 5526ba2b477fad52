//! OpenVINO itself, from the library that ONNX Runtime's provider also uses.
//!
//! ONNX Runtime's provider gives each session its own graph with all weights. Here a stage's
//! weights are read once, and all networks of the stage are compiled from them.

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use openvino::{Core, DeviceType, ElementType, InferRequest, Model, PartialShape, RwPropertyKey, Tensor};

use super::exit::{self, Owned};
use super::one_line;
use super::weights::shareable;

/// Number of networks compiled at the same time: OpenVINO's core compiles one at a time.
const CORES: usize = 2;
/// Beginning of the file name of OpenVINO's C interface.
const LIBRARY: &str = "libopenvino_c.so";

/// The loaded library.
pub(super) struct OpenVino {
    cores: Vec<Mutex<Core>>,
}

impl OpenVino {
    /// Loads the library that is in the same folder as `onnx_runtime`.
    pub(super) fn load(onnx_runtime: &Path) -> Result<Self, String> {
        let folder = onnx_runtime.parent().unwrap_or(Path::new("."));
        let files = std::fs::read_dir(folder).map_err(|error| one_line(&error))?;
        let library = files
            .filter_map(Result::ok)
            .find(|file| file.file_name().to_string_lossy().starts_with(LIBRARY))
            .ok_or_else(|| {
                format!(
                    "there is no {LIBRARY} in {}; `make runtime` fetches it",
                    folder.display()
                )
            })?;
        openvino_sys::library::load_from(library.path())?;
        let _call = exit::enter();
        let core = || Core::new().map(Mutex::new).map_err(|error| one_line(&error));
        Ok(Self {
            cores: (0..CORES).map(|_| core()).collect::<Result<_, _>>()?,
        })
    }

    fn core(&self) -> MutexGuard<'_, Core> {
        let free = self.cores.iter().find_map(|core| match core.try_lock() {
            Ok(core) => Some(core),
            Err(TryLockError::Poisoned(core)) => Some(core.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        });
        free.unwrap_or_else(|| self.cores[0].lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Reads a stage's graph.
    pub(super) fn read(&self, file: &Path) -> Result<Owned<Model>, String> {
        let _call = exit::enter();
        let bytes = std::fs::read(file).map_err(|error| one_line(&error))?;
        let mut core = self.core();
        if let Some(bytes) = shareable(&bytes) {
            match core.read_model_from_buffer(&bytes, None) {
                Ok(model) => return Ok(Owned::new(model)),
                Err(error) => tracing::debug!(file = %file.display(), %error, "weights are not shared"),
            }
        }
        drop(bytes);
        let path = file.to_str().ok_or("the path is not UTF-8")?;
        core.read_model_from_file(path, "")
            .map(Owned::new)
            .map_err(|error| one_line(&error))
    }

    /// Compiles a network for inputs of these shapes, which runs on `threads` threads in bf16.
    pub(super) fn compile(
        &self,
        model: &mut Model,
        inputs: &[(&'static str, Vec<usize>)],
        outputs: &[&'static str],
        threads: usize,
    ) -> Result<Compiled, String> {
        let _call = exit::enter();
        let failed = |error: openvino::InferenceError| one_line(&error);
        let shapes = inputs.iter().map(|(name, shape)| {
            let axes: Vec<i64> = shape.iter().map(|&axis| axis as i64).collect();
            Ok((*name, PartialShape::new_static(axes.len() as i64, &axes)?))
        });
        let shapes: Vec<(&str, PartialShape)> = shapes.collect::<Result<_, _>>().map_err(failed)?;
        let by_name: Vec<(&str, &PartialShape)> = shapes.iter().map(|(name, shape)| (*name, shape)).collect();
        model.reshape(&by_name).map_err(failed)?;
        let threads = threads.to_string();
        // Without pinning: workers do not know of each other, and would all use the first cores.
        let properties = [
            (RwPropertyKey::HintInferencePrecision, "bf16"),
            (RwPropertyKey::InferenceNumThreads, threads.as_str()),
            (RwPropertyKey::NumStreams, "1"),
            (RwPropertyKey::HintEnableCpuPinning, "NO"),
        ];
        let mut core = self.core();
        core.set_properties(&DeviceType::CPU, properties)
            .map_err(failed)?;
        let mut network = core.compile_model(model, DeviceType::CPU).map_err(failed)?;
        drop(core);
        let request = network.create_infer_request().map_err(failed)?;
        let tensors = |names: &mut dyn Iterator<Item = &'static str>| {
            let tensors = names.map(|name| Ok((name, request.get_tensor(name)?)));
            tensors.collect::<Result<Vec<_>, _>>().map_err(failed)
        };
        Ok(Compiled(Owned::new(Request {
            inputs: tensors(&mut inputs.iter().map(|(name, _)| *name))?,
            outputs: tensors(&mut outputs.iter().copied())?,
            request,
        })))
    }
}

/// A network of fixed shapes with its input and output tensors. It runs one call at a time.
pub(super) struct Compiled(Owned<Request>);

struct Request {
    request: InferRequest,
    inputs: Vec<(&'static str, Tensor)>,
    outputs: Vec<(&'static str, Tensor)>,
}

/// The type of a tensor's elements.
pub(super) trait Element: Copy {
    const TYPE: ElementType;
}

impl Element for f32 {
    const TYPE: ElementType = ElementType::F32;
}

impl Element for i64 {
    const TYPE: ElementType = ElementType::I64;
}

impl Compiled {
    pub(super) fn set<T: Element>(&mut self, name: &str, values: &[T]) -> Result<(), String> {
        let found = self.0.inputs.iter_mut().find(|(input, _)| *input == name);
        let (_, tensor) = found.ok_or_else(|| format!("there is no input {name}"))?;
        let fits = tensor.get_element_type() == Ok(T::TYPE);
        let into = tensor.get_data_mut::<T>().map_err(|error| one_line(&error))?;
        if !fits || into.len() != values.len() {
            return Err(format!(
                "the input {name} has {} elements, not {}",
                into.len(),
                values.len()
            ));
        }
        into.copy_from_slice(values);
        Ok(())
    }

    pub(super) fn infer(&mut self) -> Result<(), String> {
        let _call = exit::enter();
        self.0.request.infer().map_err(|error| one_line(&error))
    }

    /// An output of the last run.
    pub(super) fn get<T: Element>(&self, name: &str) -> Result<&[T], String> {
        let found = self.0.outputs.iter().find(|(output, _)| *output == name);
        let (_, tensor) = found.ok_or_else(|| format!("no {name}"))?;
        if tensor.get_element_type() != Ok(T::TYPE) {
            return Err(format!("{name} of another type"));
        }
        tensor.get_data::<T>().map_err(|error| one_line(&error))
    }
}

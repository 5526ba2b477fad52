//! The ONNX Runtime library: finds it, loads it, and asks what it offers.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use ort::environment::Environment;
use ort::ep::{self, ExecutionProvider};

use super::openvino::OpenVino;
use super::provider;
use crate::{EngineError, EngineKind};

/// The environment variable with the path of the ONNX Runtime library.
pub const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// The runtime, ready to load stages: one library and one environment for the process. It has no
/// thread pool, because the sessions of each worker have their own.
#[derive(Clone)]
pub struct Runtime {
    environment: Environment,
    library: PathBuf,
    openvino: Arc<OnceLock<Result<Arc<OpenVino>, String>>>,
}

impl Runtime {
    /// Loads the library, or returns the runtime that this process already has. Without a path,
    /// `ORT_DYLIB_PATH` names it.
    ///
    /// # Errors
    /// [`EngineError::Library`], which says how to get the library.
    pub fn new(library: Option<&Path>) -> Result<Self, EngineError> {
        static CURRENT: Mutex<Option<Runtime>> = Mutex::new(None);
        let mut current = CURRENT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = &*current {
            return Ok(runtime.clone());
        }
        let runtime = Self::load(library)?;
        *current = Some(runtime.clone());
        Ok(runtime)
    }

    fn load(library: Option<&Path>) -> Result<Self, EngineError> {
        let named = library
            .map(Path::to_path_buf)
            .or_else(|| std::env::var_os(LIBRARY_VARIABLE).map(PathBuf::from));
        let path = named.ok_or_else(|| EngineError::Library(format!("{LIBRARY_VARIABLE} is not set")))?;
        // The real path: ONNX Runtime looks for its providers' libraries in the folder of the
        // opened file, which must not be a link from elsewhere. And ort resolves relative paths
        // from the executable, while users mean the working directory.
        let path = std::fs::canonicalize(&path).unwrap_or(path);
        if !path.is_file() {
            return Err(EngineError::Library(format!(
                "there is no library at {}",
                path.display()
            )));
        }
        let failed = |error: &dyn std::fmt::Display| EngineError::Library(error.to_string());
        let environment = ort::init_from(&path)
            .map_err(|error| failed(&error))?
            .with_name("troupe")
            .with_telemetry(false)
            .build()
            .map_err(|error| failed(&error))?;
        tracing::info!(library = %path.display(), "ONNX Runtime loaded");
        Ok(Self {
            environment,
            library: path,
            openvino: Arc::default(),
        })
    }

    pub(super) fn environment(&self) -> &Environment {
        &self.environment
    }

    /// OpenVINO itself, loaded at the first request.
    pub(super) fn openvino(&self) -> Result<Arc<OpenVino>, String> {
        self.openvino
            .get_or_init(|| OpenVino::load(&self.library).map(Arc::new))
            .clone()
    }

    /// Loads the libraries that the provider of an engine needs, if it needs any.
    ///
    /// # Errors
    /// A text that names what is missing.
    pub(crate) fn load_needed(&self, engine: EngineKind) -> Result<(), String> {
        provider::load_needed(&self.library, engine)
    }

    /// The library's file, with links followed.
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// The version in the library's file name, as in `libonnxruntime.so.1.24.1`.
    pub fn version(&self) -> Option<&str> {
        let name = self.library.file_name()?.to_str()?;
        let start = name.find(|c: char| c.is_ascii_digit())?;
        let version = name[start..].trim_end_matches(".dylib");
        version
            .split('.')
            .all(|part| part.parse::<u32>().is_ok())
            .then_some(version)
    }

    /// The library's description of its build.
    pub fn build(&self) -> &'static str {
        ort::info()
    }

    /// Whether the library was built with this engine's provider. The provider may still fail to
    /// load.
    pub fn offers(&self, engine: EngineKind) -> bool {
        let offered = match engine {
            EngineKind::Cpu => Ok(true),
            EngineKind::OpenvinoBf16 => ep::OpenVINO::is_available(),
            EngineKind::Cuda => ep::CUDA::is_available(),
            EngineKind::Tensorrt => ep::TensorRT::is_available(),
        };
        offered.unwrap_or(false)
    }
}

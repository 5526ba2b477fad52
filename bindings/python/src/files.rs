//! Files as Python names them, and the files beside them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use troupe_motion::read::{Source, beside};

use crate::errors::wrong;

/// Where the files beside one are found.
enum Beside {
    Folder(PathBuf),
    Given(HashMap<String, Vec<u8>>),
}

/// A file of the disk or of memory.
pub(crate) struct File {
    name: String,
    bytes: Vec<u8>,
    beside: Beside,
}

impl File {
    /// A path, or bytes with the name that errors give them. `beside` replaces the file's folder.
    pub(crate) fn of(
        source: &Bound<'_, PyAny>,
        name: Option<String>,
        beside: Option<HashMap<String, Vec<u8>>>,
    ) -> PyResult<Self> {
        if let Ok(bytes) = source.cast::<PyBytes>() {
            let Some(name) = name else {
                return Err(wrong("bytes need a name: read(data, name=\"walk.bvh\")"));
            };
            return Ok(Self {
                name,
                bytes: bytes.as_bytes().to_vec(),
                beside: Beside::Given(beside.unwrap_or_default()),
            });
        }
        let path: PathBuf = source.extract()?;
        let mut file = Self::open(&path).map_err(|error| at(&path, error))?;
        if let Some(name) = name {
            file.name = name;
        }
        if let Some(beside) = beside {
            file.beside = Beside::Given(beside);
        }
        Ok(file)
    }

    /// A file of the disk.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self {
            name: path.display().to_string(),
            bytes: fs::read(path)?,
            beside: Beside::Folder(path.parent().unwrap_or(Path::new("")).to_owned()),
        })
    }

    /// Calls `read` with the file as the reader takes it.
    pub(crate) fn with_source<T>(&self, read: impl FnOnce(&Source<'_>) -> T) -> T {
        let found = |name: &str| match &self.beside {
            Beside::Given(files) => files.get(name).cloned(),
            Beside::Folder(folder) => beside::below(folder, name),
        };
        read(&Source {
            name: &self.name,
            bytes: &self.bytes,
            beside: &found,
        })
    }
}

/// An error of the disk with the path: `FileNotFoundError` and the like.
pub(crate) fn at(path: &Path, error: io::Error) -> PyErr {
    io::Error::new(error.kind(), format!("{}: {error}", path.display())).into()
}

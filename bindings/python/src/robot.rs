//! Robots as URDF and MJCF describe them.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use troupe_motion::read::beside::mesh;
use troupe_motion::robot::description::{self, BuildOptions, Built};

use crate::errors::refused;
use crate::files::at;
use crate::skeleton::Skeleton;

/// A robot made of its maker's description.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct RobotDescription {
    skeleton: Arc<troupe_motion::Skeleton>,
    contacts: Vec<String>,
}

impl RobotDescription {
    pub(crate) fn inner(&self) -> &Arc<troupe_motion::Skeleton> {
        &self.skeleton
    }
}

#[pymethods]
impl RobotDescription {
    #[getter]
    fn skeleton(&self) -> Skeleton {
        Skeleton::of(Arc::clone(&self.skeleton))
    }

    #[getter]
    fn contacts(&self) -> Vec<String> {
        self.contacts.clone()
    }
}

/// Reads a URDF or an MJCF, with the meshes that it names.
#[pyfunction]
#[pyo3(signature = (path, *, legs = vec![], end_effectors = vec![]))]
pub(crate) fn read_robot(
    py: Python<'_>,
    path: PathBuf,
    legs: Vec<String>,
    end_effectors: Vec<(String, String, [f64; 3])>,
) -> PyResult<RobotDescription> {
    built(py, &path, legs, end_effectors)
}

/// The robot of a description's file.
pub(crate) fn built(
    py: Python<'_>,
    path: &Path,
    legs: Vec<String>,
    end_effectors: Vec<(String, String, [f64; 3])>,
) -> PyResult<RobotDescription> {
    let options = BuildOptions { legs, end_effectors };
    let text = fs::read_to_string(path).map_err(|error| at(path, error))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let built = py.detach(|| {
        let description = description::read(&text, &|name| mesh(folder, name))?;
        description::build(&description, &options)
    });
    let Built { skeleton, contacts } =
        built.map_err(|error| refused(format!("{}: {error}", path.display())))?;
    Ok(RobotDescription {
        skeleton: Arc::new(skeleton),
        contacts,
    })
}

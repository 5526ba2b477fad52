//! Bodies as motion is carried over from one to another.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Quat;
use pyo3::prelude::*;
use serde_json::Value;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::read::{self, Options};
use troupe_motion::retarget;

use crate::arrays::{of_python, to_python};
use crate::clip::Clip;
use crate::errors::{misread, unmapped, wrong};
use crate::files::{File, at};
use crate::robot::{RobotDescription, built};
use crate::skeleton::Skeleton;

/// Endings of robots' descriptions.
const DESCRIPTIONS: [&str; 2] = ["urdf", "xml"];

/// A body in its neutral pose.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct Figure {
    figure: retarget::Figure,
}

impl Figure {
    pub(crate) fn inner(&self) -> &retarget::Figure {
        &self.figure
    }

    /// The figure that an argument names: itself, a clip, a skeleton, a robot or a file.
    pub(crate) fn named(body: &Bound<'_, PyAny>, doc: &PartsDoc) -> PyResult<retarget::Figure> {
        let py = body.py();
        if let Ok(figure) = body.cast::<Self>() {
            return Ok(figure.get().figure.clone());
        }
        if let Ok(clip) = body.cast::<Clip>() {
            let clip = clip.get();
            return py.detach(|| clip.figure(doc)).map_err(unmapped);
        }
        if let Ok(robot) = body.cast::<RobotDescription>() {
            return of_skeleton(robot.get().inner(), doc).map_err(unmapped);
        }
        if let Ok(skeleton) = body.cast::<Skeleton>() {
            return of_skeleton(skeleton.get().inner(), doc).map_err(unmapped);
        }
        let path: PathBuf = body.extract()?;
        of_file(py, &path, doc)
    }
}

#[pymethods]
impl Figure {
    #[new]
    #[pyo3(signature = (body, *, parts = None))]
    fn new(body: &Bound<'_, PyAny>, parts: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let figure = Self::named(body, &parts_of(parts)?)?;
        Ok(Self { figure })
    }

    #[getter]
    fn skeleton(&self) -> Skeleton {
        Skeleton::of(Arc::clone(self.figure.skeleton()))
    }

    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &PartsDoc::of(self.figure.parts(), self.figure.skeleton()))
    }

    #[getter]
    fn leg_m(&self) -> f32 {
        self.figure.leg_m()
    }
}

/// Corrections of a body's parts: none, the path of a TOML file, or its tables.
pub(crate) fn parts_of(parts: Option<&Bound<'_, PyAny>>) -> PyResult<PartsDoc> {
    let Some(parts) = parts else {
        return Ok(PartsDoc::default());
    };
    let Ok(path) = parts.extract::<PathBuf>() else {
        return of_python(parts);
    };
    let toml = parts.py().import("tomllib")?;
    let text = fs::read_to_string(&path).map_err(|error| at(&path, error))?;
    let tables = toml.call_method1("loads", (text,));
    let tables = tables.map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    of_python(&tables).map_err(|error| wrong(format!("{}: {error}", path.display())))
}

fn of_skeleton(
    skeleton: &Arc<troupe_motion::Skeleton>,
    doc: &PartsDoc,
) -> Result<retarget::Figure, retarget::RetargetError> {
    let skeleton = Arc::clone(skeleton);
    if skeleton.robot.is_some() {
        return retarget::Figure::of_robot(skeleton, doc);
    }
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    retarget::Figure::new(skeleton, &rest, None, doc)
}

fn of_file(py: Python<'_>, path: &Path, doc: &PartsDoc) -> PyResult<retarget::Figure> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let made = if DESCRIPTIONS.iter().any(|one| ending == *one) {
        of_skeleton(built(py, path, vec![], vec![])?.inner(), doc)
    } else {
        let file = File::open(path).map_err(|error| at(path, error))?;
        let found = py.detach(|| file.with_source(|source| read::character(source, &Options::default())));
        found.map_err(|error| misread(py, &error))?.figure(doc)
    };
    made.map_err(|error| unmapped(format!("{}: {error}", path.display())))
}

/// Figures of a carried-over clip with `faults`: what is beyond the bar.
pub(crate) fn figures<'py>(py: Python<'py>, of: &retarget::Figures) -> PyResult<Bound<'py, PyAny>> {
    let mut table = serde_json::to_value(of).map_err(wrong)?;
    if let Value::Object(fields) = &mut table {
        fields.insert("faults".to_owned(), Value::from(of.faults()));
    }
    to_python(py, &table)
}

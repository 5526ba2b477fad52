//! Clips: what a file gave, or arrays.

use std::sync::Arc;

use glam::Quat;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use troupe_motion::fk::WorldMotion;
use troupe_motion::read::{Report, Understood};

use crate::arrays::{
    Frames, Rows, frames_of_rotations, frames_of_vectors, rotations, to_frames_of_rotations, to_python,
    to_vectors, vectors,
};
use crate::errors::wrong;
use crate::skeleton::Skeleton;

/// World places and rotations of every joint, as arrays.
type World<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>);

/// Motion on a skeleton.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct Clip {
    clip: troupe_motion::Clip,
    rest: Option<Vec<Quat>>,
    report: Option<Report>,
}

impl Clip {
    pub(crate) fn of(understood: Understood) -> Self {
        Self {
            clip: understood.clip,
            rest: understood.rest,
            report: Some(understood.report),
        }
    }

    fn joints(&self) -> usize {
        self.clip.skeleton.joint_count()
    }
}

#[pymethods]
impl Clip {
    #[new]
    fn new(
        skeleton: &Bound<'_, Skeleton>,
        fps: f32,
        root_positions: Rows<'_>,
        rotations: Frames<'_>,
    ) -> PyResult<Self> {
        let skeleton = skeleton.get().inner();
        let roots = to_vectors("root_positions", &root_positions)?;
        let rotations = to_frames_of_rotations("rotations", &rotations, skeleton.joint_count())?;
        let clip = troupe_motion::Clip::new(Arc::clone(skeleton), fps, roots, rotations);
        Ok(Self {
            clip: clip.map_err(wrong)?,
            rest: None,
            report: None,
        })
    }

    #[getter]
    fn skeleton(&self) -> Skeleton {
        Skeleton::of(Arc::clone(&self.clip.skeleton))
    }

    #[getter]
    fn fps(&self) -> f32 {
        self.clip.fps
    }

    #[getter]
    fn root_positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        vectors(py, &self.clip.root_positions)
    }

    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        frames_of_rotations(py, &self.clip.rotations, self.joints())
    }

    #[getter]
    fn rest<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        self.rest.as_deref().map(|rest| rotations(py, rest)).transpose()
    }

    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        (self.report.as_ref())
            .map(|report| to_python(py, report))
            .transpose()
    }

    /// The report as rows of a table: what, its value, the evidence.
    fn table(&self) -> Vec<[String; 3]> {
        self.report.as_ref().map(Report::rows).unwrap_or_default()
    }

    fn world<'py>(&self, py: Python<'py>) -> PyResult<World<'py>> {
        let world = py.detach(|| WorldMotion::from_clip(&self.clip));
        Ok((
            frames_of_vectors(py, &world.positions, world.joints)?,
            frames_of_rotations(py, &world.rotations, world.joints)?,
        ))
    }

    fn resample(&self, py: Python<'_>, fps: f32) -> PyResult<Self> {
        let clip = py.detach(|| self.clip.resample(fps));
        Ok(Self {
            clip: clip.map_err(wrong)?,
            rest: self.rest.clone(),
            report: self.report.clone(),
        })
    }

    fn __len__(&self) -> usize {
        self.clip.frames()
    }
}

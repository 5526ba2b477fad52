//! Clips: what a file gave, or arrays.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Quat;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::bvh::{self, BvhFile, BvhWriteOptions};
use troupe_motion::fk::WorldMotion;
use troupe_motion::glb::write_glb;
use troupe_motion::read::{Report, Understood};
use troupe_motion::retarget::{self, RetargetError, Retargeter};

use crate::arrays::{
    Frames, Rows, frames_of_rotations, frames_of_vectors, rotations, to_frames_of_rotations, to_python,
    to_vectors, vectors,
};
use crate::errors::{unmapped, wrong};
use crate::figure::{Figure, figures, parts_of};
use crate::files::at;
use crate::skeleton::Skeleton;

/// World places and rotations of every joint, as arrays.
type World<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray3<f32>>);

/// Most that a bone of a body may differ from the clip's, metres.
const SAME_BONES_M: f32 = 1e-3;

/// Motion on a skeleton.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct Clip {
    clip: troupe_motion::Clip,
    rest: Option<Vec<Quat>>,
    rest_root_y_m: Option<f32>,
    /// Parts that the file itself names.
    parts: PartsDoc,
    report: Option<Report>,
}

impl Clip {
    pub(crate) fn of(understood: Understood) -> Self {
        Self {
            clip: understood.clip,
            rest: understood.rest,
            rest_root_y_m: understood.rest_root_y_m,
            parts: understood.parts,
            report: Some(understood.report),
        }
    }

    fn joints(&self) -> usize {
        self.clip.skeleton.joint_count()
    }

    /// The clip's body, as `Understood::figure` finds it.
    pub(crate) fn figure(&self, doc: &PartsDoc) -> Result<retarget::Figure, RetargetError> {
        match &self.report {
            Some(report) => {
                let found = Understood {
                    clip: self.clip.clone(),
                    rest: self.rest.clone(),
                    rest_root_y_m: self.rest_root_y_m,
                    parts: self.parts.clone(),
                    report: report.clone(),
                };
                found.figure(doc)
            }
            None => retarget::Figure::of_clip(&self.clip, self.rest.as_deref(), doc),
        }
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
            rest_root_y_m: None,
            parts: PartsDoc::default(),
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
            rest_root_y_m: self.rest_root_y_m,
            parts: self.parts.clone(),
            report: self.report.clone(),
        })
    }

    #[pyo3(signature = (to, *, to_parts = None, body = None, parts = None))]
    fn retarget<'py>(
        &self,
        py: Python<'py>,
        to: &Bound<'py, PyAny>,
        to_parts: Option<&Bound<'py, PyAny>>,
        body: Option<&Bound<'py, Figure>>,
        parts: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Self, Bound<'py, PyAny>)> {
        let target = Figure::named(to, &parts_of(to_parts)?)?;
        let parts = parts_of(parts)?;
        let source = match body {
            Some(body) if !is_same(body.get().inner().skeleton(), &self.clip.skeleton) => {
                return Err(wrong("body has another skeleton than the clip"));
            }
            Some(body) => body.get().inner().clone(),
            None => py.detach(|| self.figure(&parts)).map_err(unmapped)?,
        };
        let made = py.detach(|| {
            let mut retargeter = Retargeter::new(source, target)?;
            retarget::retarget(&mut retargeter, &self.clip)
        });
        let (clip, found) = made.map_err(unmapped)?;
        let made = Self {
            clip,
            rest: None,
            rest_root_y_m: None,
            parts: PartsDoc::default(),
            report: None,
        };
        Ok((made, figures(py, &found)?))
    }

    /// Writes the clip as BVH (centimetres) or glTF, by the path's ending.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let bytes = py.detach(|| match ending.to_str() {
            Some("bvh") => {
                let file = BvhFile::from_clip(&self.clip, &BvhWriteOptions::default());
                let text = file.map(|file| bvh::write(&file).into_bytes());
                text.map_err(|error| error.to_string())
            }
            Some("glb") => write_glb(&self.clip).map_err(|error| error.to_string()),
            _ => Err("its ending is of no format that is written; allowed: .bvh, .glb".to_owned()),
        });
        let bytes = bytes.map_err(|error| wrong(format!("{}: {error}", path.display())))?;
        fs::write(&path, bytes).map_err(|error| at(&path, error))
    }

    fn __len__(&self) -> usize {
        self.clip.frames()
    }
}

/// Whether two skeletons have the same joints, with bones of the same length.
fn is_same(one: &troupe_motion::Skeleton, other: &troupe_motion::Skeleton) -> bool {
    let mut pairs = one.joints.iter().zip(&other.joints).enumerate();
    one.joint_count() == other.joint_count()
        && pairs.all(|(joint, (a, b))| {
            let apart_m = a.offset_m.distance(b.offset_m);
            (&a.name, a.parent) == (&b.name, b.parent) && (joint == 0 || apart_m <= SAME_BONES_M)
        })
}

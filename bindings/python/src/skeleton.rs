//! Skeletons, and the hinges of those that are robots.

use std::sync::Arc;

use glam::{Quat, Vec3};
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use troupe_motion::robot::RobotDoc;
use troupe_motion::{Joint, Robot};

use crate::arrays::{Rows, frames_of_rotations, of_python, to_python, to_rotations, to_vectors, vectors};
use crate::errors::wrong;

/// Joints with parents and offsets.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct Skeleton {
    skeleton: Arc<troupe_motion::Skeleton>,
}

impl Skeleton {
    pub(crate) fn of(skeleton: Arc<troupe_motion::Skeleton>) -> Self {
        Self { skeleton }
    }

    pub(crate) fn inner(&self) -> &Arc<troupe_motion::Skeleton> {
        &self.skeleton
    }

    fn hinged(&self) -> PyResult<&Robot> {
        let robot = self.skeleton.robot.as_ref();
        robot.ok_or_else(|| wrong("the skeleton has no hinges; read_robot makes one that has them"))
    }
}

#[pymethods]
impl Skeleton {
    #[new]
    #[pyo3(signature = (names, parents, offsets, *, left_axis = [1.0, 0.0, 0.0], ground_y_m = 0.0))]
    fn new(
        names: Vec<String>,
        parents: Vec<i64>,
        offsets: Rows<'_>,
        left_axis: [f32; 3],
        ground_y_m: f32,
    ) -> PyResult<Self> {
        let offsets = to_vectors("offsets", &offsets)?;
        if names.len() != parents.len() || names.len() != offsets.len() {
            return Err(wrong(format!(
                "{} names, {} parents and {} offsets; allowed: as many of each",
                names.len(),
                parents.len(),
                offsets.len()
            )));
        }
        let joint = |((name, parent), offset_m)| Joint {
            name,
            parent: usize::try_from(parent).ok(),
            offset_m,
        };
        let joints = names.into_iter().zip(parents).zip(offsets).map(joint).collect();
        let skeleton = troupe_motion::Skeleton::new(joints, Vec3::from(left_axis), ground_y_m, None);
        Ok(Self::of(Arc::new(skeleton.map_err(wrong)?)))
    }

    /// A skeleton of the tables of a pack's `pack.toml`.
    #[staticmethod]
    #[pyo3(signature = (skeleton, robot = None))]
    fn of_tables(skeleton: &Bound<'_, PyAny>, robot: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let skeleton: troupe_motion::Skeleton = of_python(skeleton)?;
        let skeleton = match robot {
            None => skeleton,
            Some(robot) => skeleton
                .with_robot(&of_python::<RobotDoc>(robot)?)
                .map_err(wrong)?,
        };
        Ok(Self::of(Arc::new(skeleton)))
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.skeleton
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect()
    }

    #[getter]
    fn parents(&self) -> Vec<i64> {
        let parent = |joint: &Joint| joint.parent.map_or(-1, |parent| parent as i64);
        self.skeleton.joints.iter().map(parent).collect()
    }

    #[getter]
    fn offsets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let offsets: Vec<Vec3> = self.skeleton.joints.iter().map(|joint| joint.offset_m).collect();
        vectors(py, &offsets)
    }

    #[getter]
    fn left_axis(&self) -> [f32; 3] {
        self.skeleton.left_axis.to_array()
    }

    #[getter]
    fn ground_y_m(&self) -> f32 {
        self.skeleton.ground_y_m
    }

    /// The table `[skeleton]` of a pack's `pack.toml`.
    #[getter]
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &*self.skeleton)
    }

    /// The table `[robot]` of a pack's `pack.toml`; none for a skeleton without hinges.
    #[getter]
    fn robot<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let robot = self.skeleton.robot.as_ref();
        robot
            .map(|robot| to_python(py, &RobotDoc::from((robot, &*self.skeleton))))
            .transpose()
    }

    fn pose<'py>(
        &self,
        py: Python<'py>,
        root_rotations: Rows<'py>,
        angles: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robot = self.hinged()?;
        let roots = to_rotations("root_rotations", &root_rotations)?;
        let angles = angles.as_array();
        let (frames, hinges) = (roots.len(), robot.hinges().len());
        if angles.dim() != (frames, hinges) {
            return Err(wrong(format!(
                "angles has shape {:?}; allowed: [{frames}, {hinges}]",
                angles.dim()
            )));
        }
        let joints = self.skeleton.joint_count();
        let mut rotations = vec![Quat::IDENTITY; frames * joints];
        let mut row = vec![0.0; hinges];
        for ((pose, &root), from) in rotations.chunks_exact_mut(joints).zip(&roots).zip(angles.rows()) {
            row.iter_mut().zip(from).for_each(|(to, &from)| *to = from);
            robot.pose(root, &row, pose);
        }
        frames_of_rotations(py, &rotations, joints)
    }

    fn __len__(&self) -> usize {
        self.skeleton.joint_count()
    }
}

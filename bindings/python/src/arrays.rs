//! Vectors and rotations as arrays of NumPy, and back.

use glam::{Quat, Vec3};
use numpy::ndarray::Axis;
use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArray3, PyArrayLike2, PyArrayLike3};
use numpy::{PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use troupe_motion::rotation::{from_wxyz, to_wxyz};

use crate::errors::wrong;

/// Two dimensions of numbers of any kind, as NumPy converts them.
pub(crate) type Rows<'py> = PyArrayLike2<'py, f32, AllowTypeChange>;
/// Three dimensions.
pub(crate) type Frames<'py> = PyArrayLike3<'py, f32, AllowTypeChange>;

/// `[n, 3]` of vectors.
pub(crate) fn vectors<'py>(py: Python<'py>, of: &[Vec3]) -> PyResult<Bound<'py, PyArray2<f32>>> {
    flat_vectors(of).into_pyarray(py).reshape([of.len(), 3])
}

/// `[frames, joints, 3]` of frame-major vectors.
pub(crate) fn frames_of_vectors<'py>(
    py: Python<'py>,
    of: &[Vec3],
    joints: usize,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let frames = of.len() / joints.max(1);
    flat_vectors(of).into_pyarray(py).reshape([frames, joints, 3])
}

/// `[n, 4]` of rotations.
pub(crate) fn rotations<'py>(py: Python<'py>, of: &[Quat]) -> PyResult<Bound<'py, PyArray2<f32>>> {
    flat_rotations(of).into_pyarray(py).reshape([of.len(), 4])
}

/// `[frames, joints, 4]` of frame-major rotations.
pub(crate) fn frames_of_rotations<'py>(
    py: Python<'py>,
    of: &[Quat],
    joints: usize,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let frames = of.len() / joints.max(1);
    flat_rotations(of).into_pyarray(py).reshape([frames, joints, 4])
}

/// Vectors of an array `[n, 3]`.
pub(crate) fn to_vectors(name: &str, array: &Rows<'_>) -> PyResult<Vec<Vec3>> {
    let array = array.as_array();
    if array.ncols() != 3 {
        return Err(wrong(format!("{name} has {} columns; allowed: 3", array.ncols())));
    }
    Ok((array.rows().into_iter())
        .map(|row| Vec3::new(row[0], row[1], row[2]))
        .collect())
}

/// Rotations of an array `[n, 4]`. Their lengths are not checked.
pub(crate) fn to_rotations(name: &str, array: &Rows<'_>) -> PyResult<Vec<Quat>> {
    let array = array.as_array();
    if array.ncols() != 4 {
        return Err(wrong(format!(
            "{name} has {} columns; allowed: 4 (w, x, y, z)",
            array.ncols()
        )));
    }
    Ok((array.rows().into_iter())
        .map(|row| from_wxyz([row[0], row[1], row[2], row[3]]))
        .collect())
}

/// Frame-major rotations of an array `[frames, joints, 4]`. Their lengths are not checked.
pub(crate) fn to_frames_of_rotations(name: &str, array: &Frames<'_>, joints: usize) -> PyResult<Vec<Quat>> {
    let shape = array.shape();
    if shape[1..] != [joints, 4] {
        return Err(wrong(format!(
            "{name} has shape {shape:?}; allowed: [frames, {joints}, 4], quaternions (w, x, y, z)"
        )));
    }
    Ok((array.as_array().lanes(Axis(2)).into_iter())
        .map(|q| from_wxyz([q[0], q[1], q[2], q[3]]))
        .collect())
}

/// Any value as Python's own: dicts, lists, strings and numbers, as `--json` writes them.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(wrong)?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A value of Rust from dicts, lists, strings and numbers.
pub(crate) fn of_python<T: DeserializeOwned>(value: &Bound<'_, PyAny>) -> PyResult<T> {
    let text = value.py().import("json")?.call_method1("dumps", (value,))?;
    serde_json::from_str(&text.extract::<String>()?).map_err(wrong)
}

fn flat_vectors(of: &[Vec3]) -> Vec<f32> {
    let mut flat = Vec::with_capacity(3 * of.len());
    of.iter().for_each(|v| flat.extend(v.to_array()));
    flat
}

fn flat_rotations(of: &[Quat]) -> Vec<f32> {
    let mut flat = Vec::with_capacity(4 * of.len());
    of.iter().for_each(|&q| flat.extend(to_wxyz(q)));
    flat
}

//! Errors of the reader as exceptions of Python.

use std::fmt::Display;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use troupe_motion::read;

use crate::options::keyword;

pyo3::create_exception!(
    troupe_reader,
    ReadError,
    PyValueError,
    "A file that cannot be read: the message names the file, the place in it and the option that decides."
);

pyo3::create_exception!(
    troupe_reader,
    RetargetError,
    PyValueError,
    "Motion that cannot be carried over: the message names the joint or the pose, and what is allowed."
);

/// Motion that cannot be carried over.
pub(crate) fn unmapped(error: impl Display) -> PyErr {
    RetargetError::new_err(error.to_string())
}

/// A file that was refused, with the reader's own words.
pub(crate) fn refused(error: impl Display) -> PyErr {
    ReadError::new_err(error.to_string())
}

/// A file of motion that was refused, with the options that decide.
pub(crate) fn misread(py: Python<'_>, error: &read::ReadError) -> PyErr {
    let refused = refused(error);
    match set_options(py, &refused, &error.options()) {
        Ok(()) => refused,
        Err(other) => other,
    }
}

/// Sets the attribute `options`, which is empty in the class.
fn set_options(py: Python<'_>, error: &PyErr, choices: &[read::Choice]) -> PyResult<()> {
    let mut options = Vec::new();
    for choice in choices {
        let option = PyDict::new(py);
        option.set_item("option", keyword(choice.option))?;
        option.set_item("values", &choice.values)?;
        options.push(option);
    }
    error.value(py).setattr("options", options)
}

/// An argument that is not accepted.
pub(crate) fn wrong(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

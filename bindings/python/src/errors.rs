//! Errors of the reader as exceptions of Python.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

pyo3::create_exception!(
    troupe_reader,
    ReadError,
    PyValueError,
    "A file that cannot be read: the message names the file, the place in it and the option that decides."
);

/// A file that was refused, with the reader's own words.
pub(crate) fn refused(error: impl Display) -> PyErr {
    ReadError::new_err(error.to_string())
}

/// An argument that is not accepted.
pub(crate) fn wrong(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

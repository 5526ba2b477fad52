//! Reading files, and what the files of a folder agree on.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use troupe_motion::read as reader;

use crate::clip::Clip;
use crate::errors::{misread, refused, wrong};
use crate::files::{File, at};
use crate::options::options;

/// Reads one file.
#[pyfunction]
#[pyo3(signature = (source, *, name = None, beside = None, **given))]
pub(crate) fn read(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    name: Option<String>,
    beside: Option<HashMap<String, Vec<u8>>>,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Clip> {
    let options = options(given)?;
    let file = File::of(source, name, beside)?;
    let understood = py.detach(|| file.with_source(|source| reader::read(source, &options)));
    Ok(Clip::of(understood.map_err(|error| misread(py, &error))?))
}

/// Names of a file's animations.
#[pyfunction]
#[pyo3(signature = (source, *, name = None, beside = None))]
pub(crate) fn animations(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    name: Option<String>,
    beside: Option<HashMap<String, Vec<u8>>>,
) -> PyResult<Vec<String>> {
    let file = File::of(source, name, beside)?;
    let names = py.detach(|| file.with_source(reader::animations));
    names.map_err(refused)
}

/// What the files of a folder agree on.
#[pyclass(frozen, module = "troupe_reader")]
pub(crate) struct Agreement {
    agreement: reader::Agreement,
    /// Why files were refused, by their paths.
    refused: BTreeMap<String, String>,
}

impl Agreement {
    pub(crate) fn inner(&self) -> &reader::Agreement {
        &self.agreement
    }
}

#[pymethods]
impl Agreement {
    /// What `__getnewargs__` gives: an agreement goes to other processes.
    #[new]
    fn new(agreement: &str, refused: BTreeMap<String, String>) -> PyResult<Self> {
        Ok(Self {
            agreement: serde_json::from_str(agreement).map_err(wrong)?,
            refused,
        })
    }

    fn __getnewargs__(&self) -> PyResult<(String, BTreeMap<String, String>)> {
        let agreement = serde_json::to_string(&self.agreement).map_err(wrong)?;
        Ok((agreement, self.refused.clone()))
    }

    #[getter]
    fn up(&self) -> Option<&'static str> {
        self.agreement.up().map(reader::Up::name)
    }

    #[getter]
    fn unit_m(&self) -> Option<f64> {
        self.agreement.unit_m()
    }

    #[getter]
    fn refused(&self) -> BTreeMap<String, String> {
        self.refused.clone()
    }
}

/// Looks at files of one origin. One that cannot be read is noted and does not stop the others.
#[pyfunction]
#[pyo3(signature = (paths, **given))]
pub(crate) fn survey(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Agreement> {
    let options = options(given)?;
    let mut found = Agreement {
        agreement: reader::Agreement::default(),
        refused: BTreeMap::new(),
    };
    for path in paths {
        py.check_signals()?;
        let file = File::open(&path).map_err(|error| at(&path, error))?;
        let agreement = &mut found.agreement;
        let seen = py.detach(|| file.with_source(|source| reader::survey(source, &options, agreement)));
        if let Err(error) = seen {
            found
                .refused
                .insert(path.display().to_string(), error.kind.to_string());
        }
    }
    Ok(found)
}

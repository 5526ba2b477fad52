//! The reader, kinematics and robots of `troupe-motion` for Python: `troupe_reader._native`.
//!
//! `troupe_reader/_native.pyi` has the types and documents them. Arrays are float32, axes are
//! Troupe's, and quaternions are (w, x, y, z). Work of any length lets other threads of Python run.

mod arrays;
mod clip;
mod errors;
mod figure;
mod files;
mod options;
mod read;
mod robot;
mod skeleton;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use troupe_motion::read::{ENDINGS, ROBOT_ENDINGS};

#[pymodule(gil_used = false)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let error = module.py().get_type::<errors::ReadError>();
    error.setattr("options", PyTuple::empty(module.py()))?;
    module.add("ReadError", error)?;
    module.add("RetargetError", module.py().get_type::<errors::RetargetError>())?;
    for (name, endings) in [("ENDINGS", &ENDINGS[..]), ("ROBOT_ENDINGS", &ROBOT_ENDINGS[..])] {
        let endings = endings.iter().map(|ending| format!(".{ending}"));
        let endings: Vec<String> = endings.collect();
        module.add(name, PyTuple::new(module.py(), endings)?)?;
    }
    module.add_class::<clip::Clip>()?;
    module.add_class::<figure::Figure>()?;
    module.add_class::<read::Agreement>()?;
    module.add_class::<robot::RobotDescription>()?;
    module.add_class::<skeleton::Skeleton>()?;
    module.add_function(wrap_pyfunction!(read::animations, module)?)?;
    module.add_function(wrap_pyfunction!(read::read, module)?)?;
    module.add_function(wrap_pyfunction!(read::survey, module)?)?;
    module.add_function(wrap_pyfunction!(robot::read_robot, module)?)?;
    Ok(())
}

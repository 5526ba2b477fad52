//! Options of the reader as keyword arguments.

use std::sync::Arc;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use troupe_motion::read::units::metres_of;
use troupe_motion::read::{
    AngleUnit, JointOrder, LeadingPose, OptionName, Options, QuaternionOrder, RestPose, Up,
};

use crate::errors::wrong;
use crate::read::Agreement;
use crate::skeleton::Skeleton;

/// The options that keyword arguments give. `None` leaves an option as it is.
pub(crate) fn options(given: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    let mut options = Options::default();
    for (key, value) in given.into_iter().flatten() {
        let key: String = key.extract()?;
        if !value.is_none() {
            set(&mut options, &key, &value)?;
        }
    }
    Ok(options)
}

fn set(options: &mut Options, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    match key {
        "up" => options.up = Some(named(OptionName::Up, value, Up::of_name)?),
        "unit" => options.unit_m = Some(unit(value)?),
        "fps" => options.fps = Some(value.extract()?),
        "resample_fps" => options.resample_fps = Some(value.extract()?),
        "animation" => options.animation = Some(value.extract()?),
        "root" => options.root = Some(value.extract()?),
        "rest_pose" => {
            options.rest_pose = Some(named(OptionName::RestPose, value, RestPose::of_name)?);
        }
        "leading_pose" => {
            options.leading_pose = named(OptionName::LeadingPose, value, LeadingPose::of_name)?;
        }
        "max_slide_m" => options.max_slide_m = Some(value.extract()?),
        "strip_namespaces" => options.strip_namespaces = value.extract()?,
        "skeleton" => {
            options.skeleton = Some(Arc::clone(value.cast::<Skeleton>()?.get().inner()));
        }
        "other_bones" => options.other_bones = value.extract()?,
        "quaternion" => {
            options.quaternion = Some(named(OptionName::Quaternion, value, QuaternionOrder::of_name)?);
        }
        "degrees" => {
            options.angles = Some(match value.extract::<bool>()? {
                true => AngleUnit::Degrees,
                false => AngleUnit::Radians,
            });
        }
        "joint_order" => options.joint_order = Some(joint_order(value)?),
        "agreement" => {
            options.agreement = Some(value.cast::<Agreement>()?.get().inner().clone());
        }
        _ => return Err(PyTypeError::new_err(format!("there is no option {key:?}"))),
    }
    Ok(())
}

fn named<T>(option: OptionName, value: &Bound<'_, PyAny>, of_name: fn(&str) -> Option<T>) -> PyResult<T> {
    let name: String = value.extract()?;
    of_name(&name).ok_or_else(|| {
        let allowed = option.values().join(", ");
        wrong(format!("{} is {name:?}; allowed: {allowed}", option.name()))
    })
}

/// Metres a unit, from a number or the unit's name.
fn unit(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    if let Ok(metres) = value.extract::<f64>() {
        return Ok(metres);
    }
    let name: String = value.extract()?;
    metres_of(&name).ok_or_else(|| {
        let names = OptionName::Unit.values().join(", ");
        wrong(format!("unit is {name:?}; allowed: metres a unit, or {names}"))
    })
}

/// `tree`, `isaaclab`, or the names of the hinges' joints.
fn joint_order(value: &Bound<'_, PyAny>) -> PyResult<JointOrder> {
    if let Ok(name) = value.extract::<String>() {
        return Ok(JointOrder::of_name(&name));
    }
    Ok(JointOrder::Named(value.extract()?))
}

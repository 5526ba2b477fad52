//! Checks that a graph's tensors have the shapes that its pack's sizes require.

use ort::value::{Outlet, TensorElementType, ValueType};

use troupe_motion::model::Dims;

use crate::pack::Stage;
use crate::specs::{StageTensors as _, TensorSpec, TensorType};

/// Compares a stage's tensors with the shapes that the pack's sizes require. Further outputs are
/// allowed.
pub(super) fn check_signature(
    dims: &Dims,
    stage: Stage,
    inputs: &[Outlet],
    outputs: &[Outlet],
) -> Result<(), String> {
    let (wanted_inputs, wanted_outputs) = (dims.inputs(stage), dims.outputs(stage));
    for spec in &wanted_inputs {
        check_outlet("input", spec, inputs)?;
    }
    for spec in &wanted_outputs {
        check_outlet("output", spec, outputs)?;
    }
    match inputs
        .iter()
        .find(|outlet| !wanted_inputs.iter().any(|spec| spec.name == outlet.name()))
    {
        Some(extra) => Err(format!("unknown input {}", extra.name())),
        None => Ok(()),
    }
}

/// Whether every time axis among a stage's inputs is open.
pub(super) fn takes_any_length(dims: &Dims, stage: Stage, inputs: &[Outlet]) -> bool {
    let mut over_time = dims.inputs(stage).into_iter().filter(|spec| spec.open_time);
    over_time.all(|spec| {
        inputs.iter().filter(|outlet| outlet.name() == spec.name).all(
            |outlet| matches!(outlet.dtype(), ValueType::Tensor { shape, .. } if shape.get(1) == Some(&-1)),
        )
    })
}

fn check_outlet(kind: &str, spec: &TensorSpec, outlets: &[Outlet]) -> Result<(), String> {
    let name = spec.name;
    let outlet = outlets
        .iter()
        .find(|outlet| outlet.name() == name)
        .ok_or(format!("the {kind} {name} is missing"))?;
    let ValueType::Tensor { ty, shape, .. } = outlet.dtype() else {
        return Err(format!("the {kind} {name} is no tensor"));
    };
    let wanted_type = match spec.ty {
        TensorType::F32 => TensorElementType::Float32,
        TensorType::I64 => TensorElementType::Int64,
    };
    if *ty != wanted_type {
        return Err(format!(
            "the {kind} {name} has elements of {ty:?}, expected {wanted_type:?}"
        ));
    }
    // An exporter may leave an output's axes open (-1); every run checks its length.
    let open = |index: usize| kind == "output" || (index == 0 && spec.open_time);
    let fits = shape.len() == spec.shape.len() + 1
        && shape[0] == -1
        && shape[1..]
            .iter()
            .zip(&spec.shape)
            .enumerate()
            .all(|(index, (&axis, &wanted))| axis == wanted as i64 || (axis == -1 && open(index)));
    if !fits {
        let wanted: Vec<String> = spec.shape.iter().map(usize::to_string).collect();
        return Err(format!(
            "the {kind} {name} has the shape {shape:?}, expected [batch, {}] with a free batch axis",
            wanted.join(", ")
        ));
    }
    Ok(())
}

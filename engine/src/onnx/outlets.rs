//! Checks that a graph's tensors are those of its pack's contract, for graphs that are described by
//! lists.

use ort::value::{Outlet, TensorElementType, ValueType};

/// Marks an axis whose length may differ from call to call.
pub(super) const OPEN: i64 = -1;

/// A tensor: name, type of the elements, axes.
pub(super) type Wanted<'a> = (&'a str, TensorElementType, &'a [i64]);

/// Compares a graph's tensors with the expected ones. Further outputs are allowed.
pub(super) fn check(
    wanted: (&[Wanted<'_>], &[Wanted<'_>]),
    inputs: &[Outlet],
    outputs: &[Outlet],
) -> Result<(), String> {
    for tensor in wanted.0 {
        check_outlet("input", tensor, inputs)?;
    }
    let is_known = |input: &&Outlet| wanted.0.iter().any(|(name, ..)| *name == input.name());
    if let Some(extra) = inputs.iter().find(|input| !is_known(input)) {
        return Err(format!("unknown input {}", extra.name()));
    }
    for tensor in wanted.1 {
        check_outlet("output", tensor, outputs)?;
    }
    Ok(())
}

/// The axes of a graph's tensor; none for anything else.
pub(super) fn axes(outlet: &Outlet) -> &[i64] {
    match outlet.dtype() {
        ValueType::Tensor { shape, .. } => shape,
        _ => &[],
    }
}

fn check_outlet(kind: &str, &(name, element, axes): &Wanted<'_>, outlets: &[Outlet]) -> Result<(), String> {
    let outlet = outlets.iter().find(|outlet| outlet.name() == name);
    let outlet = outlet.ok_or_else(|| format!("the {kind} {name} is missing"))?;
    let ValueType::Tensor { ty, shape, .. } = outlet.dtype() else {
        return Err(format!("the {kind} {name} is no tensor"));
    };
    // An exporter may leave an output's axes open; every run checks its length.
    let fits = |(&found, &wanted): (&i64, &i64)| found == wanted || (found == OPEN && kind == "output");
    if *ty != element || shape.len() != axes.len() || !shape.iter().zip(axes).all(fits) {
        return Err(format!(
            "the {kind} {name} is {ty:?} {shape:?}, expected {element:?} {axes:?} with open axes of -1"
        ));
    }
    Ok(())
}

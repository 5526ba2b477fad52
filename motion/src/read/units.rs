//! Units of length of files.

/// A unit that programs write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    /// As written on a command line.
    pub(super) name: &'static str,
    pub(super) metres: f64,
}

const fn unit(name: &'static str, metres: f64) -> Unit {
    Unit { name, metres }
}

/// The units that files have, the largest first. CMU's is 1/0.45 of an inch, as its AMC files say.
pub(super) const UNITS: [Unit; 7] = [
    unit("m", 1.0),
    unit("ft", 0.3048),
    unit("dm", 0.1),
    unit("cmu", 0.0254 / 0.45),
    unit("in", 0.0254),
    unit("cm", 0.01),
    unit("mm", 0.001),
];
/// Metres, and what programs that work in other metric units write instead of them.
pub(super) const METRIC_UNITS: [Unit; 3] = [UNITS[0], UNITS[5], UNITS[6]];
/// Centimetres, in which most BVH files are.
pub(super) const CENTIMETRE_M: f64 = 0.01;

/// Metres a unit of this name, in any case.
pub fn metres_of(name: &str) -> Option<f64> {
    let named = UNITS.iter().find(|unit| unit.name.eq_ignore_ascii_case(name));
    named.map(|unit| unit.metres)
}

/// Names of all units, as an option takes them.
pub fn names() -> String {
    UNITS.map(|unit| unit.name).join(", ")
}

/// Name of a unit, or its length.
pub(super) fn name_of(metres: f64) -> String {
    let named = UNITS
        .iter()
        .find(|unit| (unit.metres / metres - 1.0).abs() < 1e-3);
    match named {
        Some(unit) => unit.name.to_owned(),
        None => format!("{metres} m"),
    }
}

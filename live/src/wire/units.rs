//! Checks and conversions of single values.

use troupe_motion::conventions::Convention;
use troupe_motion::rotation::to_wxyz;
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;

use super::{MAX_PROMPT_CHARS, Measure};
use troupe_character::{FieldError, Path};

/// Maximum length of the name of a session or an upload, characters.
pub(crate) const MAX_NAME_CHARS: usize = 64;
/// Maximum heading in both directions, radians. Beyond it, a 32-bit float is too coarse.
pub(crate) const MAX_HEADING: f32 = 1000.0;

/// Reads the convention of a message.
pub fn convention(path: &Path<'_>, value: i32) -> Result<Convention, FieldError> {
    match v1::Convention::try_from(value) {
        Ok(v1::Convention::Native) => Ok(Convention::Native),
        Ok(v1::Convention::Unreal) => Ok(Convention::Unreal),
        Ok(v1::Convention::Unity) => Ok(Convention::Unity),
        Ok(v1::Convention::Ros) => Ok(Convention::Ros),
        Err(_) => Err(path.error(
            format!("is {value}"),
            "CONVENTION_NATIVE (0), CONVENTION_UNREAL (1), CONVENTION_UNITY (2) or CONVENTION_ROS (3)",
        )),
    }
}

/// The value of a convention in messages.
pub(crate) fn convention_name(convention: Convention) -> v1::Convention {
    match convention {
        Convention::Native => v1::Convention::Native,
        Convention::Unreal => v1::Convention::Unreal,
        Convention::Unity => v1::Convention::Unity,
        Convention::Ros => v1::Convention::Ros,
    }
}

/// Checks a sentence to act out: 1 to [`MAX_PROMPT_CHARS`] characters, not all of them blank.
pub fn sentence(path: &Path<'_>, text: &str) -> Result<(), FieldError> {
    let allowed = format!("1 to {MAX_PROMPT_CHARS} characters");
    if text.trim().is_empty() {
        return Err(path.error("is empty", allowed));
    }
    match text.chars().count() {
        count if count > MAX_PROMPT_CHARS => Err(path.error(format!("has {count} characters"), allowed)),
        _ => Ok(()),
    }
}

/// Whether a text may name a session or an upload: 1 to [`MAX_NAME_CHARS`] letters, digits, `-`,
/// `_` or `.`.
pub(crate) fn is_name(text: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    (1..=MAX_NAME_CHARS).contains(&text.len()) && text.chars().all(fits)
}

/// Checks the name of an upload, which also names its file.
pub(crate) fn named<'a>(path: &Path<'_>, text: &'a str) -> Result<&'a str, FieldError> {
    match is_name(text) && !text.starts_with('.') {
        true => Ok(text),
        false => {
            let start: String = text.chars().take(MAX_NAME_CHARS).collect();
            Err(path.error(
                format!("is {start:?}"),
                format!("1 to {MAX_NAME_CHARS} letters, digits, '-', '_' or '.', without a dot in front"),
            ))
        }
    }
}

/// Checks a number, which must be from `low` to `high`.
pub fn within(path: &Path<'_>, value: f32, low: f32, high: f32) -> Result<f32, FieldError> {
    match (low..=high).contains(&value) {
        true => Ok(value),
        false => Err(path.error(format!("is {value}"), format!("{low} to {high}"))),
    }
}

/// Checks a length or speed, which must be from `low` to `high`, metres or m/s. The error has the
/// caller's.
pub fn metres_within(path: &Path<'_>, value: f32, low: f32, high: f32) -> Result<f32, FieldError> {
    let said = |value: f32| path.metres(value);
    within(path, said(value), said(low), said(high)).map(|_| value)
}

/// Checks a priority, which must be from 0 to 1.
pub fn priority(path: &Path<'_>, value: f32) -> Result<f32, FieldError> {
    within(path, value, 0.0, 1.0)
}

/// Checks a whole number, which must be from `low` to `high`.
pub fn count_within(path: &Path<'_>, value: u32, low: u32, high: u32) -> Result<u32, FieldError> {
    match (low..=high).contains(&value) {
        true => Ok(value),
        false => Err(path.error(format!("is {value}"), format!("{low} to {high}"))),
    }
}

/// Checks a heading in the convention of `measure` and makes it native.
pub fn heading(path: &Path<'_>, value: f32, measure: impl Into<Measure>) -> Result<f32, FieldError> {
    within(path, value, -MAX_HEADING, MAX_HEADING).map(|value| measure.into().heading_to_native(value))
}

/// Checks a vector in the convention of `measure` and makes it native. Each of its numbers must be
/// from -`limit` to `limit`, in metres or metres per second of the character.
pub fn vector(
    path: &Path<'_>,
    value: v1::Vec3,
    limit: f32,
    measure: impl Into<Measure>,
) -> Result<Vec3, FieldError> {
    let measure = measure.into();
    let limit = limit * measure.units_per_metre();
    for (name, value) in [("x", value.x), ("y", value.y), ("z", value.z)] {
        within(&path.field(name), value, -limit, limit)?;
    }
    Ok(measure.position_to_native(Vec3::new(value.x, value.y, value.z)))
}

/// Name of the axis that points up.
pub(crate) fn up_axis(convention: Convention) -> &'static str {
    match convention {
        Convention::Native | Convention::Unity => "y",
        Convention::Unreal | Convention::Ros => "z",
    }
}

/// Converts a native position to the convention of `measure`.
pub fn position(value: Vec3, measure: impl Into<Measure>) -> v1::Vec3 {
    let Vec3 { x, y, z } = measure.into().position_from_native(value);
    v1::Vec3 { x, y, z }
}

/// Converts a native rotation to `convention`.
pub(crate) fn quat(rotation: Quat, convention: Convention) -> v1::Quat {
    let [w, x, y, z] = to_wxyz(convention.rotation_from_native(rotation));
    v1::Quat { w, x, y, z }
}

/// Checks the length of a list, which must be from `low` to `high`.
pub fn length(path: &Path<'_>, found: usize, low: usize, high: usize) -> Result<(), FieldError> {
    match found {
        _ if (low..=high).contains(&found) => Ok(()),
        0 => Err(path.error("is empty", format!("{low} to {high}"))),
        _ => Err(path.error(format!("has {found} entries"), format!("{low} to {high}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_give_ranges_in_the_sessions_unit() {
        let root = Path::root();
        let path = root.field("velocity");
        let far = v1::Vec3 {
            x: 0.0,
            y: 150_000.0,
            z: 0.0,
        };
        let error = vector(&path, far, 1000.0, Convention::Unreal).unwrap_err();
        assert_eq!(
            (error.field.as_str(), error.allowed.as_str()),
            ("velocity.y", "-100000 to 100000")
        );
        assert!(vector(&path, far, 1500.0, Convention::Unreal).is_ok());
    }

    #[test]
    fn values_that_are_not_finite_are_in_no_range() {
        let root = Path::root();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(within(&root, bad, -1.0, 1.0).is_err());
            assert!(heading(&root, bad, Convention::Unity).is_err());
        }
    }

    #[test]
    fn the_up_axis_is_the_one_that_native_up_becomes() {
        for convention in Convention::ALL {
            let up = convention.direction_from_native(Vec3::Y);
            let name = if up.y == 1.0 { "y" } else { "z" };
            assert_eq!(up_axis(convention), name);
            assert_eq!(up.element_sum(), 1.0);
        }
    }

    #[test]
    fn conventions_come_back() {
        for this in Convention::ALL {
            let number = i32::from(convention_name(this));
            assert_eq!(convention(&Path::root(), number).unwrap(), this);
        }
        assert!(convention(&Path::root(), 4).is_err());
    }
}

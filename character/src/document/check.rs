//! Checks of single values. Every error names the field and what is allowed.

use std::collections::HashSet;

use troupe_motion::rotation::from_wxyz;
use troupe_motion::{Quat, Vec3};

use crate::limits::UNIT_TOLERANCE;
use crate::{FieldError, Path};

/// Most characters of a name. Allowed: letters, digits, '-', '_' and '.'.
pub const MAX_NAME_CHARS: usize = 64;
/// Most names that an error message lists.
const MAX_LISTED: usize = 40;

/// Checks a format number against the only one that is supported.
pub fn format(path: &Path<'_>, found: u32, version: u32) -> Result<(), FieldError> {
    if found == version {
        return Ok(());
    }
    Err(path
        .field("format")
        .error(format!("is {found}"), version.to_string()))
}

/// Checks the characters and the length of a name.
pub fn name(path: &Path<'_>, name: &str) -> Result<(), FieldError> {
    let allowed =
        || format!("1 to {MAX_NAME_CHARS} letters, digits, '-', '_' or '.', not beginning with '.'");
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match (name.chars().count(), name.chars().find(|&c| !fits(c))) {
        (0, _) => Err(path.error("is empty", allowed())),
        _ if name.starts_with('.') => Err(path.error("starts with '.'", allowed())),
        (found, _) if found > MAX_NAME_CHARS => Err(path.error(format!("has {found} characters"), allowed())),
        (_, Some(c)) => Err(path.error(format!("has the character {c:?}"), allowed())),
        _ => Ok(()),
    }
}

/// Checks that the entries of a list differ in what `key` gives: their names or ids, which each has
/// in its field `field`.
pub fn unique<'a, T>(
    path: &Path<'_>,
    list_field: &'static str,
    list: &'a [T],
    field: &'static str,
    key: impl Fn(&'a T) -> &'a str,
) -> Result<(), FieldError> {
    let mut seen = HashSet::with_capacity(list.len());
    match list
        .iter()
        .map(key)
        .enumerate()
        .find(|(_, key)| !seen.insert(*key))
    {
        Some((index, key)) => Err(path.element(list_field, index).field(field).error(
            format!("is {key:?}, which another of the {list_field} has"),
            format!("{field}s that are all different"),
        )),
        None => Ok(()),
    }
}

/// Checks the number of entries, and that their names are valid and differ. Gives each entry with
/// its place.
pub fn named<'a, T>(
    path: &'a Path<'a>,
    field: &'static str,
    list: &'a [T],
    low: usize,
    high: usize,
    name_of: impl Fn(&'a T) -> &'a str,
) -> Result<impl Iterator<Item = (Path<'a>, &'a T)>, FieldError> {
    entries(&path.field(field), list.len(), low, high)?;
    for (index, one) in list.iter().enumerate() {
        name(&path.element(field, index).field("name"), name_of(one))?;
    }
    unique(path, field, list, "name", name_of)?;
    let places = move |(index, one)| (path.element(field, index), one);
    Ok(list.iter().enumerate().map(places))
}

/// Checks the number of entries of a list.
pub fn entries(path: &Path<'_>, found: usize, low: usize, high: usize) -> Result<(), FieldError> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(path.error(format!("has {found} entries"), format!("{low} to {high}")))
}

/// Checks a number against its range. NaN is outside every range.
pub fn number(path: &Path<'_>, value: f32, low: f32, high: f32) -> Result<(), FieldError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(path.error(format!("is {value}"), format!("{low} to {high}")))
}

/// Checks a whole number against its range.
pub fn count(path: &Path<'_>, value: u32, low: u32, high: u32) -> Result<(), FieldError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(path.error(format!("is {value}"), format!("{low} to {high}")))
}

/// Checks each component of a vector.
pub fn vector(path: &Path<'_>, field: &'static str, value: [f32; 3], limit: f32) -> Result<Vec3, FieldError> {
    for (axis, &component) in value.iter().enumerate() {
        number(&path.element(field, axis), component, -limit, limit)?;
    }
    Ok(Vec3::from(value))
}

/// Checks that a rotation has unit length, and makes it exactly 1. `what` begins the message.
pub fn rotation(path: &Path<'_>, wxyz: [f32; 4], what: &str) -> Result<Quat, FieldError> {
    let rotation = from_wxyz(wxyz);
    let length = rotation.length();
    let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
    // Rejects NaN and infinity too.
    if (low..=high).contains(&length) {
        return Ok(rotation / length);
    }
    Err(path.error(
        format!("{what} has length {length}"),
        format!("unit length, {low} to {high}"),
    ))
}

/// Names with commas between them, as many as fit into an error message; `none` if there are none.
pub fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.into_iter().collect();
    if names.is_empty() {
        return "none".to_owned();
    }
    let shown = names[..names.len().min(MAX_LISTED)].join(", ");
    match names.len().checked_sub(MAX_LISTED) {
        Some(more @ 1..) => format!("{shown} and {more} more"),
        _ => shown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_no_dot_first() {
        let check = |text: &str| name(&Path::root().field("name"), text);
        for good in ["a", "a.b", "a..b", "A-1_2."] {
            assert!(check(good).is_ok(), "{good}");
        }
        for bad in ["", ".", "..", ".hidden", "a/b", "a b", "é"] {
            let error = check(bad).unwrap_err().to_string();
            assert!(
                error.starts_with("name: ") && error.contains("not beginning with '.'"),
                "{error}"
            );
        }
    }
}

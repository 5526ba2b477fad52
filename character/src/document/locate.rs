//! Finds a field in a text: from a path such as `sets[1].keyframes[0].height_m` to an offset. The
//! text is parsed again, but only to report an error.

use std::collections::HashMap;
use std::ops::Range;

use serde_json::value::RawValue;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One step of a path: a field's name or an index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

/// The steps of a path, up to the first that is not understood.
fn steps(path: &str) -> impl Iterator<Item = Step<'_>> {
    path.split('.').filter(|part| !part.is_empty()).flat_map(|part| {
        let (key, rest) = part.split_once('[').map_or((part, ""), |(key, rest)| (key, rest));
        let indices = rest
            .split('[')
            .map_while(|index| index.strip_suffix(']')?.parse().ok());
        let key = (!key.is_empty()).then_some(Step::Key(key));
        key.into_iter().chain(indices.map(Step::Index))
    })
}

/// Line and column of an offset, both from 1. Columns count characters.
pub(super) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (line, before[start..].chars().count() + 1)
}

/// The offset of the field in a TOML text. If it is missing, that of the nearest table that should
/// hold it.
pub(super) fn in_toml(text: &str, path: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut steps = steps(path);
    let Some(Step::Key(key)) = steps.next() else {
        return None;
    };
    let mut at = root.get_ref().get(key)?;
    for step in steps {
        let inner: Option<&Spanned<DeValue<'_>>> = match (step, at.get_ref()) {
            (Step::Key(key), DeValue::Table(table)) => table.get(key),
            (Step::Index(index), DeValue::Array(array)) => array.get(index),
            _ => None,
        };
        match inner {
            Some(inner) => at = inner,
            None => break,
        }
    }
    let Range { start, .. } = at.span();
    Some(start)
}

/// As [`in_toml`], for JSON.
pub(super) fn in_json(text: &str, path: &str) -> Option<usize> {
    let mut at: &RawValue = serde_json::from_str(text).ok()?;
    for step in steps(path) {
        let inner: Option<&RawValue> = match step {
            Step::Key(key) => serde_json::from_str::<HashMap<String, &RawValue>>(at.get())
                .ok()
                .and_then(|mut object| object.remove(key)),
            Step::Index(index) => serde_json::from_str::<Vec<&RawValue>>(at.get())
                .ok()
                .and_then(|array| array.get(index).copied()),
        };
        match inner {
            Some(inner) => at = inner,
            None => break,
        }
    }
    // Raw values borrow from the text, so pointers give the offset.
    (at.get().as_ptr() as usize).checked_sub(text.as_ptr() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_split_into_steps() {
        let found: Vec<_> = steps("sets[1].keyframes[0].points_m[3][2]").collect();
        let want = [
            Step::Key("sets"),
            Step::Index(1),
            Step::Key("keyframes"),
            Step::Index(0),
            Step::Key("points_m"),
            Step::Index(3),
            Step::Index(2),
        ];
        assert_eq!(found, want);
        assert_eq!(steps("").count(), 0);
        assert_eq!(
            steps("a[x].b").collect::<Vec<_>>(),
            [Step::Key("a"), Step::Key("b")]
        );
    }

    #[test]
    fn fields_are_found_in_toml() {
        let text = "name = \"é\"\n[shape.box]\nhalf_extents_m = [1, 2,\n  3]\n\n[[sets]]\nname = \"a\"\n[[sets]]\n  name = \"b\"\n";
        let at = |path: &str| in_toml(text, path).map(|offset| line_and_column(text, offset));
        assert_eq!(at("name"), Some((1, 8)));
        assert_eq!(at("shape.box.half_extents_m[2]"), Some((4, 3)));
        assert_eq!(at("sets[1].name"), Some((9, 10)));
        assert_eq!(
            at("sets[1].frames").unwrap().0,
            8,
            "a missing field is located at its table"
        );
        assert_eq!(at("format"), None);
    }

    #[test]
    fn fields_are_found_in_json() {
        let text = "{\n \"é\": 1, \"sets\": [\n  {\"name\": \"a\"},\n  {\"name\":\n \"b\"}]}";
        let at = |path: &str| in_json(text, path).map(|offset| line_and_column(text, offset));
        assert_eq!(at("sets[0].name"), Some((3, 12)));
        assert_eq!(at("sets[1].name"), Some((5, 2)));
        assert_eq!(at("sets[1].frames"), Some((4, 3)));
        assert_eq!(at("format"), Some((1, 1)));
    }
}

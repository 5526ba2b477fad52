//! Styles as files: the JSON form of the wire's message, short and with a line a keyframe.

use serde_json::Value;
use troupe_proto::v1;

/// Digits after the point: 0.01 mm, 0.001 degrees.
const DIGITS: i32 = 5;

/// Writes a style for a file. Gaits and keyframes are lines of their own, so that changes can be
/// read.
pub(super) fn to_file(style: &v1::Style) -> Result<String, serde_json::Error> {
    let mut style = serde_json::to_value(style)?;
    round(&mut style);
    let mut text = String::new();
    write(&style, 0, &mut text);
    text.push('\n');
    Ok(text)
}

/// Rounds all numbers that are not whole.
fn round(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(round),
        Value::Object(fields) => fields.values_mut().for_each(round),
        Value::Number(number) if number.is_f64() => {
            let scale = 10_f64.powi(DIGITS);
            let rounded = number.as_f64().map(|n| (n * scale).round() / scale + 0.0);
            if let Some(number) = rounded.and_then(serde_json::Number::from_f64) {
                *value = Value::Number(number);
            }
        }
        _ => {}
    }
}

/// Fields and list entries on lines of their own, down to those that hold numbers alone or are a
/// keyframe.
fn write(value: &Value, depth: usize, text: &mut String) {
    let indent = "  ".repeat(depth + 1);
    let (open, close, lines) = match value {
        Value::Object(fields) if fields.values().any(is_list_of_objects) => {
            let lines: Vec<(String, &Value)> = fields.iter().map(|(k, v)| (format!("{k:?}: "), v)).collect();
            ('{', '}', lines)
        }
        Value::Array(values) if is_list_of_objects(value) => {
            ('[', ']', values.iter().map(|v| (String::new(), v)).collect())
        }
        plain => {
            text.push_str(&plain.to_string());
            return;
        }
    };
    text.push(open);
    for (nth, (label, value)) in lines.iter().enumerate() {
        text.push_str(if nth == 0 { "\n" } else { ",\n" });
        text.push_str(&indent);
        text.push_str(label);
        write(value, depth + 1, text);
    }
    text.push('\n');
    text.push_str(&"  ".repeat(depth));
    text.push(close);
}

fn is_list_of_objects(value: &Value) -> bool {
    value
        .as_array()
        .is_some_and(|values| values.first().is_some_and(Value::is_object))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style() -> v1::Style {
        let key = v1::GaitKey {
            rotations: vec![0.123_456_79, -0.000_000_4, 1.0, 0.0],
            height: 0.912_34,
            ..v1::GaitKey::default()
        };
        let gait = v1::Gait {
            name: "walk \"soft\"".to_owned(),
            keys: vec![key.clone(), key],
            key_count: 2,
            ..v1::Gait::default()
        };
        v1::Style {
            name: "calm".to_owned(),
            allowed_token_counts: vec![8, 9],
            gaits: vec![gait],
            ..v1::Style::default()
        }
    }

    #[test]
    fn a_keyframe_is_a_line() {
        let text = to_file(&style()).unwrap();
        let keys = text.lines().filter(|line| line.contains("rotations"));
        for key in keys.clone() {
            assert!(key.contains("[0.12346,0.0,1.0,0.0]"), "{key}");
        }
        assert_eq!(keys.count(), 2);
        assert!(text.ends_with("}\n"), "{text}");
    }

    #[test]
    fn what_is_written_is_read_again() {
        let read: v1::Style = serde_json::from_str(&to_file(&style()).unwrap()).unwrap();
        let mut wanted = style();
        for key in &mut wanted.gaits[0].keys {
            key.rotations = vec![0.123_46, 0.0, 1.0, 0.0];
        }
        assert_eq!(read, wanted);
    }

    #[test]
    fn a_style_without_gaits_is_one_line() {
        let text = to_file(&v1::Style::default()).unwrap();
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

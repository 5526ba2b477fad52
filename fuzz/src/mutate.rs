//! Changes that keep JSON valid and numbers readable. Changes of single bytes hardly ever get past
//! a reader of JSON.

use rand::seq::{IndexedRandom as _, IteratorRandom as _};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::SEPARATOR;

/// Numbers at or near the limits of readers and checks.
const NUMBERS: [&str; 18] = [
    "0",
    "1",
    "2",
    "3",
    "4",
    "9",
    "50",
    "60",
    "64",
    "120",
    "-1",
    "0.5",
    "1.5",
    "-0.001",
    "1000",
    "65536",
    "4294967295",
    "1e38",
];

/// A changed copy of an input, the same for the same seed. One or two changes each replace a number
/// or a word, or remove, repeat or move a part of its JSON.
pub fn mutate(bytes: &[u8], seed: u64) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut changed = bytes.to_vec();
    for _ in 0..random.random_range(1..3) {
        let next = match random.random_bool(0.5) {
            true => with_json(&changed, &mut random),
            false => None,
        };
        changed = next
            .or_else(|| with_token(&changed, &mut random))
            .unwrap_or(changed);
    }
    changed
}

/// Replaces a number or a word by another.
fn with_token(bytes: &[u8], random: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let part = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.+-".contains(byte);
    let mut tokens = Vec::new();
    let mut from = 0;
    for piece in bytes.chunk_by(|a, b| part(a) == part(b)) {
        if piece.first().is_some_and(part) {
            tokens.push(from..from + piece.len());
        }
        from += piece.len();
    }
    let token = tokens.choose(random)?.clone();
    let text = std::str::from_utf8(&bytes[token.clone()]).ok()?;
    let new = match text.parse::<f64>() {
        Ok(number) => match random.random_range(0..4) {
            0 => (number + 1.0).to_string(),
            1 => (number * 10.0).to_string(),
            2 => (-number).to_string(),
            _ => (*NUMBERS.choose(random)?).to_owned(),
        },
        Err(_) => String::from_utf8_lossy(&bytes[tokens.choose(random)?.clone()]).into_owned(),
    };
    let mut changed = bytes.to_vec();
    changed.splice(token, new.into_bytes());
    Some(changed)
}

/// Changes a part of one of the JSON texts of an input.
fn with_json(bytes: &[u8], random: &mut ChaCha8Rng) -> Option<Vec<u8>> {
    let starts = (0..bytes.len()).filter(|&at| bytes[at] == b'{' && (at < 2 || bytes[at - 1] == SEPARATOR));
    let from = starts.choose(random)?;
    let length = bytes[from..].iter().position(|&byte| byte == SEPARATOR);
    let to = length.map_or(bytes.len(), |length| from + length);
    let mut json: Value = serde_json::from_slice(&bytes[from..to]).ok()?;
    let donor = any_part(&json, random).clone();
    change(&mut json, donor, random);
    let mut changed = bytes.to_vec();
    changed.splice(from..to, serde_json::to_vec(&json).ok()?);
    Some(changed)
}

fn any_part<'a>(json: &'a Value, random: &mut ChaCha8Rng) -> &'a Value {
    let inner = match json {
        Value::Array(all) => all.choose(random),
        Value::Object(all) => all.values().choose(random),
        _ => None,
    };
    match inner {
        Some(inner) if random.random_bool(0.8) => any_part(inner, random),
        _ => json,
    }
}

fn change(json: &mut Value, donor: Value, random: &mut ChaCha8Rng) {
    let deeper = random.random_bool(0.75);
    match json {
        Value::Array(all) if !all.is_empty() => {
            let at = random.random_range(0..all.len());
            match random.random_range(0..3) {
                _ if deeper => change(&mut all[at], donor, random),
                0 => drop(all.remove(at)),
                1 => all.insert(at, all[at].clone()),
                _ => all.insert(at, donor),
            }
        }
        Value::Object(all) if !all.is_empty() => {
            let Some(name) = all.keys().choose(random).cloned() else {
                return;
            };
            match all.get_mut(&name) {
                Some(value) if deeper => change(value, donor, random),
                _ => drop(all.remove(&name)),
            }
        }
        Value::Number(_) if deeper => {
            let number = NUMBERS
                .choose(random)
                .and_then(|text| serde_json::from_str(text).ok());
            *json = number.unwrap_or_default();
        }
        Value::Bool(set) => *set = !*set,
        _ => *json = donor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_changes_leave_json_readable_and_none_repeats_the_input() {
        let text = br#"{"a": [1, 2.5, {"b": "word", "c": true}], "d": {"e": -3}}"#;
        let changed: Vec<_> = (0..1000).map(|seed| mutate(text, seed)).collect();
        let readable = changed
            .iter()
            .filter(|bytes| serde_json::from_slice::<Value>(bytes).is_ok());
        assert!(readable.count() > 500);
        assert_eq!(mutate(text, 7), mutate(text, 7));
        assert!(changed.iter().filter(|bytes| bytes.as_slice() != text).count() > 900);
    }

    #[test]
    fn texts_without_json_get_other_tokens() {
        let changed = mutate(b"Frames: 2\n0.5 90", 3);
        assert!(changed.starts_with(b"Frames") || changed.len() > 5, "{changed:?}");
        assert_eq!(mutate(b"", 1), b"");
        assert_eq!(mutate(&[0xff, 0x00], 1), [0xff, 0x00]);
    }
}

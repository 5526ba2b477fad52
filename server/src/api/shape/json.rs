//! Finds the list at fault in a JSON body that has too many parts.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use troupe_proto::rpc::Step;

use super::{Limit, Rule};

/// The first list with more entries than it may have: its path and its limit. None if there is none
/// before the body ends or stops to be JSON.
pub(super) fn too_long(body: &[u8], rules: &[Rule]) -> Option<(String, Limit)> {
    let mut found = None;
    let place = Place {
        path: String::new(),
        most: None,
        below: rules.iter().map(|rule| (rule.limit, rule.steps)).collect(),
        found: &mut found,
    };
    // What is no JSON is for the decoder to say.
    let _ = place.deserialize(&mut serde_json::Deserializer::from_slice(body));
    found
}

/// A value of the body.
struct Place<'a> {
    /// Empty for the whole body.
    path: String,
    /// How many entries it may have, if it is a list.
    most: Option<Limit>,
    /// The lists below it, with the steps to them.
    below: Vec<(Limit, &'static [Step])>,
    found: &'a mut Option<(String, Limit)>,
}

impl<'de> DeserializeSeed<'de> for Place<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<(), D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Place<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(name) = map.next_key::<String>()? {
            let mut most = None;
            let mut below = Vec::new();
            for (limit, steps) in &self.below {
                match steps {
                    [step] if step.name == name => most = Some(*limit),
                    [step, deeper @ ..] if step.name == name => below.push((*limit, deeper)),
                    _ => {}
                }
            }
            if most.is_none() && below.is_empty() {
                map.next_value::<IgnoredAny>()?;
                continue;
            }
            let dot = if self.path.is_empty() { "" } else { "." };
            map.next_value_seed(Place {
                path: format!("{}{dot}{name}", self.path),
                most,
                below,
                found: &mut *self.found,
            })?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        for index in 0.. {
            let is_full = self.most.filter(|limit| index >= limit.most);
            if is_full.is_some() || self.most.is_none() || self.below.is_empty() {
                if list.next_element::<IgnoredAny>()?.is_none() {
                    break;
                }
                if let Some(limit) = is_full {
                    *self.found = Some((self.path, limit));
                    return Err(A::Error::custom("found"));
                }
                continue;
            }
            let entry = Place {
                path: format!("{}[{index}]", self.path),
                most: None,
                below: self.below.clone(),
                found: &mut *self.found,
            };
            if list.next_element_seed(entry)?.is_none() {
                break;
            }
        }
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }
}

//! The JSON form of messages: protobuf's own mapping, with the field names of the `.proto` files.
//!
//! `build.rs` has pbjson generate the code. This module has what that code calls. It takes the
//! place of pbjson's own helpers, so the names are pbjson's.

use std::fmt::{self, Formatter};
use std::marker::PhantomData;
use std::str::FromStr;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, Unexpected, Visitor};

#[allow(unused_qualifications, clippy::all)]
mod generated {
    use super::FieldAccess as _;
    use crate::v1::*;

    include!(concat!(env!("OUT_DIR"), "/json.rs"));
}

/// Reads the value of a field.
trait FieldAccess<'de>: MapAccess<'de> {
    /// The value after the key that was read last. `null` gives the default.
    fn next_value_or_default<T: Deserialize<'de> + Default>(&mut self) -> Result<T, Self::Error> {
        Ok(self.next_value::<Option<T>>()?.unwrap_or_default())
    }
}

impl<'de, M: MapAccess<'de>> FieldAccess<'de> for M {}

/// Bytes from base64, standard or URL-safe, with or without padding.
#[derive(Default)]
struct BytesDeserialize<T>(T);

impl<'de, T: From<Vec<u8>>> Deserialize<'de> for BytesDeserialize<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        pbjson::private::BytesDeserialize::deserialize(deserializer).map(|bytes| Self(bytes.0))
    }
}

/// Writes base64, with padding.
mod base64 {
    use pbjson::private::base64::Engine as _;
    use pbjson::private::base64::engine::general_purpose::STANDARD;

    pub(super) fn encode(bytes: &[u8]) -> String {
        STANDARD.encode(bytes)
    }
}

/// A number from a JSON number or from a text. pbjson's own type tries one after the other on a
/// copy of the value, which takes twice the time in large lists of numbers.
#[derive(Default)]
struct NumberDeserialize<T>(T);

impl<'de, T: Number> Deserialize<'de> for NumberDeserialize<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor(PhantomData)).map(Self)
    }
}

struct NumberVisitor<T>(PhantomData<T>);

impl<T: Number> Visitor<'_> for NumberVisitor<T> {
    type Value = T;

    fn expecting(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(T::WHAT)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<T, E> {
        T::of_f64(value).ok_or_else(|| E::invalid_value(Unexpected::Float(value), &self))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<T, E> {
        T::of_i64(value).ok_or_else(|| E::invalid_value(Unexpected::Signed(value), &self))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<T, E> {
        T::of_u64(value).ok_or_else(|| E::invalid_value(Unexpected::Unsigned(value), &self))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<T, E> {
        let whole = || T::of_f64(value.parse().ok()?);
        let number = value.parse().ok().or_else(whole);
        number.ok_or_else(|| E::invalid_value(Unexpected::Str(value), &self))
    }
}

/// A numeric type of protobuf.
trait Number: FromStr {
    /// What errors say is expected.
    const WHAT: &'static str;

    fn of_f64(value: f64) -> Option<Self>;
    fn of_i64(value: i64) -> Option<Self>;
    fn of_u64(value: u64) -> Option<Self>;
}

/// Largest value up to which every whole number has an `f64` of its own.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;

macro_rules! whole {
    ($($ty:ty: $what:literal,)*) => {$(
        impl Number for $ty {
            const WHAT: &'static str = $what;

            /// 40.0 and 4e1 are whole numbers too.
            fn of_f64(value: f64) -> Option<Self> {
                let is_whole = value.fract() == 0.0 && value.abs() <= MAX_EXACT;
                is_whole.then_some(value as i64).and_then(Self::of_i64)
            }

            fn of_i64(value: i64) -> Option<Self> {
                value.try_into().ok()
            }

            fn of_u64(value: u64) -> Option<Self> {
                value.try_into().ok()
            }
        }
    )*};
}

whole! {
    i32: "a whole number of 32 bits",
    u32: "a whole number of 32 bits that is not negative",
    u64: "a whole number of 64 bits that is not negative",
}

impl Number for f32 {
    const WHAT: &'static str = "a number";

    fn of_f64(value: f64) -> Option<Self> {
        Some(value as Self)
    }

    fn of_i64(value: i64) -> Option<Self> {
        Some(value as Self)
    }

    fn of_u64(value: u64) -> Option<Self> {
        Some(value as Self)
    }
}

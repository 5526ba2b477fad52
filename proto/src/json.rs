//! How enumerations and bytes are written in JSON: words and base64.

/// A module for `#[serde(with)]` on the fields of one enumeration: its values without their prefix,
/// in lower case.
macro_rules! words {
    ($module:ident, $ty:ty, $prefix:literal) => {
        /// An enumeration as a word.
        pub mod $module {
            use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

            /// Writes the word.
            ///
            /// # Errors
            /// The serializer's.
            pub fn serialize<S: Serializer>(value: &i32, serializer: S) -> Result<S::Ok, S::Error> {
                let value = <$ty>::try_from(*value).unwrap_or_default();
                serializer.serialize_str(&super::word($prefix, value.as_str_name()))
            }

            /// Reads the word.
            ///
            /// # Errors
            /// Where it is none of the enumeration's.
            pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<i32, D::Error> {
                let word = std::borrow::Cow::<str>::deserialize(deserializer)?;
                let name = format!("{}{}", $prefix, word.to_ascii_uppercase());
                match <$ty>::from_str_name(&name) {
                    Some(value) if super::word($prefix, &name) == *word => Ok(value.into()),
                    _ => Err(D::Error::custom(format!(
                        "unknown value {word:?}; allowed: {}",
                        super::words($prefix, |number| <$ty>::try_from(number)
                            .ok()
                            .map(|v| v.as_str_name()))
                    ))),
                }
            }
        }
    };
}

fn word(prefix: &str, name: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase()
}

fn words(prefix: &str, name: impl Fn(i32) -> Option<&'static str>) -> String {
    let words: Vec<String> = (0..).map_while(name).map(|name| word(prefix, name)).collect();
    words.join(", ")
}

include!(concat!(env!("OUT_DIR"), "/words.rs"));

/// Bytes as base64.
pub mod base64 {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    /// Writes base64.
    ///
    /// # Errors
    /// The serializer's.
    pub fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&base64::display::Base64Display::new(bytes, &STANDARD))
    }

    /// Reads base64.
    ///
    /// # Errors
    /// Where it is none.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
        let text = std::borrow::Cow::<str>::deserialize(deserializer)?;
        STANDARD.decode(text.as_bytes()).map_err(D::Error::custom)
    }
}

//! The remote procedures of `troupe/v1/*.proto`.

use serde::de::DeserializeOwned;

/// A remote procedure.
#[derive(Debug, Clone, Copy)]
pub struct Rpc {
    /// Unique among all services.
    pub name: &'static str,
    /// The lists of messages, texts or bytes in its request.
    pub lists: &'static [List],
}

/// A list in a request.
#[derive(Debug, Clone, Copy)]
pub struct List {
    /// Message and field, such as `Character.context`.
    pub field: &'static str,
    /// Type of the entries: a message's name, `string` or `bytes`.
    pub of: &'static str,
    /// The fields from the request down to the list, which is the last one.
    pub steps: &'static [Step],
}

/// A field on the way to a list.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Number in the `.proto` file.
    pub number: u32,
    /// Name in the `.proto` file.
    pub name: &'static str,
    /// Whether the field is a list.
    pub list: bool,
}

/// A message that a remote procedure takes.
pub trait Request: Sized {
    /// Name of the procedure that takes it.
    const RPC: &'static str;

    /// Reads a request. Each message does this itself: then the code that reads it is compiled
    /// once, in this crate, which rarely changes.
    ///
    /// # Errors
    /// [`JsonError`] if it is not a request.
    fn from_json(json: &[u8]) -> Result<Self, JsonError>;
}

/// JSON that is not the message.
#[derive(Debug, thiserror::Error)]
pub enum JsonError {
    /// It ends too early.
    #[error("{0}")]
    Truncated(serde_json::Error),
    /// A field is wrong.
    #[error("{path}: {cause}")]
    Field {
        /// Path of the field; `.` for the whole message.
        path: String,
        /// The error.
        cause: serde_json::Error,
    },
    /// Something follows the message.
    #[error("{0}")]
    Trailing(serde_json::Error),
}

/// Reads one JSON value, for [`Request::from_json`].
///
/// # Errors
/// [`JsonError`] if it is not a `T`.
pub fn read_json<T: DeserializeOwned>(json: &[u8]) -> Result<T, JsonError> {
    let mut json = serde_json::Deserializer::from_slice(json);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let path = error.path().to_string();
        match error.into_inner() {
            cause if cause.is_eof() => JsonError::Truncated(cause),
            cause => JsonError::Field { path, cause },
        }
    })?;
    json.end().map_err(JsonError::Trailing)?;
    Ok(value)
}

/// Over HTTP, the body of `PutStyle` is only the style. The path has the rest.
impl Request for crate::v1::Style {
    const RPC: &'static str = "PutStyle";

    fn from_json(json: &[u8]) -> Result<Self, JsonError> {
        read_json(json)
    }
}

include!(concat!(env!("OUT_DIR"), "/rpcs.rs"));

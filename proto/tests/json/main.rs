//! The JSON form of the messages, and of the documents that people write.

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

mod documents;
mod motion;
mod scenes;
mod sessions;

use prost::Message;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Asserts that protobuf and JSON both carry the whole message. Returns its JSON.
fn round_trip<T>(message: &T) -> serde_json::Value
where
    T: Message + Default + PartialEq + std::fmt::Debug + Serialize + DeserializeOwned,
{
    let json = serde_json::to_value(message).unwrap();
    assert_eq!(&serde_json::from_value::<T>(json.clone()).unwrap(), message);
    assert_eq!(&T::decode(message.encode_to_vec().as_slice()).unwrap(), message);
    json
}

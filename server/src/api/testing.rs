//! The way of a message from its bytes to its checks, for fuzz targets.

use std::sync::Arc;

use serde::de::DeserializeOwned;
use troupe_proto::rpc::Request;
use troupe_proto::v1;

use super::ApiLimits;
use super::error::ApiError;
use super::http::json::{self, BodyLimits};
use super::shape::Shapes;
use super::ws;

/// Reads messages as the server does.
pub struct Reader(BodyLimits);

impl Reader {
    /// One with these limits.
    pub fn new(limits: &ApiLimits) -> Self {
        Self(BodyLimits {
            bytes: limits.message_bytes,
            shapes: Arc::new(Shapes::new(limits)),
        })
    }

    /// A message as JSON.
    ///
    /// # Errors
    /// [`ApiError`] where it is too large, or cannot be read.
    pub fn json<T: Request + DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, ApiError> {
        json::read(bytes, &self.0)
    }

    /// A message of a stream as protobuf.
    ///
    /// # Errors
    /// [`ApiError`] where it is too large, or cannot be read.
    pub fn drive(&self, bytes: &[u8]) -> Result<v1::DriveRequest, ApiError> {
        ws::decode(bytes, &self.0)
    }
}

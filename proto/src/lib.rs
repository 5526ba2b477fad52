//! The public contract of Troupe, generated from `troupe/v1/*.proto`: the protobuf messages, the
//! same messages as JSON (serde, `snake_case` names) with their `OpenAPI` schemas, and, with the
//! feature `grpc`, the gRPC clients and servers.
//!
//! A message missing a JSON field reads as protobuf does: the field takes its default. Requests
//! refuse unknown fields, answers tolerate them.
//!
//! [`docs`] has the documents that people write: smart objects and scenes. [`rpc`] lists the remote
//! procedures.

pub mod docs;
mod json;
#[cfg(feature = "openapi")]
mod openapi;
pub mod rpc;
mod stats;

#[cfg(all(test, feature = "openapi"))]
mod json_tests;

/// Version 1 of the API.
#[allow(missing_docs, unused_qualifications, clippy::all)]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/troupe.v1.rs"));

    /// The compiled descriptors of this version, for gRPC reflection.
    pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/troupe.v1.bin"));
}

//! The public contract of Troupe, generated from `troupe/v1/*.proto`: the protobuf messages and
//! their JSON form (serde). The feature `grpc` adds the gRPC clients and servers, `openapi` the
//! `OpenAPI` schemas of the JSON form.
//!
//! JSON follows protobuf's own mapping, with the field names of the `.proto` files. Requests refuse
//! unknown fields, answers ignore them.
//!
//! [`docs`] has the documents that people write: smart objects and scenes. [`rpc`] lists the remote
//! procedures.

pub mod docs;
mod json;
#[cfg(feature = "openapi")]
mod openapi;
pub mod rpc;
mod stats;

#[cfg(test)]
#[cfg(feature = "openapi")]
mod json_tests;

/// Version 1 of the API.
#[allow(missing_docs, unused_qualifications, clippy::all)]
pub mod v1 {
    include!(concat!(env!("OUT_DIR"), "/troupe.v1.rs"));

    /// The compiled descriptors of this version, for gRPC reflection.
    pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/troupe.v1.bin"));
}

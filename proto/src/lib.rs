//! The public contract of Troupe, generated from `troupe/v1/*.proto`: the protobuf messages, the gRPC clients
//! and servers, and the same messages as JSON (serde, `snake_case` names) with their `OpenAPI` schemas.
//!
//! A message missing a JSON field reads as protobuf does: the field takes its default. Requests refuse unknown
//! fields, answers tolerate them.
//!
//! [`docs`] has the documents that people write: smart objects and scenes.

pub mod docs;
pub mod json;
mod stats;

/// Version 1 of the API.
#[allow(missing_docs, unused_qualifications, clippy::all)]
pub mod v1 {
    tonic::include_proto!("troupe.v1");

    /// The compiled descriptors of this version, for gRPC reflection.
    pub const FILE_DESCRIPTOR_SET: &[u8] = tonic::include_file_descriptor_set!("troupe.v1");
}

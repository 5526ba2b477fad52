//! The Motion Model Context Protocol (MMCP 1.4), which tools such as Blender use to ask for motion.
//!
//! A loaded pack is one model, or one model for each of its bodies ([`model`]). A request is
//! decoded ([`schema`]), checked ([`check`], [`constraints`], [`options`]) and becomes a take
//! ([`asked`]). The code in `character/src/take` makes takes. A skeleton that is not the model's is
//! found a body ([`skeleton`]): the model's body is guided by what the request asks for ([`onto`]),
//! and its motion is carried over. Another pack may plan a path ([`carried`]). [`run`] makes all
//! samples of all takes together, window by window. A reference motion ([`reference`]) is first
//! described in words. [`answer`] writes the motions as glTF with the extension `MMCP_motion`.

pub mod answer;
pub mod asked;
mod carried;
pub mod check;
pub mod constraints;
pub mod fault;
pub mod limits;
pub mod model;
pub mod onto;
pub mod options;
pub mod reference;
pub mod run;
pub mod schema;
pub mod skeleton;
pub mod trajectory;

pub use fault::{Code, Fault};
pub use model::Capabilities;
pub use run::{Failure, Reply, RequestOrBatch, generate};

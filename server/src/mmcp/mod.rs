//! The Motion Model Context Protocol (MMCP 1.4): what motion tools such as Blender speak.
//!
//! A loaded pack is a model, or one model a body ([`model`]). A request is read ([`schema`]),
//! checked ([`check`], [`constraints`]) and becomes a take ([`asked`]; `character/src/take` makes
//! it). [`run`] has all samples of all takes made together, window after window. A motion in place
//! of words ([`reference`]) is put into words first. [`answer`] writes the motions as glTF with the
//! extension `MMCP_motion`.

pub mod answer;
pub mod asked;
pub mod check;
pub mod constraints;
pub mod fault;
pub mod limits;
pub mod model;
pub mod reference;
pub mod run;
pub mod schema;
pub mod skeleton;
pub mod trajectory;

pub use fault::{Code, Fault};
pub use model::Capabilities;
pub use run::{Body, Failure, Reply, generate};

//! The Motion Model Context Protocol (MMCP 1.4): what motion tools such as Blender speak.
//!
//! A loaded pack is a model, or one model a body ([`model`]). A request is read ([`schema`]),
//! checked ([`check`], [`constraints`]) and becomes a [`take::Take`]. [`run`] has all samples of
//! all takes made together, window after window: from keyframe to keyframe and in a style between
//! them ([`walk`]), or along a path ([`follow`]). A motion in the place of words ([`reference`]) is
//! put into words first. [`finish`] has them meet their constraints, and [`answer`] writes them as
//! glTF with the extension `MMCP_motion`.

pub mod answer;
pub mod check;
pub mod constraints;
pub mod fault;
pub mod finish;
pub mod follow;
pub mod ground;
pub mod limits;
pub mod model;
pub mod reference;
pub mod run;
pub mod schema;
pub mod skeleton;
pub mod start;
pub mod take;
pub mod track;
pub mod trajectory;
pub mod walk;
pub mod way;

pub use fault::{Code, Fault};
pub use model::Capabilities;
pub use run::{Body, Failure, Reply, generate};

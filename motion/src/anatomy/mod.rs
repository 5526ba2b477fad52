//! Two-legged bodies among joints: found by names, with the pose of their skeleton at rest, and the
//! neutral pose that models of many bodies need.

mod biped;
mod doc;
mod names;
mod neutral;
mod parts;
mod rest;
mod shape;

pub use biped::{Biped, Tree};
pub use doc::{LimbDoc, PartsDoc};
pub use names::{Name, Side, without_namespace};
pub use neutral::{let_down, stand_up};
pub use parts::{Limb, Parts};
pub use rest::RestPose;

#[cfg(feature = "files")]
pub(crate) use neutral::ahead;
pub(crate) use neutral::{hang, neutral_of_motion, world_of};
pub(crate) use parts::places;

//! Two-legged bodies among joints: found by names, with the pose of their skeleton at rest, and the
//! neutral pose that models of many bodies need.

mod biped;
mod names;
mod neutral;
mod rest;

pub use biped::{Biped, Tree};
pub use names::{Name, Side, without_namespace};
pub use neutral::{let_down, stand_up};
pub use rest::RestPose;

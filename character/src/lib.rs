//! Live characters without side effects: this crate has no clock, thread, network or open file, and
//! nothing in it waits.
//!
//! A command changes what a character wants ([`primitives`], [`style`]). The character then asks
//! for a plan. What the generator makes of it is cross-faded into the character's motion buffer
//! ([`live`], [`post`]). A [`scene`] has ground, colliders and objects. An [`object`] definition
//! says what characters can do with a thing, a [`skill`] what they can do on the spot. [`document`]
//! reads all of these from TOML or JSON; its errors name line and field.
//! A [`take`] is a motion of any length that is made at once, along a path or through keyframes.

pub mod document;
pub mod field;
pub mod keyframe;
pub mod limits;
pub mod live;
pub mod object;
pub mod post;
pub mod primitives;
pub mod saved;
pub mod scene;
pub mod skill;
pub mod style;
pub mod take;
#[cfg(any(test, feature = "testing"))]
#[allow(clippy::unwrap_used, reason = "for tests")]
pub mod testing;

pub use field::{FieldError, Path, Size};

//! Live characters, pure: no clock, thread, network or file handle is kept here, and nothing waits.
//!
//! Commands change what a character wants ([`primitives`], [`style`]); whenever it needs a plan it
//! asks for one, and what the generator made is cross-faded into its motion buffer ([`live`],
//! [`post`]). A [`scene`] has ground, colliders and objects; an [`object`] definition says what
//! characters can do with a thing, and a [`skill`] what they can do where they stand. All are read
//! from TOML or JSON by [`document`], whose errors name line and field. A [`take`] is a motion of any
//! length that is made at once, along a path or through keyframes.

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

pub use field::{FieldError, Path};

//! Live characters, and what they live among.
//!
//! | module | holds |
//! |---|---|
//! | [`packs`] | the packs that are loaded, each with its workers, styles and skills |
//! | [`records`] | what outlives the process |
//! | [`wire`] | values of messages: checks, units, axes, keyframes |
//! | [`world`] | scenes, objects and their definitions |
//! | [`session`] | characters: commands, steps, streams |
//!
//! Commands change what a character wants (`troupe-character`). Whenever it needs a plan, its
//! session has one made by the pack's workers (`troupe-batch`), and cross-fades it into the frames
//! that a step or a stream takes.

pub mod packs;
pub mod records;
pub mod session;
pub mod wire;
pub mod world;

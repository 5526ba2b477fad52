//! Live characters and the scenes that they live in.
//!
//! | module | holds |
//! |---|---|
//! | [`packs`] | the packs that are loaded, each with its workers, styles and skills |
//! | [`records`] | the database file that survives a restart |
//! | [`wire`] | values of messages: checks, units, axes, keyframes |
//! | [`world`] | scenes, objects and their definitions |
//! | [`skeleton`] | skeletons of users' own characters |
//! | [`session`] | characters: commands, steps, streams |
//! | `uploads` | names and forms of uploads that servers share |
//!
//! A command changes the goal of a character (`troupe-character`). When the character needs a plan,
//! its session requests one from the pack's workers (`troupe-batch`) and cross-fades it into the
//! frames that a step or a stream reads.

pub mod packs;
pub mod records;
pub mod session;
pub mod skeleton;
mod uploads;
pub mod wire;
pub mod world;

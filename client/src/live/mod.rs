//! Live characters: sessions on the server that move until they get another command.
//!
//! A session's timeline counts frames at 30 Hz. There are two ways to advance it:
//!
//! - **Client-clocked**, by [`Session::step`] for one character or [`Crowd::step`] for many: the
//!   game's loop asks for the next frames when it wants them. The same seed, commands and steps
//!   give the same frames.
//! - **Server-clocked**, by [`Drive`]: a stream on which the server sends a tick of frames for many
//!   characters at 30, 50 or 60 Hz. It never waits. A character whose plan is late slows down, and
//!   the server counts that.
//!
//! The intent of a character is a [`Locomotion`]. Set it in place as often as you like. Only
//! changes go to the server, with sequence numbers, so that commands may be lost, late or repeated
//! without harm.
//!
//! An [`Act`] is done once: follow a path ([`LivePath`]), act out a sentence ([`Performance`]), or
//! use an object of a scene ([`SessionOptions::scene`]). Events report its progress. Do not change
//! the locomotion until it is over, because a change ends the act.

mod act;
mod calls;
mod crowd;
mod drive;
mod drive_event;
mod frames;
mod locomotion;
mod options;
mod path;
mod performance;
mod recording;
mod replay;
mod session;
#[cfg(test)]
mod testing;

pub use act::Act;
pub use crowd::{Crowd, CrowdOptions, CrowdStep, Fault, MemberId};
pub use drive::{Drive, DriveOptions, Tick, Update};
pub use drive_event::DriveEvent;
pub use frames::{Contacts, Frame, Frames};
pub use locomotion::Locomotion;
pub(crate) use options::convention_to_wire;
pub use options::{Encoding, FrameOptions, Rate, SessionOptions};
pub use path::{LivePath, PathPoint};
pub use performance::Performance;
pub use recording::Recording;
pub use replay::Replaying;
pub use session::Session;

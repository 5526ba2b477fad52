//! What the characters of a server live among: its scenes and the definitions of their objects.
//!
//! A [`Store`] has them all, reads them from folders as the server starts, and keeps what is
//! uploaded there. The rest is how they look as messages: messages to scenes and back ([`message`],
//! [`shape`]), definitions as messages ([`definition`]), and what a box reaches ([`detect`]).
//! [`calls`] are the calls of `troupe.v1.Scenes`.
//!
//! Scenes are native; the convention of a request is dealt with here, at the edge.

mod calls;
mod definition;
mod detect;
mod error;
mod kept;
mod memory;
mod message;
mod shape;
mod store;

#[cfg(test)]
mod store_tests;

pub use calls::{ObjectOutcome, ObjectsChanged};
pub use detect::CharacterPlace;
pub use error::WorldError;
pub use memory::{NoMemory, UploadMemory};
pub use store::{Folders, LoadError, Store, StoreError};

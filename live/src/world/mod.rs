//! The scenes of a server and the definitions of their objects.
//!
//! A [`Store`] has all of them. It reads them from folders at the server's start and writes uploads
//! there. [`calls`] has the calls of `troupe.v1.Scenes`. The other modules convert between messages
//! and scenes ([`message`], [`shape`]) or definitions ([`definition`]), and find the objects on the
//! way of a box ([`detect`]).
//!
//! Scenes use the native convention. This module converts from and to the convention of a request.

mod calls;
mod definition;
mod detect;
mod error;
mod kept;
mod memory;
mod message;
mod shape;
mod shared;
mod store;

#[cfg(test)]
mod store_tests;

pub use calls::{ObjectOutcome, ObjectsChanged};
pub use detect::CharacterPlace;
pub use error::WorldError;
pub use memory::{Holder as MemoryHolder, NoMemory, UploadMemory};
pub use store::{Folders, LoadError, Store, StoreError};

//! Skeletons of users' own characters, which sessions and requests may name.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | [`error`], [`doc`] | errors; a skeleton as the document that is kept |
//! | [`upload`] | a skeleton out of a request: from a file or from joints |
//! | [`difference`] | from a pose that is carried over to one that the user gave |
//! | [`dress`] | the way of one character onto a user's skeleton, frame by frame |
//! | [`worn`] | the way from a pack's skeleton to another one, and back |
//! | [`store`] | the skeletons of a tenant, and the folder that keeps them |
//! | [`message`] | skeletons and certificates as messages |
//!
//! A character lives on the skeleton of its pack, in the pack's size. Lengths of its client are
//! divided by [`Worn::scale`] on the way in, and its frames are carried over on the way out.

mod difference;
mod doc;
mod dress;
mod error;
mod message;
mod store;
mod upload;
mod worn;

pub use error::SkeletonError;
pub use store::{MAX_SKELETONS, Skeletons};
pub use upload::upload;
pub use difference::Difference;
pub use dress::Dress;
pub(crate) use dress::Last;
pub use worn::Worn;

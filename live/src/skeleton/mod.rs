//! Skeletons of users' own characters, which sessions and requests may name.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | [`error`], [`doc`] | errors; a skeleton as the document that is kept |
//! | [`upload`] | a skeleton out of a request: from a file or from joints |
//! | [`difference`] | from a pose that is carried over to one that the user gave |
//! | [`dress`] | the way of one character onto a user's skeleton, frame by frame |
//! | [`worn`] | the way from a pack's skeleton to another one, and back |
//! | [`guest`] | a skeleton that comes with a request, and goes with it |
//! | [`carrier`] | packs that plan paths for bodies of other packs |
//! | [`store`] | the skeletons of a tenant, and the folder that keeps them |
//! | [`shared`] | skeletons as servers share them |
//! | [`message`] | skeletons and certificates as messages |
//!
//! A character lives on the skeleton of its pack, in the pack's size. Lengths of its client are
//! divided by [`Worn::scale`] on the way in, and its frames are carried over on the way out.

mod carrier;
mod difference;
mod doc;
mod dress;
mod error;
mod guest;
mod message;
mod shared;
mod store;
mod upload;
mod worn;

pub use carrier::{Among, Carrier, NoCarrier, is_on_two_legs, is_same_body};
pub use difference::Difference;
pub use dress::Dress;
pub(crate) use dress::Last;
pub use error::SkeletonError;
pub use guest::{Guest, can_wear};
pub use store::{MAX_SKELETONS, Skeletons};
pub use upload::upload;
pub use worn::Worn;

#[cfg(test)]
pub(crate) use shared::testing;

//! glTF 2.0: writes clips as binary files, and (with the feature `files`) reads the animation of a
//! skeleton out of binary and text files. glTF's axes and units are Troupe's own.

#[cfg(feature = "files")]
mod document;
#[cfg(feature = "files")]
mod dress;
#[cfg(feature = "files")]
mod humanoid;
#[cfg(feature = "files")]
mod keys;
#[cfg(feature = "files")]
mod nodes;
#[cfg(feature = "files")]
mod read;
#[cfg(feature = "files")]
#[cfg(test)]
mod tests;
mod write;

#[cfg(feature = "files")]
pub use document::Beside;
#[cfg(feature = "files")]
pub(crate) use document::MAX_BUFFER_BYTES;
#[cfg(feature = "files")]
pub use dress::{DressError, FileJoints, add_animation_at};
#[cfg(feature = "files")]
pub(crate) use humanoid::human_bones;
#[cfg(feature = "files")]
pub use read::{
    GlbAnimation, GlbOptions, GlbReadError, MAX_NODES, animation_names, animation_names_beside, parse,
    parse_beside,
};
pub(crate) use write::Builder;
pub use write::{GlbError, write_glb};

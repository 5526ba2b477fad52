//! Drawing: what all pictures are made with.

pub(crate) mod animation;
pub(crate) mod canvas;
pub(crate) mod figure;
pub(crate) mod header;
mod palette;
pub(crate) mod theme;

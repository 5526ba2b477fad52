//! Drawing: what all pictures are made with.

pub(crate) mod canvas;
pub(crate) mod figure;
pub(crate) mod theme;

//! Documents that people write: TOML or JSON texts, files and folders, read and checked.
//!
//! A [`Document`] is the content of a text as it is written. A check turns it into what the server
//! works with. Every error names file, line, field and what is allowed ([`DocumentError`]). Smart
//! objects ([`crate::object`]) and scenes ([`crate::scene`]) are such documents.

pub mod check;
mod folder;
mod locate;
mod read;
#[cfg(test)]
pub(crate) mod testing;
mod words;

pub use check::MAX_NAME_CHARS;
pub use folder::{forget, is_full, keep, read_folder, read_kept, write_whole};
pub use read::{Document, DocumentError, Format, Source, parse, read, read_file};
pub use words::plain;

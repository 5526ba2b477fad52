//! Definitions as TOML or JSON texts and files.

use std::path::Path as FilePath;

use super::{Definition, MAX_BYTES, ObjectDoc};
use crate::document::{Document, DocumentError, Format, read, read_file, read_folder};
use troupe_motion::model::Rig;

impl Document for ObjectDoc {
    const WHAT: &'static str = "object definition";
    const MAX_BYTES: usize = MAX_BYTES;
}

impl Definition {
    /// Reads and checks a TOML text for `pack`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first thing that is wrong.
    pub fn from_toml(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        Self::read(text, Format::Toml, rig)
    }

    /// Reads and checks a JSON text for `pack`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first thing that is wrong.
    pub fn from_json(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        Self::read(text, Format::Json, rig)
    }

    /// Reads and checks a text for `pack`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first thing that is wrong.
    pub fn read(text: &str, format: Format, rig: &Rig) -> Result<Self, DocumentError> {
        read(text, format, |doc| Self::from_doc(doc, rig))
    }
}

/// Reads and checks the definition in `file`, which ends in `.toml` or `.json`.
///
/// # Errors
/// [`DocumentError`], which names the file, and line and field where there are such.
pub fn load_file(file: &FilePath, rig: &Rig) -> Result<Definition, DocumentError> {
    read_file(file, |doc| Definition::from_doc(doc, rig))
}

/// Reads and checks every `*.toml` and `*.json` of `folder`, sorted by name. A folder that is not
/// there has none.
///
/// # Errors
/// [`DocumentError`] for the first file that is not a definition, or has the name of another.
pub fn load_folder(folder: &FilePath, rig: &Rig) -> Result<Vec<Definition>, DocumentError> {
    read_folder(
        folder,
        |doc| Definition::from_doc(doc, rig),
        |definition| &definition.name,
    )
}

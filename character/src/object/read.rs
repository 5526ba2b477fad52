//! Reads definitions from TOML or JSON texts and files.

use std::path::Path as FilePath;

use super::{Definition, MAX_BYTES, ObjectDoc};
use crate::document::{Document, DocumentError, Format, read, read_file, read_folder};
use troupe_motion::model::Rig;

impl Document for ObjectDoc {
    const WHAT: &'static str = "object definition";
    const MAX_BYTES: usize = MAX_BYTES;
}

impl Definition {
    /// Reads a TOML text and checks it for the pack of `rig`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn from_toml(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        Self::read(text, Format::Toml, rig)
    }

    /// Reads a JSON text and checks it for the pack of `rig`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn from_json(text: &str, rig: &Rig) -> Result<Self, DocumentError> {
        Self::read(text, Format::Json, rig)
    }

    /// Reads a text and checks it for the pack of `rig`.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn read(text: &str, format: Format, rig: &Rig) -> Result<Self, DocumentError> {
        read(text, format, |doc| Self::from_doc(doc, rig))
    }
}

/// Reads the definition in `file`, which ends in `.toml` or `.json`, and checks it.
///
/// # Errors
/// [`DocumentError`] with the file, and with line and field if the error has them.
pub fn load_file(file: &FilePath, rig: &Rig) -> Result<Definition, DocumentError> {
    read_file(file, |doc| Definition::from_doc(doc, rig))
}

/// Reads and checks every `*.toml` and `*.json` file of `folder`, sorted by name. A folder that
/// does not exist counts as empty.
///
/// # Errors
/// [`DocumentError`] for the first file that is not a definition, or has the same name as another.
pub fn load_folder(folder: &FilePath, rig: &Rig) -> Result<Vec<Definition>, DocumentError> {
    read_folder(
        folder,
        |doc| Definition::from_doc(doc, rig),
        |definition| &definition.name,
    )
}

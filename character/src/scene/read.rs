//! Reads scenes from TOML or JSON texts and files.

use std::path::Path as FilePath;

use super::{Bodies, MAX_BYTES, Scene, SceneDoc};
use crate::FieldError;
use crate::document::{Document, DocumentError, Format, read, read_file, read_folder};

impl Document for SceneDoc {
    const WHAT: &'static str = "scene";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A scene with the name that its document gives it.
#[derive(Debug, Clone)]
pub struct NamedScene {
    /// Name of the scene, at most [`MAX_ID_BYTES`](super::MAX_ID_BYTES) bytes.
    pub name: String,
    /// The checked scene.
    pub scene: Scene,
}

impl NamedScene {
    /// Checks a written scene. `bodies` has the bodies of its objects.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_doc(doc: SceneDoc, bodies: &impl Bodies) -> Result<Self, FieldError> {
        let scene = Scene::from_doc(&doc, bodies)?;
        let name = doc.name;
        Ok(Self { name, scene })
    }

    /// Reads a text and checks it. `bodies` has the bodies of its objects.
    ///
    /// # Errors
    /// [`DocumentError`] for the first error.
    pub fn read(text: &str, format: Format, bodies: &impl Bodies) -> Result<Self, DocumentError> {
        read(text, format, |doc| Self::from_doc(doc, bodies))
    }
}

/// Reads the scene in `file`, which ends in `.toml` or `.json`, and checks it.
///
/// # Errors
/// [`DocumentError`] with the file, and with line and field if the error has them.
pub fn load_file(file: &FilePath, bodies: &impl Bodies) -> Result<NamedScene, DocumentError> {
    read_file(file, |doc| NamedScene::from_doc(doc, bodies))
}

/// Reads and checks every `*.toml` and `*.json` file of `folder`, sorted by name. A folder that
/// does not exist counts as empty.
///
/// # Errors
/// [`DocumentError`] for the first file that is not a scene, or has the same name as another.
pub fn load_folder(folder: &FilePath, bodies: &impl Bodies) -> Result<Vec<NamedScene>, DocumentError> {
    read_folder(
        folder,
        |doc| NamedScene::from_doc(doc, bodies),
        |named| &named.name,
    )
}

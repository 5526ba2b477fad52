//! Scenes as TOML or JSON texts and files.

use std::path::Path as FilePath;

use super::{Bodies, MAX_BYTES, Scene, SceneDoc};
use crate::FieldError;
use crate::document::{Document, DocumentError, Format, read, read_file, read_folder};

impl Document for SceneDoc {
    const WHAT: &'static str = "scene";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A scene that was read, and its name.
#[derive(Debug, Clone)]
pub struct NamedScene {
    /// Its name.
    pub name: String,
    /// The scene.
    pub scene: Scene,
}

impl NamedScene {
    /// Checks what is written; `bodies` has those of its objects.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_doc(doc: SceneDoc, bodies: &impl Bodies) -> Result<Self, FieldError> {
        let scene = Scene::from_doc(&doc, bodies)?;
        let name = doc.name;
        Ok(Self { name, scene })
    }

    /// Reads and checks a text; `bodies` has those of its objects.
    ///
    /// # Errors
    /// [`DocumentError`] for the first thing that is wrong.
    pub fn read(text: &str, format: Format, bodies: &impl Bodies) -> Result<Self, DocumentError> {
        read(text, format, |doc| Self::from_doc(doc, bodies))
    }
}

/// Reads and checks the scene in `file`, which ends in `.toml` or `.json`.
///
/// # Errors
/// [`DocumentError`], which names the file, and line and field where there are such.
pub fn load_file(file: &FilePath, bodies: &impl Bodies) -> Result<NamedScene, DocumentError> {
    read_file(file, |doc| NamedScene::from_doc(doc, bodies))
}

/// Reads and checks every `*.toml` and `*.json` of `folder`, sorted by name. A folder that is not
/// there has none.
///
/// # Errors
/// [`DocumentError`] for the first file that is not a scene, or has the name of another.
pub fn load_folder(folder: &FilePath, bodies: &impl Bodies) -> Result<Vec<NamedScene>, DocumentError> {
    read_folder(
        folder,
        |doc| NamedScene::from_doc(doc, bodies),
        |named| &named.name,
    )
}

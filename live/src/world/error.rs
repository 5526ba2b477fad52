//! Errors of calls about scenes and definitions.

use std::fmt::Display;

use super::{NoMemory, StoreError};
use troupe_base::echo::{MAX_MESSAGE, MAX_PATH, cut};
use troupe_character::document::DocumentError;
use troupe_character::object::DefinitionsError;
use troupe_character::scene::{SceneError, TableError};
use troupe_character::{FieldError, Path};

/// Why a call about scenes or definitions was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WorldError {
    /// A value of the request is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The text of a scene or an object definition has an error.
    #[error("{0}")]
    Document(Box<DocumentError>),
    /// A scene is unknown, cannot be added, or cannot be deleted.
    #[error("{error}")]
    Scene {
        /// The reason.
        error: TableError,
        /// The field of the request that names the scene.
        field: String,
    },
    /// An object of a scene is unknown, or a change of it is not allowed.
    #[error("{error}")]
    Object {
        /// The reason.
        error: SceneError,
        /// The field of the request that names the object.
        field: String,
    },
    /// An object definition is unknown, cannot be added, or cannot be deleted.
    #[error("{error}")]
    Definition {
        /// The reason.
        error: DefinitionsError,
        /// The field of the request that names the definition.
        field: String,
    },
    /// With this upload, all uploads together would exceed their memory limit.
    #[error("{what} {name:?} {cause}")]
    NoMemory {
        /// `scene`, `object definition` or `style`.
        what: &'static str,
        /// Name of the upload.
        name: String,
        /// Size of the upload, size of all others, and the limit.
        cause: NoMemory,
        /// The field of the request that is too large.
        field: String,
    },
    /// The file of an upload could not be written or removed.
    #[error("{message}")]
    NotKept {
        /// The name of the upload and the reason.
        message: String,
        /// Whether the disk is full.
        is_disk_full: bool,
    },
    /// A definition could not be written as a document.
    #[error("{0}")]
    Internal(String),
}

impl WorldError {
    /// The error of a file that was not written or removed.
    pub(crate) fn not_kept(error: &dyn Display, is_disk_full: bool) -> Self {
        if !is_disk_full {
            tracing::error!(%error, "the file of an upload cannot be written or removed");
        }
        Self::NotKept {
            message: error.to_string(),
            is_disk_full,
        }
    }
}

impl From<DocumentError> for WorldError {
    /// Cuts the parts of the document that the error repeats.
    fn from(error: DocumentError) -> Self {
        Self::Document(Box::new(DocumentError {
            field: cut(&error.field, MAX_PATH),
            message: cut(&error.message, MAX_MESSAGE),
            ..error
        }))
    }
}

impl From<StoreError> for WorldError {
    fn from(error: StoreError) -> Self {
        let field = || "name".to_owned();
        match error {
            StoreError::Scenes(error) => Self::Scene {
                error,
                field: field(),
            },
            StoreError::Definitions(error) => Self::Definition {
                error,
                field: field(),
            },
            StoreError::TooLong { .. } => {
                let path = Path::root();
                path.field("scene")
                    .error(error.to_string(), "a smaller scene")
                    .into()
            }
            StoreError::NoMemory { what, name, cause } => {
                let field = if what == "scene" { "scene" } else { "document" };
                Self::NoMemory {
                    what,
                    name,
                    cause,
                    field: field.to_owned(),
                }
            }
            StoreError::Keep { full, .. } => Self::not_kept(&error, full),
        }
    }
}

//! What can be wrong with a call that is about scenes and definitions.

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
    /// A value that is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A scene or an object definition that is written wrongly.
    #[error("{0}")]
    Document(Box<DocumentError>),
    /// A scene that is not there, cannot be there, or cannot go.
    #[error("{error}")]
    Scene {
        /// Why.
        error: TableError,
        /// The field of the request that named it.
        field: String,
    },
    /// An object of a scene that is not there, or cannot be changed so.
    #[error("{error}")]
    Object {
        /// Why.
        error: SceneError,
        /// The field of the request that named it.
        field: String,
    },
    /// An object definition that is not there, cannot be there, or cannot go.
    #[error("{error}")]
    Definition {
        /// Why.
        error: DefinitionsError,
        /// The field of the request that named it.
        field: String,
    },
    /// An upload would take more memory than all uploads may.
    #[error("{what} {name:?} {cause}")]
    NoMemory {
        /// `scene`, `definition` or `style`.
        what: &'static str,
        /// Name of the upload.
        name: String,
        /// Its size, that of all others, and the limit.
        cause: NoMemory,
        /// The field of the request that is too large.
        field: String,
    },
    /// The file of an upload could not be written or removed.
    #[error("{message}")]
    NotKept {
        /// Which file, and why.
        message: String,
        /// Whether the disk is full.
        is_disk_full: bool,
    },
    /// A document could not be made.
    #[error("{0}")]
    Internal(String),
}

impl WorldError {
    /// The error of a file that was not written or removed.
    pub(crate) fn not_kept(error: &dyn Display, is_disk_full: bool) -> Self {
        if !is_disk_full {
            tracing::error!(%error, "an upload was not kept");
        }
        Self::NotKept {
            message: error.to_string(),
            is_disk_full,
        }
    }
}

impl From<DocumentError> for WorldError {
    /// What is echoed of the document is cut.
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

//! What can be wrong with a call that is about scenes and definitions.

use super::StoreError;
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
    /// Uploads would take more memory than they may.
    #[error("{message}")]
    NoMemory {
        /// What takes how much.
        message: String,
        /// Most bytes.
        most: usize,
        /// The field of the request that is too large.
        field: &'static str,
    },
    /// A file that was not written because the disk is full.
    #[error("{0}")]
    DiskFull(String),
    /// A file that was not written, or a document that was not made.
    #[error("{0}")]
    Internal(String),
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
            StoreError::NoMemory { what, cause, .. } => Self::NoMemory {
                message: error.to_string(),
                most: cause.most,
                field: match what {
                    "scene" => "scene",
                    _ => "document",
                },
            },
            StoreError::Keep { full: true, .. } => Self::DiskFull(error.to_string()),
            StoreError::Keep { .. } => {
                tracing::error!(%error, "a file was not written");
                Self::Internal(error.to_string())
            }
        }
    }
}

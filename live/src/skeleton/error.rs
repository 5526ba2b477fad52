//! Errors of calls about skeletons.

use crate::packs::{UnknownBody, UnknownPack};
use crate::world::NoMemory;
use troupe_character::FieldError;

/// Why a skeleton cannot be put, found, worn or deleted.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SkeletonError {
    /// A value of the request is not accepted, or a file cannot be read.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The requested pack is not loaded.
    #[error(transparent)]
    UnknownPack(#[from] UnknownPack),
    /// The pack has no body of the requested name.
    #[error(transparent)]
    UnknownBody(#[from] UnknownBody),
    /// No skeleton has this name.
    #[error("there is no skeleton {name:?}; there are: {}", known.join(", "))]
    Unknown {
        /// The requested name, cut to 64 characters.
        name: String,
        /// The field of the request that has the name.
        field: String,
        /// Names of skeletons, at most 32.
        known: Vec<String>,
    },
    /// The motion of a pack cannot be carried over, or its certificate is below the bar.
    #[error("skeleton {name:?} does not fit {pack}: {}", faults.join("; "))]
    Unfit {
        /// Name of the skeleton.
        name: String,
        /// Name of the pack, with that of its body.
        pack: Box<str>,
        /// What is beyond the bar, with motion and joint.
        faults: Vec<String>,
        /// The field of the request that names or has the skeleton.
        field: String,
        /// What is allowed.
        allowed: Box<str>,
        /// Whether `force` would take it.
        may_force: bool,
    },
    /// Sessions wear the skeleton.
    #[error(
        "{sessions} sessions wear skeleton {name:?}; allowed: one that no session wears, or another name"
    )]
    InUse {
        /// Name of the skeleton.
        name: String,
        /// Number of its sessions.
        sessions: usize,
    },
    /// There are as many skeletons as allowed.
    #[error("there are {most} skeletons; allowed: at most {most}")]
    Full {
        /// Maximum number of skeletons.
        most: usize,
    },
    /// With this upload, all uploads together would exceed their memory limit.
    #[error("skeleton {name:?} {cause}")]
    NoMemory {
        /// Name of the skeleton.
        name: String,
        /// Size of the upload, size of all others, and the limit.
        cause: NoMemory,
    },
    /// The file of a skeleton could not be written or removed.
    #[error("{message}")]
    NotKept {
        /// The name of the skeleton and the reason.
        message: String,
        /// Whether the disk is full.
        is_disk_full: bool,
    },
}

//! What can be wrong with a body.

use crate::robot::RobotError;
use crate::skeleton::SkeletonError;

/// Why a body was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// A field out of its range.
    #[error("{field} is {found}; allowed: {allowed}")]
    Field {
        /// The field's path, such as `skeleton.joints[3].parent`.
        field: String,
        /// What it holds.
        found: String,
        /// What it may hold.
        allowed: String,
    },
    /// A skeleton that contradicts itself in another way.
    #[error("skeleton: {0}")]
    Skeleton(#[from] SkeletonError),
    /// Hinges that do not make a robot of the skeleton.
    #[error("{0}")]
    Robot(#[from] RobotError),
}

impl BodyError {
    pub(super) fn field(field: impl Into<String>, found: impl ToString, allowed: impl Into<String>) -> Self {
        Self::Field {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }
}

//! Errors of bodies.

use crate::robot::RobotError;
use crate::skeleton::SkeletonError;

/// Why a body was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// A field out of its range.
    #[error("{field} is {found}; allowed: {allowed}")]
    Field {
        /// Path of the field, such as `skeleton.joints[3].parent`.
        field: String,
        /// The value that it has.
        found: String,
        /// The values that are allowed.
        allowed: String,
    },
    /// The skeleton contradicts itself in another way.
    #[error("skeleton: {0}")]
    Skeleton(#[from] SkeletonError),
    /// The hinges do not make a robot of the skeleton.
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

//! What can be wrong with a scene, or with what is asked of it.

use troupe_motion::Vec3;

use super::{Holder, MAX_ID_BYTES};

/// Why a scene was not changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A value that is not accepted.
    #[error("{what} is {found}; allowed: {allowed}")]
    Value {
        /// Which value.
        what: String,
        /// What it is.
        found: String,
        /// What it may be.
        allowed: String,
    },
    /// A shape that cannot be used.
    #[error("{what}: {cause}")]
    Shape {
        /// Whose shape.
        what: String,
        /// What is wrong with it.
        cause: ShapeError,
    },
    /// A second instance or collider of one id.
    #[error("the scene has {what} {id:?} already")]
    Exists {
        /// `an object` or `a collider`.
        what: &'static str,
        /// The id.
        id: String,
    },
    /// No object has this id.
    #[error("the scene has no {what} {id:?}")]
    Unknown {
        /// `object` or `collider`.
        what: &'static str,
        /// The id.
        id: String,
    },
    /// More than a scene may have.
    #[error("the scene has {limit} {what}, the most that it may have")]
    Full {
        /// Of what.
        what: &'static str,
        /// How many it may have.
        limit: usize,
    },
    /// Another character reserved or holds the object.
    #[error("object {id:?} is reserved or held by {by}")]
    Taken {
        /// The object.
        id: String,
        /// Who has it.
        by: Holder,
    },
    /// The object is not held by who wants to give it up.
    #[error("object {id:?} is not held by {by}")]
    NotHeld {
        /// The object.
        id: String,
        /// Who wanted to give it up.
        by: Holder,
    },
    /// A held object goes where its holder goes; it is not moved.
    #[error("object {id:?} is held by {by} and cannot be moved until it is released")]
    MoveHeld {
        /// The object.
        id: String,
        /// Who holds it.
        by: Holder,
    },
}

impl SceneError {
    pub(super) fn value(
        what: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Value {
            what: what.into(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }
}

/// What is wrong with a shape.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// A value out of its range, or not finite.
    #[error("{field} is {found}; allowed: {allowed}")]
    Value {
        /// The value's place in the shape, for example `half_extents_m[1]`.
        field: String,
        /// What it is.
        found: String,
        /// What it may be.
        allowed: String,
    },
    /// Points that are all about on one plane, line or place.
    #[error("points_m are flat; allowed: points that span at least {0} m in every direction")]
    Flat(f32),
    /// The points have no convex hull that the collision library can make.
    #[error("points_m have no usable convex hull; allowed: points apart from each other that span a volume")]
    Hull,
}

impl ShapeError {
    pub(super) fn value(
        field: impl Into<String>,
        found: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Value {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }
}

/// Refuses coordinates that are not finite or farther than `limit` from 0.
pub(super) fn coordinates(what: &'static str, v: Vec3, limit: f32) -> Result<(), SceneError> {
    match v
        .to_array()
        .into_iter()
        .zip("xyz".chars())
        .find(|(value, _)| !(-limit..=limit).contains(value))
    {
        Some((value, axis)) => Err(SceneError::value(
            what,
            format!("at {axis} = {value}"),
            format!("-{limit} to {limit} m"),
        )),
        None => Ok(()),
    }
}

/// Refuses an id that is empty or too long.
pub(super) fn id(what: &'static str, id: &str) -> Result<(), SceneError> {
    match id.len() {
        1..=MAX_ID_BYTES => Ok(()),
        found => Err(SceneError::value(
            what,
            format!("{found} bytes long"),
            format!("1 to {MAX_ID_BYTES} bytes"),
        )),
    }
}

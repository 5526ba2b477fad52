//! Errors of scenes and of changes to them.

use troupe_motion::Vec3;

use super::{Holder, MAX_ID_BYTES};

/// Why a scene was not changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A value that is not accepted.
    #[error("{what} is {found}; allowed: {allowed}")]
    Value {
        /// Name of the value.
        what: String,
        /// The value that was given.
        found: String,
        /// The values that are allowed.
        allowed: String,
    },
    /// A shape that cannot be used.
    #[error("{what}: {cause}")]
    Shape {
        /// Whose shape it is, for example `collider "wall"`.
        what: String,
        /// What is wrong with the shape.
        cause: ShapeError,
    },
    /// An instance or collider of this id exists already.
    #[error("the scene has {what} {id:?} already")]
    Exists {
        /// `an object` or `a collider`.
        what: &'static str,
        /// The id that is taken.
        id: String,
    },
    /// No object has this id.
    #[error("the scene has no {what} {id:?}")]
    Unknown {
        /// `object` or `collider`.
        what: &'static str,
        /// The unknown id.
        id: String,
    },
    /// The scene is full.
    #[error("the scene has {limit} {what}, the most that it may have")]
    Full {
        /// What it is full of, for example `colliders`.
        what: &'static str,
        /// The most that a scene may have.
        limit: usize,
    },
    /// Another character reserved or holds the object.
    #[error("object {id:?} is reserved or held by {by}")]
    Taken {
        /// Id of the object in the scene.
        id: String,
        /// The other character.
        by: Holder,
    },
    /// A character releases an object that it does not hold.
    #[error("object {id:?} is not held by {by}")]
    NotHeld {
        /// Id of the object in the scene.
        id: String,
        /// The character that wants to release it.
        by: Holder,
    },
    /// A held object follows its holder, and cannot be moved.
    #[error("object {id:?} is held by {by} and cannot be moved until it is released")]
    MoveHeld {
        /// Id of the object in the scene.
        id: String,
        /// The character that holds it.
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
        /// The value that was given.
        found: String,
        /// The values that are allowed.
        allowed: String,
    },
    /// The points lie almost in a plane, on a line or at one place.
    #[error("points_m are flat; allowed: points that span at least {0} m in every direction")]
    Flat(f32),
    /// The collision library finds no convex hull of the points.
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

/// Refuses coordinates that are not finite, or farther than `limit` from 0.
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

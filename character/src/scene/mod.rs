//! Scenes: what the characters of sessions stand on and may use (paper section 6.2, detection and
//! placement).
//!
//! A [`Scene`] has a ground height, static [`Collider`]s, and object [`Instance`]s that can move,
//! be reserved and be held. It answers two kinds of queries: which instances' trigger volumes a box
//! meets ([`Scene::detect`]), and what a ray or a moving box hits first ([`Scene::cast_ray`],
//! [`Scene::support`], [`Scene::first_solid`]). Shapes and queries come from `parry3d`. Trees of
//! bounding volumes keep the cost of a query, and of a move, to what is near.
//!
//! A scene is a plain value. Sessions share one through a [`SceneCell`]: readers take a snapshot
//! without a lock, and a writer publishes a changed copy, which shares everything that did not
//! change.
//!
//! Scenes are read from TOML or JSON ([`NamedScene::read`], [`load_file`], [`load_folder`]), like
//! the definitions of their objects, which [`Bodies`] finds.
//!
//! Coordinates are native: right-handed, Y up, metres.

mod cell;
mod check;
mod collider;
mod convert;
mod error;
mod heightfield;
mod instance;
mod query;
mod read;
mod replace;
mod resident;
mod scaled;
mod shape;
mod trace;
mod transform;
mod world;
mod write;

#[cfg(test)]
mod query_tests;
#[cfg(test)]
mod read_tests;
#[cfg(any(test, feature = "testing"))]
#[allow(clippy::unwrap_used, reason = "for tests")]
pub mod testing;
#[cfg(test)]
mod world_tests;

pub use cell::{SceneCell, SceneTable, TableError};
pub use check::Bodies;
pub use check::{body_of, field_error, shape_error};
pub use collider::{Collider, ColliderShape};
pub use error::{SceneError, ShapeError};
pub use heightfield::Heightfield;
pub use instance::{Holder, Instance, ObjectBody, State};
pub use query::{Detected, RayHit, Surface};
pub use read::{NamedScene, load_file, load_folder};
pub use resident::Resident;
pub use scaled::ScaledScene;
pub use shape::{Shape, Volume};
pub use trace::BoxTrace;
pub use transform::Transform;
pub use troupe_proto::docs::{
    BoxDoc, ColliderDoc, ColliderShapeDoc, ConvexDoc, HeightfieldDoc, InstanceDoc, SceneDoc, ShapeDoc,
};
pub use world::Scene;

/// The format number of scenes that this server reads.
pub const FORMAT: u32 = 1;
/// Largest scene that is read, bytes.
pub const MAX_BYTES: usize = 8 << 20;
/// Farthest that anything in a scene may be from its origin along an axis, metres.
pub const MAX_COORDINATE_M: f32 = 1e4;
/// Smallest and largest half extent of a box, metres.
pub const HALF_EXTENT_M: std::ops::RangeInclusive<f32> = 1e-3..=1e3;
/// Farthest that a point of a convex shape may be from its own origin along an axis, metres.
pub const MAX_SHAPE_COORDINATE_M: f32 = 1e3;
/// Fewest and most points of a convex shape.
pub const CONVEX_POINTS: std::ops::RangeInclusive<usize> = 4..=64;
/// Least thickness of a convex shape in every direction, metres.
pub const MIN_THICKNESS_M: f32 = 1e-3;
/// Fewest and most rows, and columns, of a heightfield.
pub const HEIGHTFIELD_SIDE: std::ops::RangeInclusive<usize> = 2..=512;
/// Most samples of all heightfields of a scene together.
pub const MAX_HEIGHT_SAMPLES: usize = 1 << 20;
/// Most static colliders of a scene.
pub const MAX_COLLIDERS: usize = 1024;
/// Most object instances of a scene.
pub const MAX_INSTANCES: usize = 4096;
/// Longest id of an instance or collider, and longest name of a scene, bytes.
pub const MAX_ID_BYTES: usize = 128;
/// Most volumes that one query looks at: the first that the tree of bounds gives. A query in an
/// ordinary scene meets a few. Thousands in one place would take longer than a frame.
pub const MAX_CANDIDATES: usize = 256;
/// Most scenes on a server.
pub const MAX_SCENES: usize = 256;
/// Largest difference between a rotation's length and 1.
pub const UNIT_TOLERANCE: f32 = 1e-3;

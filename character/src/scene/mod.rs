//! Scenes: what a session's characters stand on and may use (paper section 6.2, detection and
//! placement).
//!
//! A [`Scene`] has a ground height, static [`Collider`]s and object [`Instance`]s that may move, be
//! reserved and be held. Two questions are asked of it: which instances' trigger volumes a box
//! meets ([`Scene::detect`]), and what a ray, or a box on its way, hits first ([`Scene::cast_ray`],
//! [`Scene::support`], [`Scene::first_solid`]). Shapes and queries are those of `parry3d`; bounding
//! volume trees keep the cost of a question, and of a move, to what is near.
//!
//! A scene is a plain value. Sessions share one through a [`SceneCell`]: readers take a snapshot
//! without a lock, a writer publishes a changed copy that shares all that did not change.
//!
//! Scenes are read from TOML or JSON ([`NamedScene::read`], [`load_file`], [`load_folder`]), as the
//! definitions of their objects are; [`Bodies`] is where they find these.
//!
//! Space is the server's own: right-handed, Y up, metres.

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
pub use instance::{Body, Holder, Instance, State};
pub use query::{Detected, RayHit, Surface};
pub use read::{NamedScene, load_file, load_folder};
pub use resident::Resident;
pub use shape::{Shape, Volume};
pub use trace::BoxTrace;
pub use transform::Transform;
pub use troupe_proto::docs::{
    BoxDoc, ColliderDoc, ColliderShapeDoc, ConvexDoc, HeightfieldDoc, InstanceDoc, SceneDoc, ShapeDoc,
};
pub use world::Scene;

/// Version of the scene format that this server reads.
pub const FORMAT: u32 = 1;
/// Most bytes of a scene that is read.
pub const MAX_BYTES: usize = 8 << 20;
/// Farthest that anything in a scene may be from its origin along an axis, metres.
pub const MAX_COORDINATE_M: f32 = 1e4;
/// Smallest and largest half extent of a box, metres.
pub const HALF_EXTENT_M: std::ops::RangeInclusive<f32> = 1e-3..=1e3;
/// Farthest that a point of a convex shape may be from its own origin along an axis, metres.
pub const MAX_SHAPE_COORDINATE_M: f32 = 1e3;
/// Fewest and most points of a convex shape.
pub const CONVEX_POINTS: std::ops::RangeInclusive<usize> = 4..=64;
/// A convex shape is at least this thick in every direction, metres.
pub const MIN_THICKNESS_M: f32 = 1e-3;
/// Fewest and most rows, and columns, of a heightfield.
pub const HEIGHTFIELD_SIDE: std::ops::RangeInclusive<usize> = 2..=512;
/// Most samples of a scene's heightfields together.
pub const MAX_HEIGHT_SAMPLES: usize = 1 << 20;
/// Most static colliders of a scene.
pub const MAX_COLLIDERS: usize = 1024;
/// Most object instances of a scene.
pub const MAX_INSTANCES: usize = 4096;
/// Most bytes of an instance's or collider's id, or of a scene's name.
pub const MAX_ID_BYTES: usize = 128;
/// Most volumes that one question to a scene looks at: those that the tree of their bounds gives
/// first. A question in ordinary scenes meets a few; thousands in one place would cost more than a
/// frame has.
pub const MAX_CANDIDATES: usize = 256;
/// Most scenes of a server.
pub const MAX_SCENES: usize = 256;
/// How far a rotation's length may be from 1.
pub const UNIT_TOLERANCE: f32 = 1e-3;

//! Static colliders: what characters stand on, and what blocks their way.

use std::sync::Arc;

use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use troupe_motion::Vec3;

use super::error::{self, SceneError, ShapeError};
use super::heightfield::Heightfield;
use super::{MAX_COLLIDERS, MAX_HEIGHT_SAMPLES, Shape, Transform, Volume};

/// Largest difference between 1 and the cosine of a heightfield's tilt.
const UPRIGHT_TOLERANCE: f32 = 1e-6;

/// Rough memory of a collider, bytes: of its own, for each point of a hull (with edges and faces),
/// and for each sample of a heightfield.
const COLLIDER_BYTES: usize = 512;
const POINT_BYTES: usize = 512;
const SAMPLE_BYTES: usize = 16;

/// A static collider as it was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Collider {
    /// Unique among the scene's colliders.
    pub id: String,
    /// A solid shape, or a heightfield.
    pub shape: ColliderShape,
    /// Place in the world; a heightfield must be upright.
    pub transform: Transform,
}

/// The shape of a static collider.
#[derive(Debug, Clone, PartialEq)]
pub enum ColliderShape {
    /// A box or a convex hull.
    Solid(Shape),
    /// Uneven ground.
    Heightfield(Heightfield),
}

impl Collider {
    /// Its transform, checked: a heightfield must be upright.
    fn place(&self) -> Result<Transform, SceneError> {
        let transform = self.transform.checked("the transform of a collider")?;
        let up = transform.rotation * Vec3::Y;
        if matches!(self.shape, ColliderShape::Heightfield(_)) && up.y < 1.0 - UPRIGHT_TOLERANCE {
            return Err(SceneError::value(
                format!("heightfield {:?}", self.id),
                format!(
                    "tilted by {:.1} degrees",
                    up.y.clamp(-1.0, 1.0).acos().to_degrees()
                ),
                "a rotation about +Y alone",
            ));
        }
        Ok(transform)
    }
}

impl ColliderShape {
    fn volume(&self) -> Result<Volume, ShapeError> {
        match self {
            Self::Solid(shape) => Volume::new(shape),
            Self::Heightfield(field) => field.volume(),
        }
    }

    /// A rough measure of its memory as written and ready for queries, bytes.
    fn bytes(&self) -> usize {
        let points = match self {
            Self::Solid(Shape::Convex { points_m }) => points_m.len(),
            Self::Solid(Shape::Box { .. }) | Self::Heightfield(_) => 0,
        };
        COLLIDER_BYTES + points * POINT_BYTES + self.samples() * SAMPLE_BYTES
    }

    fn samples(&self) -> usize {
        match self {
            Self::Solid(_) => 0,
            Self::Heightfield(field) => field.heights_m.len(),
        }
    }
}

/// One static collider, ready for queries.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    /// As it was written.
    pub(super) source: Arc<Collider>,
    pub(super) id: Arc<str>,
    pub(super) volume: Volume,
    pub(super) transform: Transform,
    samples: usize,
}

impl Placed {
    /// Checks and prepares a collider.
    pub(super) fn new(collider: Arc<Collider>) -> Result<Self, SceneError> {
        error::id("the id of a collider", &collider.id)?;
        let of = |cause| SceneError::Shape {
            what: format!("collider {:?}", collider.id),
            cause,
        };
        Ok(Self {
            id: Arc::from(collider.id.as_str()),
            volume: collider.shape.volume().map_err(of)?,
            transform: collider.place()?,
            samples: collider.shape.samples(),
            source: collider,
        })
    }
}

/// All static colliders of a scene.
#[derive(Debug, Clone, Default)]
pub(super) struct Colliders {
    pub(super) list: Vec<Placed>,
    pub(super) tree: Bvh,
}

impl Colliders {
    /// Checks and prepares colliders. An error about a single collider comes with its index.
    pub(super) fn prepare(colliders: &[Collider]) -> Result<Vec<Placed>, (Option<usize>, SceneError)> {
        Self::check_together(colliders).map_err(|error| (None, error))?;
        let place = |(index, collider): (usize, &Collider)| {
            Placed::new(Arc::new(collider.clone())).map_err(|error| (Some(index), error))
        };
        colliders.iter().enumerate().map(place).collect()
    }

    /// Checks what concerns all colliders together.
    fn check_together(colliders: &[Collider]) -> Result<(), SceneError> {
        if colliders.len() > MAX_COLLIDERS {
            return Err(SceneError::value(
                "colliders",
                format!("{} colliders", colliders.len()),
                format!("at most {MAX_COLLIDERS}"),
            ));
        }
        let samples: usize = colliders.iter().map(|collider| collider.shape.samples()).sum();
        if samples > MAX_HEIGHT_SAMPLES {
            return Err(SceneError::value(
                "the heightfields of a scene",
                format!("{samples} samples"),
                format!("at most {MAX_HEIGHT_SAMPLES} in total"),
            ));
        }
        let mut ids = std::collections::HashSet::with_capacity(colliders.len());
        if let Some(twice) = colliders.iter().find(|collider| !ids.insert(&collider.id)) {
            return Err(SceneError::Exists {
                what: "a collider",
                id: twice.id.clone(),
            });
        }
        Ok(())
    }

    /// The colliders of a scene, each already checked.
    pub(super) fn new(list: Vec<Placed>) -> Self {
        let bounds: Vec<Aabb> = list
            .iter()
            .map(|placed| placed.volume.aabb(placed.transform))
            .collect();
        Self {
            list,
            tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds),
        }
    }

    /// A rough measure of their memory, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.list.iter().map(|placed| placed.source.shape.bytes()).sum()
    }

    /// Total number of height samples.
    pub(super) fn samples(&self) -> usize {
        self.list.iter().map(|placed| placed.samples).sum()
    }
}

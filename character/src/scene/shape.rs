//! Shapes as written, and volumes as queries use them.

use std::fmt;

use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::shape::{ConvexPolyhedron, Cuboid, SharedShape};
use troupe_motion::Vec3;

use super::convert::{pose, vec3, vector};
use super::error::ShapeError;
use super::{
    BoxDoc, CONVEX_POINTS, ConvexDoc, HALF_EXTENT_M, MAX_SHAPE_COORDINATE_M, MIN_THICKNESS_M, ShapeDoc,
    Transform,
};

/// A convex shape in the frame of reference of its owner.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A box whose edges are parallel to the axes.
    Box {
        /// Middle of the box, metres.
        center_m: Vec3,
        /// Half its size along each axis, metres.
        half_extents_m: Vec3,
    },
    /// The convex hull of points.
    Convex {
        /// The points, metres.
        points_m: Vec<Vec3>,
    },
}

impl From<&BoxDoc> for Shape {
    /// The shape as written, without checks.
    fn from(doc: &BoxDoc) -> Self {
        Self::Box {
            center_m: doc.center_m.into(),
            half_extents_m: doc.half_extents_m.into(),
        }
    }
}

impl From<&ConvexDoc> for Shape {
    /// The shape as written, without checks.
    fn from(doc: &ConvexDoc) -> Self {
        Self::Convex {
            points_m: doc.points_m.iter().copied().map(Into::into).collect(),
        }
    }
}

impl From<&ShapeDoc> for Shape {
    /// The shape as written, without checks.
    fn from(doc: &ShapeDoc) -> Self {
        match doc {
            ShapeDoc::Box(shape) => shape.into(),
            ShapeDoc::Convex(shape) => shape.into(),
        }
    }
}

/// A shape ready for queries. Cloning is cheap.
#[derive(Clone)]
pub struct Volume {
    shape: SharedShape,
    /// Origin of the library's shape; inside of a convex one.
    offset: Vec3,
}

impl Shape {
    /// Checks the shape's values.
    ///
    /// # Errors
    /// [`ShapeError::Value`] for a value out of its range, [`ShapeError::Flat`] for points without
    /// a volume.
    pub fn check(&self) -> Result<(), ShapeError> {
        match self {
            Self::Box {
                center_m,
                half_extents_m,
            } => {
                each_axis(
                    "center_m",
                    *center_m,
                    -MAX_SHAPE_COORDINATE_M,
                    MAX_SHAPE_COORDINATE_M,
                )?;
                let (low, high) = (*HALF_EXTENT_M.start(), *HALF_EXTENT_M.end());
                each_axis("half_extents_m", *half_extents_m, low, high)
            }
            Self::Convex { points_m } => {
                let (low, high) = (CONVEX_POINTS.start(), CONVEX_POINTS.end());
                if !CONVEX_POINTS.contains(&points_m.len()) {
                    return Err(ShapeError::value(
                        "points_m",
                        format!("{} points", points_m.len()),
                        format!("{low} to {high} points"),
                    ));
                }
                for (index, &point) in points_m.iter().enumerate() {
                    let limit = MAX_SHAPE_COORDINATE_M;
                    each_axis(&format!("points_m[{index}]"), point, -limit, limit)?;
                }
                match thickness(points_m) >= MIN_THICKNESS_M {
                    true => Ok(()),
                    false => Err(ShapeError::Flat(MIN_THICKNESS_M)),
                }
            }
        }
    }

    /// The shape grown by `reach_m` on every side along the axes: every point at most that far from
    /// the shape along each axis.
    pub fn grown(&self, reach_m: f32) -> Self {
        match self {
            Self::Box {
                center_m,
                half_extents_m,
            } => Self::Box {
                center_m: *center_m,
                half_extents_m: *half_extents_m + Vec3::splat(reach_m),
            },
            Self::Convex { points_m } => Self::Convex {
                points_m: points_m
                    .iter()
                    .flat_map(|&point| corners(point, Vec3::splat(reach_m)))
                    .collect(),
            },
        }
    }
}

/// The corners of a box around `center`.
fn corners(center: Vec3, half: Vec3) -> impl Iterator<Item = Vec3> {
    (0..8).map(move |corner| {
        let side = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
        center + half * Vec3::new(side(1), side(2), side(4))
    })
}

fn each_axis(field: &str, v: Vec3, low: f32, high: f32) -> Result<(), ShapeError> {
    for (axis, value) in v.to_array().into_iter().enumerate() {
        if !(low..=high).contains(&value) {
            let allowed = format!("{low} to {high} m");
            return Err(ShapeError::value(format!("{field}[{axis}]"), value, allowed));
        }
    }
    Ok(())
}

/// Largest distance of the points to a plane through three of them: the farthest pair and the point
/// farthest from its line. 0 if there is no such plane.
fn thickness(points: &[Vec3]) -> f32 {
    let Some(&a) = points.first() else {
        return 0.0;
    };
    let farthest = |measure: &dyn Fn(Vec3) -> f32| {
        points
            .iter()
            .copied()
            .max_by(|&p, &q| measure(p).total_cmp(&measure(q)))
            .unwrap_or(a)
    };
    let b = farthest(&|p| p.distance_squared(a));
    let Some(line) = (b - a).try_normalize() else {
        return 0.0;
    };
    let off_line = |p: Vec3| (p - a) - line * (p - a).dot(line);
    let c = farthest(&|p| off_line(p).length_squared());
    if off_line(c).length() < MIN_THICKNESS_M {
        return 0.0;
    }
    let Some(normal) = line.cross(off_line(c)).try_normalize() else {
        return 0.0;
    };
    let side = |p: Vec3| (p - a).dot(normal);
    points.iter().map(|&p| side(p)).fold(0.0, f32::max) - points.iter().map(|&p| side(p)).fold(0.0, f32::min)
}

impl Volume {
    /// Prepares `shape` for queries.
    ///
    /// # Errors
    /// [`ShapeError`] if [`Shape::check`] refuses it, or its points have no hull.
    pub fn new(shape: &Shape) -> Result<Self, ShapeError> {
        shape.check()?;
        Self::build(shape)
    }

    /// Prepares `shape` grown by `reach_m` (see [`Shape::grown`]), at least 0.
    ///
    /// # Errors
    /// As [`Volume::new`].
    pub fn grown(shape: &Shape, reach_m: f32) -> Result<Self, ShapeError> {
        shape.check()?;
        Self::build(&shape.grown(reach_m))
    }

    fn build(shape: &Shape) -> Result<Self, ShapeError> {
        match shape {
            Shape::Box {
                center_m,
                half_extents_m,
            } => Ok(Self::from_shape(
                SharedShape::new(Cuboid::new(vector(*half_extents_m))),
                *center_m,
            )),
            Shape::Convex { points_m } => {
                // About the middle, so that a large offset costs no precision.
                let middle = points_m.iter().copied().sum::<Vec3>() / points_m.len().max(1) as f32;
                let points: Vec<Vector> = points_m.iter().map(|&point| vector(point - middle)).collect();
                let hull = convex_hull(&points).ok_or(ShapeError::Hull)?;
                Ok(Self::from_shape(SharedShape::new(hull), middle))
            }
        }
    }

    pub(super) fn from_shape(shape: SharedShape, offset: Vec3) -> Self {
        Self { shape, offset }
    }

    pub(super) fn shape(&self) -> &dyn parry3d::shape::Shape {
        &*self.shape
    }

    pub(super) fn pose(&self, at: Transform) -> parry3d::math::Pose {
        pose(Transform::new(at.point(self.offset), at.rotation))
    }

    pub(super) fn aabb(&self, at: Transform) -> Aabb {
        self.shape.compute_aabb(&self.pose(at))
    }

    /// A point well inside, in the volume's own frame of reference: the middle of a box, the mean
    /// of a hull's points, the origin of a heightfield.
    pub fn center(&self) -> Vec3 {
        self.offset
    }

    /// The least `direction · point` of all points of the volume placed at `at`. `None` for a
    /// heightfield.
    pub fn lowest_along(&self, at: Transform, direction: Vec3) -> Option<f32> {
        let support = self.shape.as_support_map()?;
        let lowest = support.support_point(&self.pose(at), vector(-direction));
        Some(vec3(lowest).dot(direction))
    }

    /// Whether `point` of the world is in the volume placed at `at`.
    pub fn contains(&self, at: Transform, point: Vec3) -> bool {
        self.shape.contains_point(&self.pose(at), vector(point))
    }
}

/// The hull of points that span a volume. The library asserts its own intermediate results. Points
/// that are nearly coplanar, to a thousandth, can break these; here that is an error like any
/// other.
fn convex_hull(points: &[Vector]) -> Option<ConvexPolyhedron> {
    std::panic::catch_unwind(|| ConvexPolyhedron::from_convex_hull(points))
        .ok()
        .flatten()
}

impl fmt::Debug for Volume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Volume")
            .field("shape", &self.shape.shape_type())
            .field("offset", &self.offset)
            .finish()
    }
}

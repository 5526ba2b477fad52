//! Shapes of colliders as messages, and back.

use troupe_motion::Vec3;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use crate::wire::units::{self, position};
use troupe_character::scene::{
    CONVEX_POINTS, ColliderShape, HALF_EXTENT_M, HEIGHTFIELD_SIDE, Heightfield, MAX_SHAPE_COORDINATE_M, Shape,
};
use troupe_character::{FieldError, Path};

/// Checks a shape's values and makes it native.
pub(super) fn read(
    path: &Path<'_>,
    shape: Option<&v1::ColliderShape>,
    convention: Convention,
) -> Result<ColliderShape, FieldError> {
    let wanted = "exactly one of box, convex and heightfield";
    let Some(shape) = shape else {
        return Err(path.error("is missing", wanted));
    };
    match (&shape.r#box, &shape.convex, &shape.heightfield) {
        (Some(shape), None, None) => read_box(&path.field("box"), shape, convention),
        (None, Some(shape), None) => read_convex(&path.field("convex"), shape, convention),
        (None, None, Some(shape)) => {
            read_heightfield(&path.field("heightfield"), shape, convention.units_per_metre())
        }
        (None, None, None) => Err(path.error("has no shape", wanted)),
        _ => Err(path.error("has more than one shape", wanted)),
    }
}

fn read_box(
    path: &Path<'_>,
    shape: &v1::BoxShape,
    convention: Convention,
) -> Result<ColliderShape, FieldError> {
    let center = shape.center.unwrap_or_default();
    Ok(ColliderShape::Solid(Shape::Box {
        center_m: units::vector(&path.field("center"), center, MAX_SHAPE_COORDINATE_M, convention)?,
        half_extents_m: half_extents(&path.field("half_extents"), shape.half_extents, convention)?,
    }))
}

/// Checks half the size of a box along each axis.
pub(super) fn half_extents(
    path: &Path<'_>,
    half: Option<v1::Vec3>,
    convention: Convention,
) -> Result<Vec3, FieldError> {
    let half = half.unwrap_or_default();
    let unit = convention.units_per_metre();
    let (low, high) = (HALF_EXTENT_M.start() * unit, HALF_EXTENT_M.end() * unit);
    for (name, value) in [("x", half.x), ("y", half.y), ("z", half.z)] {
        units::within(&path.field(name), value, low, high)?;
    }
    // The conversion may flip axes, but a size has no sign.
    Ok(convention
        .position_to_native(Vec3::new(half.x, half.y, half.z))
        .abs())
}

fn read_convex(
    path: &Path<'_>,
    shape: &v1::ConvexShape,
    convention: Convention,
) -> Result<ColliderShape, FieldError> {
    let (low, high) = (*CONVEX_POINTS.start(), *CONVEX_POINTS.end());
    units::length(&path.field("points"), shape.points.len(), low, high)?;
    let point = |(index, &point): (usize, &v1::Vec3)| {
        let path = path.element("points", index);
        units::vector(&path, point, MAX_SHAPE_COORDINATE_M, convention)
    };
    let points_m = shape
        .points
        .iter()
        .enumerate()
        .map(point)
        .collect::<Result<_, _>>()?;
    Ok(ColliderShape::Solid(Shape::Convex { points_m }))
}

fn read_heightfield(
    path: &Path<'_>,
    shape: &v1::HeightfieldShape,
    unit: f32,
) -> Result<ColliderShape, FieldError> {
    let side = |name, count: u32| {
        let (low, high) = (*HEIGHTFIELD_SIDE.start() as u32, *HEIGHTFIELD_SIDE.end() as u32);
        units::count_within(&path.field(name), count, low, high).map(|count| count as usize)
    };
    let (rows, columns) = (side("rows", shape.rows)?, side("columns", shape.columns)?);
    let size = |name, size: f32| {
        let (low, high) = (1e-3 * unit, 2.0 * MAX_SHAPE_COORDINATE_M * unit);
        units::within(&path.field(name), size, low, high).map(|size| size / unit)
    };
    let size_m = [size("width", shape.width)?, size("depth", shape.depth)?];
    let (found, wanted) = (shape.heights.len(), rows * columns);
    if found != wanted {
        return Err(path.field("heights").error(
            format!("has {found} entries"),
            format!("rows x columns, {wanted}"),
        ));
    }
    let limit = MAX_SHAPE_COORDINATE_M * unit;
    let height = |(index, &height): (usize, &f32)| {
        units::within(&path.element("heights", index), height, -limit, limit).map(|height| height / unit)
    };
    let heights_m = shape
        .heights
        .iter()
        .enumerate()
        .map(height)
        .collect::<Result<_, _>>()?;
    Ok(ColliderShape::Heightfield(Heightfield {
        rows,
        columns,
        size_m,
        heights_m,
    }))
}

/// The message of a shape.
pub(super) fn write(shape: &ColliderShape, convention: Convention) -> v1::ColliderShape {
    let mut message = v1::ColliderShape::default();
    match shape {
        ColliderShape::Solid(Shape::Box {
            center_m,
            half_extents_m,
        }) => {
            let half = convention.position_from_native(*half_extents_m).abs();
            message.r#box = Some(v1::BoxShape {
                center: Some(position(*center_m, convention)),
                half_extents: Some(v1::Vec3 {
                    x: half.x,
                    y: half.y,
                    z: half.z,
                }),
            });
        }
        ColliderShape::Solid(Shape::Convex { points_m }) => {
            let points = points_m.iter().map(|&point| position(point, convention));
            message.convex = Some(v1::ConvexShape {
                points: points.collect(),
            });
        }
        ColliderShape::Heightfield(field) => {
            let unit = convention.units_per_metre();
            let [width, depth] = field.size_m.map(|size| size * unit);
            message.heightfield = Some(v1::HeightfieldShape {
                rows: field.rows as u32,
                columns: field.columns as u32,
                width,
                depth,
                heights: field.heights_m.iter().map(|height| height * unit).collect(),
            });
        }
    }
    message
}

//! Heightfields: uneven ground.

use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast as _};
use parry3d::shape::{HeightField, SharedShape};
use parry3d::utils::Array2;
use troupe_motion::Vec3;

use super::convert::vector;
use super::error::ShapeError;
use super::{HEIGHTFIELD_SIDE, HeightfieldDoc, MAX_SHAPE_COORDINATE_M, Volume};

/// If a ray hits nothing, rays at this distance beside it are tried, metres. It is less than the
/// precision of any placement.
const CRACK_M: f32 = 1e-4;

/// Heights over a grid in the x-z plane, centred on the origin. A cell between samples is two
/// triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Heightfield {
    /// Samples along z, 2 to 512.
    pub rows: usize,
    /// Samples along x, 2 to 512.
    pub columns: usize,
    /// Size along x and z, metres.
    pub size_m: [f32; 2],
    /// `rows * columns` heights in metres, row by row. The first row has the lowest z, and its
    /// first sample the lowest x.
    pub heights_m: Vec<f32>,
}

impl From<&HeightfieldDoc> for Heightfield {
    /// The heightfield as written, without checks.
    fn from(doc: &HeightfieldDoc) -> Self {
        Self {
            rows: doc.rows,
            columns: doc.columns,
            size_m: doc.size_m,
            heights_m: doc.heights_m.clone(),
        }
    }
}

impl Heightfield {
    /// Checks the number of samples, the size and the heights.
    ///
    /// # Errors
    /// [`ShapeError::Value`] for the first value out of its range.
    pub fn check(&self) -> Result<(), ShapeError> {
        let (low, high) = (HEIGHTFIELD_SIDE.start(), HEIGHTFIELD_SIDE.end());
        for (field, side) in [("rows", self.rows), ("columns", self.columns)] {
            if !HEIGHTFIELD_SIDE.contains(&side) {
                return Err(ShapeError::value(field, side, format!("{low} to {high}")));
            }
        }
        for (axis, size) in self.size_m.into_iter().enumerate() {
            if !(1e-3..=2.0 * MAX_SHAPE_COORDINATE_M).contains(&size) {
                let allowed = format!("0.001 to {} m", 2.0 * MAX_SHAPE_COORDINATE_M);
                return Err(ShapeError::value(format!("size_m[{axis}]"), size, allowed));
            }
        }
        if self.heights_m.len() != self.rows * self.columns {
            return Err(ShapeError::value(
                "heights_m",
                format!("{} heights", self.heights_m.len()),
                format!("rows x columns = {} heights", self.rows * self.columns),
            ));
        }
        let limit = MAX_SHAPE_COORDINATE_M;
        let fits = |height: &f32| (-limit..=limit).contains(height);
        match self.heights_m.iter().position(|height| !fits(height)) {
            Some(index) => Err(ShapeError::value(
                format!("heights_m[{index}]"),
                self.heights_m[index],
                format!("-{limit} to {limit} m"),
            )),
            None => Ok(()),
        }
    }

    pub(super) fn volume(&self) -> Result<Volume, ShapeError> {
        self.check()?;
        // The library stores columns.
        let columns = (0..self.columns)
            .flat_map(|column| (0..self.rows).map(move |row| row * self.columns + column))
            .map(|index| self.heights_m[index])
            .collect();
        let heights = Array2::new(self.rows, self.columns, columns);
        let scale = Vec3::new(self.size_m[0], 1.0, self.size_m[1]);
        let field = HeightField::new(heights, vector(scale));
        Ok(Volume::from_shape(SharedShape::new(field), Vec3::ZERO))
    }
}

/// Where a ray in the field's frame of reference first hits its surface, and the surface's normal
/// there.
///
/// A ray straight down takes the height below it. The library tests triangle by triangle, and loses
/// rays along the edge between two. If it finds nothing, rays slightly beside are tried.
pub(super) fn cast_ray(field: &HeightField, ray: &Ray, reach: f32) -> Option<(f32, Vector)> {
    if ray.dir.y < 0.0 && ray.dir.x.hypot(ray.dir.z) < 1e-6 * -ray.dir.y {
        let (height, normal) = surface_at(field, ray.origin.x, ray.origin.z)?;
        let distance = (ray.origin.y - height) / -ray.dir.y;
        return (0.0..=reach).contains(&distance).then_some((distance, normal));
    }
    let side = ray.dir.cross(Vector::Y).normalize_or_zero();
    let beside = [
        Vector::ZERO,
        side,
        -side,
        side.cross(ray.dir),
        ray.dir.cross(side),
    ];
    beside.into_iter().find_map(|shift| {
        let shifted = Ray::new(ray.origin + shift * CRACK_M, ray.dir);
        let hit = field.cast_local_ray_and_get_normal(&shifted, reach, true)?;
        Some((hit.time_of_impact, hit.normal))
    })
}

/// Height and upward normal of the surface over a place. `None` beside the field.
fn surface_at(field: &HeightField, x: f32, z: f32) -> Option<(f32, Vector)> {
    let scale = field.scale();
    let (columns, rows) = (field.ncols(), field.nrows());
    let along = |value: f32, size: f32, cells: usize| {
        let share = value / size + 0.5;
        let cell = (share * cells as f32).clamp(0.0, cells as f32);
        // Slightly beyond an edge counts as the edge.
        let inside = (-CRACK_M..=size + CRACK_M).contains(&(share * size));
        let first = (cell as usize).min(cells - 1);
        inside.then_some((first, cell - first as f32))
    };
    let (column, u) = along(x, scale.x, columns)?;
    let (row, v) = along(z, scale.z, rows)?;
    let heights = field.heights();
    let at = |r: usize, c: usize| heights[(row + r, column + c)] * scale.y;
    // The library's two triangles: the diagonal goes from the second row's first sample to the
    // first row's second.
    let (height, by_u, by_v) = if u + v <= 1.0 {
        let (by_u, by_v) = (at(0, 1) - at(0, 0), at(1, 0) - at(0, 0));
        (at(0, 0) + u * by_u + v * by_v, by_u, by_v)
    } else {
        let (by_u, by_v) = (at(1, 1) - at(1, 0), at(1, 1) - at(0, 1));
        (at(1, 1) - (1.0 - u) * by_u - (1.0 - v) * by_v, by_u, by_v)
    };
    let slope_x = by_u * columns as f32 / scale.x;
    let slope_z = by_v * rows as f32 / scale.z;
    Some((height, Vector::new(-slope_x, 1.0, -slope_z).normalize()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hills(heights: Vec<f32>) -> HeightField {
        let field = Heightfield {
            rows: 4,
            columns: 5,
            size_m: [4.0, 3.0],
            heights_m: heights,
        };
        field.volume().unwrap().shape().as_heightfield().unwrap().clone()
    }

    /// A place on the lines of the grid, or between them, equally often.
    fn any_place(half: f32) -> impl Strategy<Value = f32> {
        prop_oneof![
            -half..half,
            (0..=(2.0 * half) as i32).prop_map(move |step| step as f32 - half)
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        /// A ray from above the surface to below it hits it on the way.
        #[test]
        fn rays_do_not_fall_through(
            heights in prop::collection::vec(-1.0_f32..1.0, 20),
            (x, z) in (any_place(2.0), any_place(1.5)),
            (to_x, to_z) in (any_place(2.0), any_place(1.5)),
        ) {
            let field = hills(heights);
            let (from, to) = (Vector::new(x, 2.0, z), Vector::new(to_x, -2.0, to_z));
            let way = (to - from).length();
            let ray = Ray::new(from, (to - from) / way);
            let (distance, normal) = cast_ray(&field, &ray, way).unwrap();
            let hit = ray.point_at(distance);
            let (height, _) = surface_at(&field, hit.x, hit.z).unwrap();
            prop_assert!((hit.y - height).abs() < 5e-3, "{} {}", hit.y, height);
            prop_assert!((normal.length() - 1.0).abs() < 1e-3);
            // First, a point well before the hit is above the surface.
            let before = ray.point_at(distance * 0.5);
            prop_assert!(before.y > surface_at(&field, before.x, before.z).unwrap().0 - 5e-3 || distance < 1e-2);
        }

        /// The height at a place is that of the library's triangle.
        #[test]
        fn heights_are_those_of_the_triangles(
            heights in prop::collection::vec(-1.0_f32..1.0, 20),
            x in -1.99_f32..1.99,
            z in -1.49_f32..1.49,
        ) {
            let field = hills(heights);
            let ray = Ray::new(Vector::new(x, 5.0, z), Vector::NEG_Y);
            let (height, normal) = surface_at(&field, x, z).unwrap();
            if let Some(hit) = field.cast_local_ray_and_get_normal(&ray, 20.0, true) {
                prop_assert!((5.0 - hit.time_of_impact - height).abs() < 1e-4);
                prop_assert!((hit.normal - normal).length() < 1e-3 || (hit.normal + normal).length() < 1e-3);
            }
        }
    }

    #[test]
    fn beside_the_field_there_is_nothing() {
        let field = hills(vec![0.5; 20]);
        for (x, z) in [(2.1, 0.0), (-2.1, 0.0), (0.0, 1.6), (0.0, -1.6), (f32::NAN, 0.0)] {
            assert!(surface_at(&field, x, z).is_none(), "{x} {z}");
        }
        assert_eq!(surface_at(&field, 2.0, -1.5).unwrap().0, 0.5);
        let up = Ray::new(Vector::new(0.0, 1.0, 0.0), Vector::Y);
        assert!(cast_ray(&field, &up, 9.0).is_none());
        let below = Ray::new(Vector::new(0.0, 0.4, 0.0), Vector::NEG_Y);
        assert!(cast_ray(&field, &below, 9.0).is_none());
    }
}

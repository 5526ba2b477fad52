//! Shapes of a scene as flat faces that can be drawn.

use glam::{Quat, Vec2, Vec3};
use troupe_proto::v1;

use crate::graphics::canvas::{Canvas, Ink, Point};

/// Most cells of a heightfield that are drawn along each of its sides.
const CELLS: u32 = 16;

/// A flat piece of a surface: a convex polygon.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Face {
    /// Its corners in order.
    pub(crate) corners: Vec<Vec3>,
    /// Outward.
    pub(crate) normal: Vec3,
}

/// A shape by its faces, metres, native convention.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Solid {
    pub(crate) faces: Vec<Face>,
}

/// Colours of a solid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Paint {
    pub(crate) fill: Ink,
    pub(crate) line: Ink,
}

impl Paint {
    /// The same, with an opacity.
    pub(crate) fn alpha(self, alpha: f32) -> Self {
        Self {
            fill: self.fill.alpha(alpha),
            line: self.line.alpha(alpha.sqrt()),
        }
    }
}

impl Solid {
    /// A box by its middle and half its size.
    pub(crate) fn cuboid(center: Vec3, half_extents: Vec3) -> Self {
        let corners = (0..8).map(|i| {
            let sign = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            center + half_extents * Vec3::new(sign(0), sign(1), sign(2))
        });
        Self::hull(&corners.collect::<Vec<_>>())
    }

    /// The convex hull of points. They are few, so every plane through three of them is tried.
    pub(crate) fn hull(points: &[Vec3]) -> Self {
        let mut faces = Vec::<Face>::new();
        for (i, &a) in points.iter().enumerate() {
            for (j, &b) in points.iter().enumerate().skip(i + 1) {
                for &c in &points[j + 1..] {
                    faces.extend(outer(points, [a, b, c]).filter(|face| !has(&faces, face)));
                }
            }
        }
        Self { faces }
    }

    /// Heights over a grid around the origin, as four-cornered faces.
    fn heightfield(field: &v1::HeightfieldShape) -> Self {
        let (rows, columns) = (field.rows.max(2), field.columns.max(2));
        let at = |row: u32, column: u32| {
            let height = field.heights.get((row * columns + column) as usize);
            let share = |i: u32, of: u32| i as f32 / (of - 1) as f32 - 0.5;
            Vec3::new(
                share(column, columns) * field.width,
                height.copied().unwrap_or_default(),
                share(row, rows) * field.depth,
            )
        };
        let steps = |of: u32| {
            let cells = (of - 1).min(CELLS);
            (0..=cells).map(|i| (of - 1) * i / cells).collect::<Vec<_>>()
        };
        let (row_steps, column_steps) = (steps(rows), steps(columns));
        let faces = row_steps.windows(2).flat_map(|r| {
            column_steps.windows(2).map(move |c| {
                let corners = vec![at(r[0], c[0]), at(r[1], c[0]), at(r[1], c[1]), at(r[0], c[1])];
                let normal = (corners[2] - corners[0]).cross(corners[3] - corners[1]);
                let normal = normal.normalize_or_zero();
                Face { corners, normal }
            })
        });
        Self {
            faces: faces.collect(),
        }
    }

    /// A collider's shape in its own frame.
    pub(crate) fn of_shape(shape: &v1::ColliderShape) -> Self {
        let vector = |v: v1::Vec3| Vec3::new(v.x, v.y, v.z);
        if let Some(of) = &shape.r#box {
            let half_extents = of.half_extents.map(vector).unwrap_or_default();
            return Self::cuboid(of.center.map(vector).unwrap_or_default(), half_extents);
        }
        if let Some(of) = &shape.convex {
            return Self::hull(&of.points.iter().copied().map(vector).collect::<Vec<_>>());
        }
        shape
            .heightfield
            .as_ref()
            .map(Self::heightfield)
            .unwrap_or_default()
    }

    /// The same turned and then moved.
    pub(crate) fn placed(&self, position: Vec3, rotation: Quat) -> Self {
        let place = |face: &Face| Face {
            corners: face.corners.iter().map(|&p| position + rotation * p).collect(),
            normal: rotation * face.normal,
        };
        Self {
            faces: self.faces.iter().map(place).collect(),
        }
    }

    /// All corners, some of them more than once.
    pub(crate) fn corners(&self) -> impl Iterator<Item = Vec3> {
        self.faces.iter().flat_map(|face| face.corners.iter().copied())
    }

    /// Least and greatest corner of the box around it.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        self.corners()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(least, most), p| {
                (least.min(p), most.max(p))
            })
    }

    /// Distance of a place from the box around it along the ground, metres.
    pub(crate) fn distance(&self, place: Vec3) -> f32 {
        let (least, most) = self.bounds();
        let off = place - place.clamp(least, most.max(least));
        Vec2::new(off.x, off.z).length()
    }

    /// Height of its upper side over a place, if it is over that place.
    pub(crate) fn top_at(&self, place: Vec3) -> Option<f32> {
        let upper = self.faces.iter().filter(|face| face.normal.y > 0.1);
        let heights = upper.filter_map(|face| {
            let side = |[a, b]: [Vec3; 2]| (b - a).z * (place - a).x - (b - a).x * (place - a).z;
            // Corners go one way around or the other.
            let inside = edges(&face.corners).all(|edge| side(edge) >= -1e-6)
                || edges(&face.corners).all(|edge| side(edge) <= 1e-6);
            let first = *face.corners.first()?;
            let off = face.normal.x * (place.x - first.x) + face.normal.z * (place.z - first.z);
            inside.then_some(first.y - off / face.normal.y)
        });
        heights.max_by(f32::total_cmp)
    }

    /// Draws the faces that the viewer sees: those whose normal `is_seen`.
    pub(crate) fn draw(
        &self,
        canvas: &mut Canvas,
        paint: Paint,
        is_seen: impl Fn(Vec3) -> bool,
        pixel: impl Fn(Vec3) -> Point,
    ) {
        for face in self.faces.iter().filter(|face| is_seen(face.normal)) {
            let corners = face.corners.iter().map(|&p| pixel(p)).collect::<Vec<_>>();
            canvas.polygon(&corners, paint.fill, paint.line, 1.2);
        }
    }
}

/// The sides of a polygon.
fn edges(corners: &[Vec3]) -> impl Iterator<Item = [Vec3; 2]> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&a, &b)| [a, b])
}

/// The hull's face through three of its points, if they lie on one.
fn outer(points: &[Vec3], [a, b, c]: [Vec3; 3]) -> Option<Face> {
    let normal = (b - a).cross(c - a).try_normalize()?;
    let off = |p: &Vec3| normal.dot(*p - a);
    let (least, most) = points
        .iter()
        .map(off)
        .fold((0.0_f32, 0.0_f32), |(l, m), o| (l.min(o), m.max(o)));
    let normal = match (least > -FLAT_M, most < FLAT_M) {
        (_, true) => normal,
        (true, false) => -normal,
        (false, false) => return None,
    };
    let on_it = points
        .iter()
        .copied()
        .filter(|p| normal.dot(*p - a).abs() < FLAT_M);
    let mut corners = on_it.collect::<Vec<_>>();
    let middle = corners.iter().sum::<Vec3>() / corners.len() as f32;
    let (right, up) = normal.any_orthonormal_pair();
    let angle = |p: Vec3| up.dot(p - middle).atan2(right.dot(p - middle));
    corners.sort_by(|&p, &q| angle(p).total_cmp(&angle(q)));
    Some(Face { corners, normal })
}

/// Points nearer to a plane than this are on it, metres.
const FLAT_M: f32 = 1e-4;

/// Whether a plane's face is among these.
fn has(faces: &[Face], face: &Face) -> bool {
    let same = |of: &Face| {
        of.normal.dot(face.normal) > 1.0 - 1e-5
            && of.normal.dot(face.corners[0] - of.corners[0]).abs() < 2.0 * FLAT_M
    };
    faces.iter().any(same)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_six_sides_that_look_outward() {
        let solid = Solid::cuboid(Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.5, 0.5, 2.0));
        assert_eq!(solid.faces.len(), 6);
        for face in &solid.faces {
            assert_eq!(face.corners.len(), 4);
            assert!(face.normal.dot(face.corners[0] - Vec3::new(1.0, 0.5, 0.0)) > 0.0);
        }
        assert_eq!(
            solid.bounds(),
            (Vec3::new(0.5, 0.0, -2.0), Vec3::new(1.5, 1.0, 2.0))
        );
        assert_eq!(solid.top_at(Vec3::new(1.2, 9.0, 1.0)), Some(1.0));
        assert_eq!(solid.top_at(Vec3::new(1.6, 9.0, 1.0)), None);
        assert!((solid.distance(Vec3::new(-0.5, 7.0, 0.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_ramp_rises_and_turns_with_its_frame() {
        let ramp = [
            [-1.0, 0.0, -1.5],
            [1.0, 0.0, -1.5],
            [-1.0, 0.0, 1.5],
            [1.0, 0.0, 1.5],
            [-1.0, 0.6, 1.5],
            [1.0, 0.6, 1.5],
        ];
        let solid = Solid::hull(&ramp.map(Vec3::from));
        assert_eq!(solid.faces.len(), 5, "two sides, bottom, back and slope");
        assert!((solid.top_at(Vec3::ZERO).unwrap() - 0.3).abs() < 1e-5);
        let turned = solid.placed(Vec3::X, Quat::from_rotation_y(std::f32::consts::PI));
        assert!((turned.top_at(Vec3::new(1.0, 0.0, -1.0)).unwrap() - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_heightfield_has_its_heights() {
        let shape = v1::ColliderShape {
            heightfield: Some(v1::HeightfieldShape {
                rows: 2,
                columns: 3,
                width: 2.0,
                depth: 1.0,
                heights: vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.0],
            }),
            ..v1::ColliderShape::default()
        };
        let solid = Solid::of_shape(&shape);
        assert_eq!(solid.faces.len(), 2);
        assert!(solid.faces.iter().all(|face| face.normal.y > 0.5));
        assert_eq!(solid.bounds().1, Vec3::new(1.0, 0.5, 0.5));
    }
}

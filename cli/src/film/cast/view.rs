//! A camera with perspective.

use glam::{Vec2, Vec3};

use crate::graphics::canvas::Point;

/// Least distance from the camera, metres. Nearer things count as this near.
const NEAREST_M: f32 = 0.5;

/// A camera that looks at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    eye: Vec3,
    right: Vec3,
    up: Vec3,
    ahead: Vec3,
    /// Pixels of a metre that is a metre away.
    focal: f32,
    centre: Point,
}

/// Place and direction of a camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    /// The place in the middle of the picture.
    pub(super) at: Vec3,
    /// From there to the camera, metres.
    pub(super) distance_m: f32,
    /// Heading in which the camera looks, from +Z to +X, radians.
    pub(super) heading: f32,
    /// Pitch down, radians.
    pub(super) pitch: f32,
    /// Pixels of a metre in the middle.
    pub(super) scale: f32,
    /// The middle of the picture, pixels.
    pub(super) centre: Point,
}

impl View {
    pub(super) fn new(look: Look) -> Self {
        let (sin, cos) = look.heading.sin_cos();
        let level = Vec3::new(sin, 0.0, cos);
        let ahead = level * look.pitch.cos() - Vec3::Y * look.pitch.sin();
        let right = level.cross(Vec3::Y);
        Self {
            eye: look.at - ahead * look.distance_m,
            right,
            up: right.cross(ahead),
            ahead,
            focal: look.scale * look.distance_m,
            centre: look.centre,
        }
    }

    /// Distance of a place ahead of the camera, metres.
    pub(super) fn depth(&self, place: Vec3) -> f32 {
        (place - self.eye).dot(self.ahead).max(NEAREST_M)
    }

    /// Projects a place onto the picture.
    pub(super) fn pixel(&self, place: Vec3) -> Point {
        let from = place - self.eye;
        let flat = Vec2::new(self.right.dot(from), -self.up.dot(from));
        self.centre + flat * (self.focal / self.depth(place))
    }

    /// Whether the viewer sees a face that looks in this direction.
    pub(super) fn sees(&self, normal: Vec3) -> bool {
        normal.dot(self.ahead) < 0.0
    }

    /// Pixels of a metre at a place.
    pub(super) fn scale(&self, place: Vec3) -> f32 {
        self.focal / self.depth(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn farther_places_are_higher_and_smaller() {
        let view = View::new(Look {
            at: Vec3::ZERO,
            distance_m: 10.0,
            heading: 0.0,
            pitch: 0.5,
            scale: 80.0,
            centre: Point::new(500.0, 300.0),
        });
        let pixel = |x, z| view.pixel(Vec3::new(x, 0.0, z));
        assert!(pixel(0.0, 0.0).abs_diff_eq(Point::new(500.0, 300.0), 1e-3));
        assert!((view.scale(Vec3::ZERO) - 80.0).abs() < 1e-3);
        assert!(pixel(0.0, 2.0).y < 300.0 && view.scale(Vec3::Z * 2.0) < 80.0);
        assert!(view.pixel(Vec3::Y).y < 300.0, "up is up");
        // The camera looks along +Z, so +X is to the left.
        assert!(pixel(1.0, 0.0).x < 500.0);
    }
}

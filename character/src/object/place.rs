//! Puts an object down onto the surface that a ray finds.

use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use super::{Align, Definition};
use crate::scene::{RayHit, Scene, Surface, Transform};

/// Where an object is put down.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The object's place in the world.
    pub transform: Transform,
    /// The surface that it was put onto; none if it stays in place.
    pub surface: Option<RayHit>,
}

/// Why an object cannot be put down here.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlaceError {
    /// There is no surface below.
    #[error("no surface within {max_drop_m} m below the object")]
    NoSurface {
        /// Depth of the search, metres.
        max_drop_m: f32,
    },
    /// The object's middle is inside of something.
    #[error("the object is inside of {0:?}")]
    Inside(Surface),
    /// The object would slide off the surface.
    #[error("the surface is {found_deg:.0} degrees steep, more than {allowed_deg:.0}")]
    TooSteep {
        /// Slope of the surface, degrees.
        found_deg: f32,
        /// The steepest allowed slope, degrees.
        allowed_deg: f32,
    },
}

impl Definition {
    /// Where the object `id`, released at `at`, comes to rest in `scene`: its middle vertically
    /// above the point that a ray from it hits, its lowest point on the surface there.
    ///
    /// # Errors
    /// [`PlaceError`] if the definition's rule finds no place.
    pub fn place(&self, scene: &Scene, id: &str, at: Transform) -> Result<Placement, PlaceError> {
        let rule = &self.release;
        if !rule.snap {
            let rotation = rotation(rule.align, at, Vec3::Y);
            return Ok(Placement {
                transform: Transform::new(at.position, rotation),
                surface: None,
            });
        }
        let center = self.body.volume.center();
        let from = at.point(center) + Vec3::Y * rule.lift_m;
        let none = PlaceError::NoSurface {
            max_drop_m: rule.max_drop_m,
        };
        let hit = scene
            .support(from, rule.lift_m + rule.max_drop_m, Some(id))
            .ok_or(none)?;
        if hit.is_inside() {
            return Err(PlaceError::Inside(hit.surface));
        }
        let slope = hit.normal.y.clamp(-1.0, 1.0).acos();
        // A little tolerance, because a normal is not exact.
        if slope > rule.max_slope + 1e-3 {
            return Err(PlaceError::TooSteep {
                found_deg: slope.to_degrees(),
                allowed_deg: rule.max_slope.to_degrees(),
            });
        }
        let rotation = rotation(rule.align, at, hit.normal);
        let mut transform = Transform::new(hit.point - rotation * center, rotation);
        if let Some(lowest) = self.body.volume.lowest_along(transform, hit.normal) {
            transform.position.y += (hit.point.dot(hit.normal) - lowest) / hit.normal.y;
        }
        Ok(Placement {
            transform,
            surface: Some(hit),
        })
    }
}

fn rotation(align: Align, at: Transform, normal: Vec3) -> Quat {
    match align {
        Align::Keep => at.rotation,
        Align::Upright => yaw(at.heading()),
        Align::Surface => (Quat::from_rotation_arc(Vec3::Y, normal) * yaw(at.heading())).normalize(),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::testing::definition;
    use super::*;
    use crate::scene::testing::{any_rotation, any_shape, place};
    use crate::scene::{Body, Collider, ColliderShape, Shape, Volume};
    use proptest::prelude::*;

    fn with_shape(shape: &Shape, align: Align) -> Definition {
        let mut cup = definition();
        cup.body = Arc::new(Body {
            volume: Volume::new(shape).unwrap(),
            ..Body::clone(&cup.body)
        });
        cup.release.align = align;
        cup.release.max_slope = 1.0;
        cup.release.max_drop_m = 8.0;
        cup
    }

    fn table(rotation: Quat) -> Scene {
        let mut scene = Scene::new(0.0).unwrap();
        let top = Collider {
            id: "table".to_owned(),
            shape: ColliderShape::Solid(Shape::Box {
                center_m: Vec3::ZERO,
                half_extents_m: Vec3::new(5.0, 0.5, 5.0),
            }),
            transform: Transform::new(Vec3::new(0.0, 0.5, 0.0), rotation),
        };
        scene.set_colliders(&[top]).unwrap();
        scene
    }

    proptest! {
        /// For every shape, rotation and slope: the object touches the surface, and no part of it
        /// is below.
        #[test]
        fn it_lands_on_the_surface(
            shape in any_shape(),
            turn in any_rotation(),
            slope in -0.8_f32..0.8,
            align in prop::sample::select(vec![Align::Upright, Align::Surface, Align::Keep]),
            x in -0.5_f32..0.5,
            z in -0.5_f32..0.5,
        ) {
            let tilt = Quat::from_rotation_x(slope);
            let scene = table(tilt);
            let cup = with_shape(&shape, align);
            let at = Transform::new(Vec3::new(x, 2.5, z), turn);
            let placed = cup.place(&scene, "cup", at).unwrap();
            let hit = placed.surface.unwrap();
            prop_assert_eq!(&hit.surface, &Surface::Collider("table".into()));
            let normal = tilt * Vec3::Y;
            prop_assert!((hit.normal - normal).length() < 1e-3);
            let above = cup.body.volume.lowest_along(placed.transform, normal).unwrap() - hit.point.dot(normal);
            prop_assert!(above.abs() < 2e-3, "{} above", above);
            let middle = |at: Transform| at.point(cup.body.volume.center());
            let moved = middle(placed.transform) - middle(at);
            prop_assert!(moved.x.hypot(moved.z) < 1e-3, "it goes straight down");
            let top = placed.transform.rotation * Vec3::Y;
            match align {
                Align::Upright => prop_assert!((top - Vec3::Y).length() < 1e-3),
                Align::Surface => prop_assert!((top - normal).length() < 2e-3),
                Align::Keep => prop_assert!(placed.transform.rotation.dot(turn).abs() > 0.9999),
            }
        }
    }

    #[test]
    fn it_is_not_put_down_without_a_suitable_surface() {
        let shape = crate::scene::testing::box_shape(Vec3::splat(0.1));
        let mut cup = with_shape(&shape, Align::Upright);
        cup.release.max_slope = 0.5;
        cup.release.max_drop_m = 1.0;
        let steep = cup.place(&table(Quat::from_rotation_x(0.7)), "cup", place(0.0, 1.5, 0.0));
        assert!(matches!(steep, Err(PlaceError::TooSteep { .. })), "{steep:?}");
        let high = cup.place(&table(Quat::IDENTITY), "cup", place(0.0, 2.2, 0.0));
        assert_eq!(high, Err(PlaceError::NoSurface { max_drop_m: 1.0 }));
        let inside = cup.place(&table(Quat::IDENTITY), "cup", place(0.0, 0.4, 0.0));
        assert_eq!(inside, Err(PlaceError::Inside(Surface::Collider("table".into()))));
        // Only a little inside the lift.
        let sunk = cup
            .place(&table(Quat::IDENTITY), "cup", place(0.0, 0.9, 0.0))
            .unwrap();
        assert!((sunk.transform.position.y - 1.1).abs() < 1e-4);
        // Beside the table it lands on the ground. Its own body does not count as an obstacle.
        let mut scene = table(Quat::IDENTITY);
        scene
            .add("cup", "cup", Arc::clone(&cup.body), place(8.0, 0.3, 0.0))
            .unwrap();
        let ground = cup.place(&scene, "cup", place(8.0, 0.6, 0.0)).unwrap();
        assert_eq!(ground.surface.unwrap().surface, Surface::Ground);
        assert!((ground.transform.position.y - 0.1).abs() < 1e-4);
        cup.release.snap = false;
        let tilted = Transform::new(Vec3::new(0.0, 9.0, 0.0), Quat::from_rotation_x(0.4));
        let left = cup.place(&scene, "cup", tilted).unwrap();
        assert_eq!((left.transform, left.surface), (place(0.0, 9.0, 0.0), None));
    }
}

//! A scene in the metres of a character of any size.

use std::sync::Arc;

use troupe_motion::Vec3;

use super::{BoxTrace, Instance, RayHit, Scene, Surface, Transform};

/// A snapshot of a scene as a character sees it that has metres of its own.
///
/// Every length that goes in or comes out is in the character's metres. Each of them has `scale`
/// metres of the scene; both count heights from y = 0. With a scale of 1 nothing changes, not even
/// by a bit.
#[derive(Debug, Clone)]
pub struct ScaledScene {
    scene: Arc<Scene>,
    scale: f32,
}

impl ScaledScene {
    /// `scene` for a character whose metre has `scale` metres of the scene; above 0.
    pub fn new(scene: Arc<Scene>, scale: f32) -> Self {
        Self { scene, scale }
    }

    /// The scene in its own metres.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Metres of the scene in a metre of the character.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// See [`Scene::revision`].
    pub fn revision(&self) -> u64 {
        self.scene.revision()
    }

    /// Height of the ground plane.
    pub fn ground_y_m(&self) -> f32 {
        self.scene.ground_y_m() / self.scale
    }

    /// The instance of this id, in metres of the scene. [`ScaledScene::place_of`] has its place.
    pub fn instance(&self, id: &str) -> Option<&Arc<Instance>> {
        self.scene.instance(id)
    }

    /// The place of an instance.
    pub fn place_of(&self, instance: &Instance) -> Transform {
        instance.transform.scaled(1.0 / self.scale)
    }

    /// See [`Scene::cast_ray`].
    pub fn cast_ray(
        &self,
        origin: Vec3,
        direction: Vec3,
        reach_m: f32,
        ignore: Option<&str>,
    ) -> Option<RayHit> {
        let scale = self.scale;
        let hit = (self.scene).cast_ray(origin * scale, direction, reach_m * scale, ignore)?;
        Some(RayHit {
            point: hit.point / scale,
            distance_m: hit.distance_m / scale,
            ..hit
        })
    }

    /// See [`Scene::support`].
    pub fn support(&self, point: Vec3, depth_m: f32, ignore: Option<&str>) -> Option<RayHit> {
        self.cast_ray(point, Vec3::NEG_Y, depth_m, ignore)
    }

    /// See [`Scene::is_bare`].
    pub fn is_bare(&self, low: Vec3, high: Vec3) -> bool {
        self.scene.is_bare(low * self.scale, high * self.scale)
    }

    /// What a box hits first on its way: see [`BoxTrace::new`] and [`Scene::first_solid`]. `None`
    /// as well for a box that is too large or too far away for a scene.
    pub fn first_solid(
        &self,
        start: Transform,
        half_extents_m: Vec3,
        sweep_m: Vec3,
        ignore: Option<&str>,
    ) -> Option<Surface> {
        let scale = self.scale;
        let trace = BoxTrace::new(start.scaled(scale), half_extents_m * scale, sweep_m * scale).ok()?;
        let (_, surface) = self.scene.first_solid(&trace, ignore)?;
        Some(surface)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{boxed, place};
    use super::*;

    #[test]
    fn everything_is_seen_in_the_metres_of_the_character() {
        let mut scene = Scene::new(-1.0).unwrap();
        scene
            .add("crate", "crate", boxed(0.5), place(2.0, 0.5, 0.0))
            .unwrap();
        let seen = ScaledScene::new(Arc::new(scene), 2.0);
        assert_eq!(seen.ground_y_m(), -0.5);
        let object = seen.instance("crate").unwrap();
        assert_eq!(seen.place_of(object), place(1.0, 0.25, 0.0));
        let hit = seen.support(Vec3::new(1.0, 3.0, 0.0), 4.0, None).unwrap();
        assert!(hit.point.distance(Vec3::new(1.0, 0.5, 0.0)) < 1e-6 && (hit.distance_m - 2.5).abs() < 1e-6);
        assert_eq!(seen.support(Vec3::new(1.0, 3.0, 0.0), 2.4, None), None);
        let ground = seen.support(Vec3::new(0.0, 3.0, 0.0), 4.0, None).unwrap();
        assert_eq!((ground.point.y, ground.surface), (-0.5, Surface::Ground));
        let (low, high) = (Vec3::new(0.0, 0.0, -0.2), Vec3::new(0.7, 0.4, 0.2));
        assert!(seen.is_bare(low, high) && !seen.is_bare(low, high + Vec3::X * 0.1));
        let ahead = |sweep: f32| {
            let half = Vec3::splat(0.1);
            seen.first_solid(place(0.0, 0.25, 0.0), half, Vec3::X * sweep, None)
        };
        assert_eq!(
            (ahead(0.6), ahead(0.7)),
            (None, Some(Surface::Object("crate".into())))
        );
    }
}

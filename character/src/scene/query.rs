//! Queries of a scene.

use std::sync::Arc;

use parry3d::bounding_volume::Aabb;
use parry3d::query::Ray;
use troupe_motion::Vec3;

use super::convert::{vec3, vector};
use super::heightfield;
use super::{BoxTrace, Instance, MAX_CANDIDATES, Scene, Transform, Volume};

/// An object whose trigger volume a box trace meets.
#[derive(Debug, Clone)]
pub struct Detected {
    /// The object as it is now.
    pub instance: Arc<Instance>,
    /// Share of the sweep after which the box meets it, 0 to 1.
    pub share: f32,
    /// Distance between the middle of the box at its start and the middle of the trigger volume,
    /// metres.
    pub distance_m: f32,
}

/// The surface that a ray or a box hits.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Surface {
    /// The ground plane.
    Ground,
    /// The static collider of this id.
    Collider(Arc<str>),
    /// The object of this id.
    Object(Arc<str>),
}

/// The first hit of a ray.
#[derive(Debug, Clone, PartialEq)]
pub struct RayHit {
    /// World position, metres.
    pub point: Vec3,
    /// Unit normal on the ray's side of the surface. Zero if the ray starts inside.
    pub normal: Vec3,
    /// Distance from the ray's origin, metres.
    pub distance_m: f32,
    /// What the ray hits.
    pub surface: Surface,
}

impl RayHit {
    /// Whether the ray starts inside of what it hits.
    pub fn is_inside(&self) -> bool {
        self.normal == Vec3::ZERO
    }
}

/// A ray's hit as the library gives it.
#[derive(Clone, Copy)]
struct Hit {
    distance: f32,
    normal: Vec3,
}

impl Scene {
    /// All objects whose trigger volumes `trace` meets, without held ones. Sorted by the share of
    /// the sweep, then by distance, then by id.
    pub fn detect(&self, trace: &BoxTrace) -> Vec<Detected> {
        let mut found = Vec::new();
        self.detect_into(trace, &mut found);
        found
    }

    /// As [`Scene::detect`], into a list that is cleared first and can be reused.
    pub fn detect_into(&self, trace: &BoxTrace, found: &mut Vec<Detected>) {
        found.clear();
        let prepared = trace.prepare();
        for slot in self
            .triggers
            .intersect_aabb(&prepared.bounds)
            .take(MAX_CANDIDATES)
        {
            let Some(instance) = self.at_slot(slot) else {
                continue;
            };
            if let Some(share) = prepared.meets(&instance.body.trigger, instance.transform) {
                found.push(Detected {
                    share,
                    distance_m: trace.center().distance(instance.trigger_center()),
                    instance: Arc::clone(instance),
                });
            }
        }
        found.sort_unstable_by(|a, b| {
            (a.share.total_cmp(&b.share))
                .then(a.distance_m.total_cmp(&b.distance_m))
                .then_with(|| a.instance.id.cmp(&b.instance.id))
        });
    }

    /// What a moving box hits first, apart from the ground plane, and the share of the sweep after
    /// which it does. `ignore` is the id of an object that it may pass through.
    pub fn first_solid(&self, trace: &BoxTrace, ignore: Option<&str>) -> Option<(f32, Surface)> {
        let prepared = trace.prepare();
        let colliders = self
            .colliders
            .tree
            .intersect_aabb(&prepared.bounds)
            .take(MAX_CANDIDATES)
            .filter_map(|index| {
                let placed = self.colliders.list.get(index as usize)?;
                let share = prepared.meets(&placed.volume, placed.transform)?;
                Some((share, Surface::Collider(Arc::clone(&placed.id))))
            });
        let near = self.solids.intersect_aabb(&prepared.bounds).take(MAX_CANDIDATES);
        let objects = near.filter_map(|slot| {
            let instance = self
                .at_slot(slot)
                .filter(|instance| Some(&*instance.id) != ignore)?;
            let share = prepared.meets(&instance.body.volume, instance.transform)?;
            Some((share, Surface::Object(Arc::clone(&instance.id))))
        });
        colliders
            .chain(objects)
            .min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)))
    }

    /// What a ray from `origin` along `direction` (of any length but 0) hits first within `reach_m`
    /// metres. `ignore` is the id of an object that it passes through. `None` as well if a value is
    /// not finite.
    ///
    /// The ground plane is hit only from above. A ray that starts inside something solid hits it at
    /// once.
    pub fn cast_ray(
        &self,
        origin: Vec3,
        direction: Vec3,
        reach_m: f32,
        ignore: Option<&str>,
    ) -> Option<RayHit> {
        let direction = direction.try_normalize()?;
        if !origin.is_finite() || !(0.0..=f32::MAX).contains(&reach_m) {
            return None;
        }
        let ray = Ray::new(vector(origin), vector(direction));
        let mut best: Option<(Hit, Surface)> = None;
        let mut reach = reach_m;
        if let Some(distance) = self.ground_distance(origin, direction).filter(|&d| d <= reach) {
            let normal = Vec3::Y;
            reach = distance;
            best = Some((Hit { distance, normal }, Surface::Ground));
        }
        let of_collider = |index: u32, reach| {
            let placed = self.colliders.list.get(index as usize)?;
            hit(&placed.volume, placed.transform, &ray, reach)
        };
        if let Some((index, hit)) = nearest(&self.colliders.tree, &ray, reach, of_collider)
            && let Some(placed) = self.colliders.list.get(index as usize)
        {
            reach = hit.distance;
            best = Some((hit, Surface::Collider(Arc::clone(&placed.id))));
        }
        let of_object = |slot: u32, reach| {
            let instance = self
                .at_slot(slot)
                .filter(|instance| Some(&*instance.id) != ignore)?;
            hit(&instance.body.volume, instance.transform, &ray, reach)
        };
        if let Some((slot, hit)) = nearest(&self.solids, &ray, reach, of_object)
            && let Some(instance) = self.at_slot(slot)
        {
            best = Some((hit, Surface::Object(Arc::clone(&instance.id))));
        }
        let (hit, surface) = best?;
        Some(RayHit {
            point: origin + direction * hit.distance,
            normal: hit.normal,
            distance_m: hit.distance,
            surface,
        })
    }

    /// What is under `point` within `depth_m` metres straight down: what a foot or a root stands
    /// over.
    pub fn support(&self, point: Vec3, depth_m: f32, ignore: Option<&str>) -> Option<RayHit> {
        self.cast_ray(point, Vec3::NEG_Y, depth_m, ignore)
    }

    /// Whether no solid thing is even partly in the box from `low` to `high`. The ground plane does
    /// not count.
    pub fn is_bare(&self, low: Vec3, high: Vec3) -> bool {
        let bounds = Aabb::new(vector(low), vector(high));
        let mut colliders = self.colliders.tree.intersect_aabb(&bounds);
        colliders.next().is_none() && self.solids.intersect_aabb(&bounds).next().is_none()
    }

    fn ground_distance(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        let above = origin.y - self.ground_y_m();
        (above >= 0.0 && direction.y < 0.0).then(|| above / -direction.y)
    }
}

/// Where a ray hits a volume, at most `reach` away.
fn hit(volume: &Volume, at: Transform, ray: &Ray, reach: f32) -> Option<Hit> {
    let pose = volume.pose(at);
    let local = ray.inverse_transform_by(&pose);
    let field = volume.shape().as_heightfield();
    let (distance, normal) = match field {
        Some(field) => heightfield::cast_ray(field, &local, reach)?,
        None => {
            let hit = volume
                .shape()
                .cast_local_ray_and_get_normal(&local, reach, true)?;
            (hit.time_of_impact, hit.normal)
        }
    };
    if distance == 0.0 && field.is_none() {
        let normal = Vec3::ZERO;
        return Some(Hit { distance, normal });
    }
    // A surface without an inside may give the normal of its other side.
    let normal = vec3(pose.rotation * normal).normalize_or_zero();
    let normal = if normal.dot(vec3(ray.dir)) > 0.0 {
        -normal
    } else {
        normal
    };
    Some(Hit { distance, normal })
}

/// The nearest hit in a tree, at most `reach` away.
fn nearest(
    tree: &parry3d::partitioning::Bvh,
    ray: &Ray,
    reach: f32,
    of_leaf: impl Fn(u32, f32) -> Option<Hit>,
) -> Option<(u32, Hit)> {
    let best = std::cell::Cell::new(None::<(u32, Hit)>);
    let looked_at = std::cell::Cell::new(0);
    tree.cast_ray(ray, reach, |leaf, reach| {
        looked_at.set(looked_at.get() + 1);
        if looked_at.get() > MAX_CANDIDATES {
            return None;
        }
        let hit = of_leaf(leaf, reach)?;
        if best
            .get()
            .is_none_or(|(_, before)| hit.distance < before.distance)
        {
            best.set(Some((leaf, hit)));
        }
        Some(hit.distance)
    });
    best.get()
}

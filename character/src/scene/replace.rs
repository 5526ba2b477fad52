//! Replaces a scene while characters are in it.

use std::sync::Arc;

use super::{Instance, Scene};

impl Scene {
    /// Takes over ground, colliders and objects of `new`. An object with the same id and definition
    /// stays: it keeps its reservation or holder, and counts as moved if its transform differs. A
    /// held object stays in the hand; its place in the scene becomes that of `new`. All other
    /// objects go, and those of `new` are added. The revision continues from this scene's.
    pub fn become_scene(&mut self, new: Self) {
        let stays = |old: &Instance| {
            let same = |new: &Arc<Instance>| new.object == old.object;
            new.instance(&old.id).is_some_and(same)
        };
        let gone: Vec<Arc<str>> = (self.instances())
            .filter(|old| !stays(old))
            .map(|old| Arc::clone(&old.id))
            .collect();
        for id in gone {
            // The object exists, so this does not fail.
            let _ = self.remove(&id);
        }
        for instance in new.instances() {
            match self.instance(&instance.id).cloned() {
                Some(old) => self.follow(&old, instance),
                None => {
                    let Instance {
                        id,
                        object,
                        body,
                        transform,
                        ..
                    } = &**instance;
                    // It was accepted into `new`, and there is room for all of those here.
                    let _ = self.add(id, object, Arc::clone(body), *transform);
                }
            }
        }
        self.take_ground_and_colliders(&new);
    }

    /// Makes an object that stays follow its new version.
    fn follow(&mut self, old: &Instance, new: &Instance) {
        let moved = old.transform != new.transform;
        if moved || !Arc::ptr_eq(&old.body, &new.body) {
            self.change_instance(&old.id, |changed| {
                changed.transform = new.transform;
                changed.body = Arc::clone(&new.body);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{box_shape, boxed, place};
    use super::super::{Collider, ColliderShape, Holder, State, Transform};
    use super::*;
    use troupe_motion::Vec3;

    fn with(objects: &[(&str, &str, f32)]) -> Scene {
        let mut scene = Scene::new(0.0).unwrap();
        for &(id, definition, x) in objects {
            scene.add(id, definition, boxed(0.5), place(x, 0.5, 0.0)).unwrap();
        }
        scene
    }

    #[test]
    fn objects_in_both_scenes_stay_and_others_come_and_go() {
        let mut scene = with(&[
            ("still", "crate", 0.0),
            ("moved", "crate", 3.0),
            ("held", "cup", 6.0),
            ("gone", "cup", 9.0),
            ("other", "crate", 12.0),
        ]);
        let (a, b) = (Holder::new("a"), Holder::new("b"));
        scene.reserve("still", &a).unwrap();
        scene.reserve("moved", &b).unwrap();
        scene.hold("held", &a).unwrap();
        let before = scene.clone();
        let revision = |scene: &Scene, id: &str| scene.instance(id).unwrap().revision;

        let mut new = with(&[
            ("moved", "crate", 4.0),
            ("held", "cup", 7.0),
            ("other", "cup", 12.0),
            ("fresh", "cup", 15.0),
        ]);
        // With the same body, so it has not changed at all.
        let still = before.instance("still").unwrap();
        new.add("still", "crate", Arc::clone(&still.body), still.transform)
            .unwrap();
        new.set_ground(-1.0).unwrap();
        let floor = Collider {
            id: "floor".to_owned(),
            shape: ColliderShape::Solid(box_shape(Vec3::ONE)),
            transform: Transform::IDENTITY,
        };
        new.set_colliders(&[floor]).unwrap();
        scene.become_scene(new);

        assert_eq!(scene.len(), 5);
        assert!(scene.instance("gone").is_none() && scene.instance("fresh").is_some());
        assert_eq!(scene.instance("still").unwrap().state, State::Reserved(a.clone()));
        assert_eq!(revision(&scene, "still"), revision(&before, "still"));
        assert_eq!(scene.instance("moved").unwrap().state, State::Reserved(b));
        assert!(revision(&scene, "moved") > before.revision());
        let held = scene.instance("held").unwrap();
        assert_eq!(
            (&held.state, held.transform),
            (&State::Held(a.clone()), place(7.0, 0.5, 0.0))
        );
        assert_eq!(&*scene.instance("other").unwrap().object, "cup");
        assert!(scene.revision() > before.revision());
        assert_eq!((scene.ground_y_m(), scene.colliders().len()), (-1.0, 1));

        // Queries follow: they find the moved object in its new place, and not the held one until
        // it is put down.
        let found = |scene: &Scene, x: f32| {
            let trace =
                super::super::BoxTrace::new(place(x, 0.5, 0.0), Vec3::splat(0.1), Vec3::ZERO).unwrap();
            scene.detect(&trace).len()
        };
        assert_eq!(
            (found(&scene, 2.2), found(&scene, 4.0), found(&scene, 7.0)),
            (0, 1, 0)
        );
        assert_eq!(scene.free_all(|by| *by == a), 2);
        assert_eq!(found(&scene, 7.0), 1);
    }
}

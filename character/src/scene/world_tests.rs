//! Changes of a scene, and its shapes.

use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::{Quat, Vec3};

use super::testing::{any_shape, any_vector, box_shape, boxed, place};
use super::*;

fn one_crate() -> Scene {
    let mut scene = Scene::new(0.0).unwrap();
    scene
        .add("crate", "crate", boxed(0.5), place(0.0, 0.5, 0.0))
        .unwrap();
    scene
}

fn found(scene: &Scene, x: f32) -> usize {
    let at = BoxTrace::new(place(x, 0.5, 0.0), Vec3::splat(0.1), Vec3::ZERO).unwrap();
    scene.detect(&at).len()
}

#[test]
fn reserve_hold_release() {
    let mut scene = one_crate();
    let (a, b) = (Holder::new("a"), Holder::new("b"));
    scene.reserve("crate", &a).unwrap();
    scene.reserve("crate", &a).unwrap();
    let taken = scene.reserve("crate", &b).unwrap_err();
    assert_eq!(
        taken.to_string(),
        "object \"crate\" is reserved or held by session \"a\""
    );
    assert!(matches!(scene.hold("crate", &b), Err(SceneError::Taken { .. })));
    // It may be moved while it is reserved.
    scene.move_to("crate", place(2.0, 0.5, 0.0)).unwrap();
    assert_eq!((found(&scene, 0.0), found(&scene, 2.0)), (0, 1));
    assert_eq!(scene.of_holder(&a).count(), 1);

    scene.hold("crate", &a).unwrap();
    assert_eq!(found(&scene, 2.0), 0);
    assert!(matches!(
        scene.move_to("crate", place(0.0, 0.5, 0.0)),
        Err(SceneError::MoveHeld { .. })
    ));
    assert!(!scene.unreserve("crate", &a), "held is more than reserved");
    let not_held = scene.release("crate", &b, Transform::IDENTITY).unwrap_err();
    assert!(matches!(not_held, SceneError::NotHeld { .. }), "{not_held}");
    scene.release("crate", &a, place(4.0, 0.5, 0.0)).unwrap();
    assert_eq!(
        (found(&scene, 4.0), scene.instance("crate").unwrap().state.clone()),
        (1, State::Free)
    );
    scene.reserve("crate", &b).unwrap();
    assert!(!scene.unreserve("crate", &a) && scene.unreserve("crate", &b));
}

#[test]
fn characters_that_left_hold_nothing() {
    let mut scene = one_crate();
    scene
        .add("other", "crate", boxed(0.5), place(5.0, 0.5, 0.0))
        .unwrap();
    scene.hold("crate", &Holder::new("a")).unwrap();
    scene.reserve("other", &Holder::new("b")).unwrap();
    assert_eq!(scene.free_all(|by| &*by.session == "a"), 1);
    assert_eq!(found(&scene, 0.0), 1, "back in its old place");
    assert!(scene.instance("other").unwrap().state.holder().is_some());
}

#[test]
fn shared_objects_stay_free() {
    let mut scene = Scene::new(0.0).unwrap();
    let body = Arc::new(Body {
        shared: true,
        ..Body::clone(&boxed(0.5))
    });
    scene.add("sign", "sign", body, Transform::IDENTITY).unwrap();
    for name in ["a", "b"] {
        scene.reserve("sign", &Holder::new(name)).unwrap();
    }
    assert_eq!(scene.instance("sign").unwrap().state, State::Free);
    assert!(matches!(
        scene.hold("sign", &Holder::new("a")),
        Err(SceneError::Value { .. })
    ));
}

#[test]
fn a_replaced_body_is_everywhere_at_once() {
    let mut scene = one_crate();
    scene
        .add("other", "crate", boxed(0.5), place(8.0, 0.5, 0.0))
        .unwrap();
    scene
        .add("barrel", "barrel", boxed(0.5), place(16.0, 0.5, 0.0))
        .unwrap();
    assert_eq!(found(&scene, 3.0), 0);
    assert_eq!(scene.replace_body("crate", &boxed(3.0)), 2);
    assert_eq!(
        (found(&scene, 3.0), found(&scene, 5.0), found(&scene, 19.0)),
        (1, 1, 0)
    );
    assert_eq!(scene.replace_body("crate", &boxed(0.1)), 2);
    assert_eq!(found(&scene, 3.0), 0);
    assert_eq!(scene.replace_body("nothing", &boxed(3.0)), 0);
}

#[test]
fn what_a_scene_refuses() {
    let mut scene = one_crate();
    let far = place(0.0, 0.0, 1e6);
    let unknown = scene.move_to("door", Transform::IDENTITY).unwrap_err();
    assert_eq!(unknown.to_string(), "the scene has no object \"door\"");
    for error in [
        scene
            .add("crate", "crate", boxed(0.5), Transform::IDENTITY)
            .unwrap_err(),
        scene
            .add("", "crate", boxed(0.5), Transform::IDENTITY)
            .unwrap_err(),
        scene
            .add(&"x".repeat(129), "crate", boxed(0.5), Transform::IDENTITY)
            .unwrap_err(),
        scene.add("door", "door", boxed(0.5), far).unwrap_err(),
        scene.move_to("crate", far).unwrap_err(),
        scene.set_ground(f32::NAN).unwrap_err(),
        Scene::new(f32::INFINITY).unwrap_err(),
    ] {
        assert!(!error.to_string().is_empty());
    }
    assert_eq!((scene.len(), found(&scene, 0.0)), (1, 1));
    for index in 1..MAX_INSTANCES {
        scene
            .add(&index.to_string(), "crate", boxed(0.5), place(100.0, 0.0, 0.0))
            .unwrap();
    }
    let full = scene
        .add("more", "crate", boxed(0.5), Transform::IDENTITY)
        .unwrap_err();
    assert!(matches!(full, SceneError::Full { .. }), "{full}");
    scene.remove("crate").unwrap();
    scene
        .add("more", "crate", boxed(0.5), Transform::IDENTITY)
        .unwrap();
}

#[test]
fn colliders_are_replaced_together_or_not_at_all() {
    let mut scene = Scene::new(0.0).unwrap();
    let floor = |id: &str| Collider {
        id: id.to_owned(),
        shape: ColliderShape::Solid(box_shape(Vec3::new(1.0, 0.5, 1.0))),
        transform: Transform::IDENTITY,
    };
    scene.set_colliders(&[floor("a"), floor("b")]).unwrap();
    let mut wrong = floor("c");
    wrong.shape = ColliderShape::Solid(box_shape(Vec3::new(1.0, 0.0, 1.0)));
    let error = scene.set_colliders(&[floor("a"), wrong]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "collider \"c\": half_extents_m[1] is 0; allowed: 0.001 to 1000 m"
    );
    assert!(matches!(
        scene.set_colliders(&[floor("a"), floor("a")]),
        Err(SceneError::Exists { .. })
    ));
    assert!(scene.set_colliders(&vec![floor("a"); MAX_COLLIDERS + 1]).is_err());
    assert_eq!(
        scene.colliders().map(|c| c.id.as_str()).collect::<Vec<_>>(),
        ["a", "b"]
    );
}

#[test]
fn invalid_heightfields_are_refused() {
    let good = Heightfield {
        rows: 2,
        columns: 3,
        size_m: [2.0, 1.0],
        heights_m: vec![0.0; 6],
    };
    good.check().unwrap();
    let with = |change: &dyn Fn(&mut Heightfield)| {
        let mut field = good.clone();
        change(&mut field);
        field.check().unwrap_err().to_string()
    };
    assert!(with(&|f| f.rows = 1).starts_with("rows is 1; allowed: 2 to 512"));
    assert!(with(&|f| f.columns = 513).starts_with("columns is 513"));
    assert!(with(&|f| f.size_m[1] = f32::NAN).starts_with("size_m[1] is NaN"));
    assert!(with(&|f| f.heights_m.truncate(5)).starts_with("heights_m is 5 heights"));
    assert!(with(&|f| f.heights_m[4] = f32::INFINITY).starts_with("heights_m[4] is inf"));
    let tile = |id: usize| Collider {
        id: id.to_string(),
        shape: ColliderShape::Heightfield(Heightfield {
            rows: 512,
            columns: 512,
            size_m: [10.0, 10.0],
            heights_m: vec![0.0; 512 * 512],
        }),
        transform: Transform::IDENTITY,
    };
    let mut tilted = tile(0);
    tilted.transform.rotation = Quat::from_rotation_x(0.2);
    let error = Scene::new(0.0)
        .unwrap()
        .set_colliders(&[tilted])
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "heightfield \"0\" is tilted by 11.5 degrees; allowed: a rotation about +Y alone"
    );
    let many: Vec<_> = (0..5).map(tile).collect();
    let error = Scene::new(0.0)
        .unwrap()
        .set_colliders(&many)
        .unwrap_err()
        .to_string();
    assert!(error.contains("1310720 samples"), "{error}");
}

#[test]
fn invalid_shapes_are_refused() {
    let convex = |points: &[[f32; 3]]| Shape::Convex {
        points_m: points.iter().copied().map(Vec3::from).collect(),
    };
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let far = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2e3, 0.0], [0.0, 0.0, 1.0]];
    for (shape, want) in [
        (convex(&square), "flat"),
        (convex(&[[0.5; 3]; 8]), "flat"),
        (convex(&[[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]]), "flat"),
        (convex(&square[..3]), "4 to 64 points"),
        (convex(&[[1.0, 2.0, 3.0]; 65]), "4 to 64 points"),
        (convex(&far), "points_m[2][1] is 2000"),
        (convex(&[[f32::NAN; 3]; 4]), "points_m[0][0] is NaN"),
        (box_shape(Vec3::new(1.0, -1.0, 1.0)), "half_extents_m[1] is -1"),
        (
            box_shape(Vec3::new(1.0, 1.0, f32::INFINITY)),
            "half_extents_m[2] is inf",
        ),
    ] {
        let error = Volume::new(&shape).unwrap_err().to_string();
        assert!(error.contains(want), "{error}");
    }
}

proptest! {
    /// Points on a coarse grid make ties of all kinds. The result is an error, or a hull that
    /// contains its points.
    #[test]
    fn hulls_of_awkward_points_never_panic(
        points in prop::collection::vec(prop::array::uniform3(-2_i32..3), 4..40),
        scale in prop::sample::select(vec![1e-3_f32, 0.01, 1.0, 300.0]),
        jitter in prop::sample::select(vec![0.0_f32, 1e-6, 1e-4]),
    ) {
        let points_m: Vec<Vec3> = points
            .iter()
            .enumerate()
            .map(|(i, p)| Vec3::from(p.map(|v| v as f32)) * scale + Vec3::splat(jitter * (i % 5) as f32))
            .collect();
        let shape = Shape::Convex { points_m: points_m.clone() };
        for volume in [Volume::new(&shape), Volume::grown(&shape, 0.2)].into_iter().flatten() {
            for &point in &points_m {
                let lowest = volume.lowest_along(Transform::IDENTITY, Vec3::Y).unwrap();
                prop_assert!(lowest <= point.y + scale * 1e-3 + 1e-3);
            }
        }
    }

    /// A grown shape contains what is within reach, and nothing beyond.
    #[test]
    fn a_grown_shape_reaches_exactly_as_far(
        shape in any_shape(),
        reach in 0.05_f32..1.0,
        toward in any_vector(1.0),
    ) {
        let (own, grown) = (Volume::new(&shape).unwrap(), Volume::grown(&shape, reach).unwrap());
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            let lowest = |volume: &Volume| volume.lowest_along(Transform::IDENTITY, axis).unwrap();
            prop_assert!((lowest(&own) - lowest(&grown) - reach).abs() < 1e-3);
        }
        prop_assert!(grown.contains(Transform::IDENTITY, own.center()));
        let turned = Transform::new(toward, Quat::from_rotation_y(0.7));
        prop_assert!(grown.contains(turned, turned.point(own.center())));
    }
}

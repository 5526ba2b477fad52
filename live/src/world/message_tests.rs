use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::rotation::angle_between;

use super::*;
use troupe_character::scene::testing::boxed;
use troupe_character::scene::{BoxTrace, ColliderShape, ObjectBody, Surface};

/// One definition, named cup.
struct Cups;

impl Bodies for Cups {
    fn body(&self, definition: &str) -> Option<Arc<ObjectBody>> {
        (definition == "cup").then(|| boxed(0.1))
    }

    fn names(&self) -> Vec<&str> {
        vec!["cup"]
    }
}

fn vec3(x: f32, y: f32, z: f32) -> Option<v1::Vec3> {
    Some(v1::Vec3 { x, y, z })
}

fn collider(id: &str, shape: v1::ColliderShape) -> v1::Collider {
    v1::Collider {
        id: id.into(),
        shape: Some(shape),
        ..v1::Collider::default()
    }
}

fn cuboid(half: [f32; 3]) -> v1::ColliderShape {
    v1::ColliderShape {
        r#box: Some(v1::BoxShape {
            center: None,
            half_extents: vec3(half[0], half[1], half[2]),
        }),
        ..v1::ColliderShape::default()
    }
}

fn cup(id: &str, z: f32) -> v1::SceneObject {
    v1::SceneObject {
        id: id.into(),
        definition: "cup".into(),
        position: vec3(0.0, 0.1, z),
        ..v1::SceneObject::default()
    }
}

/// Everything that a scene can say, in the native convention.
fn yard() -> v1::Scene {
    let mut ramp = collider(
        "ramp",
        v1::ColliderShape {
            convex: Some(v1::ConvexShape {
                points: [
                    [-1.0, 0.0, 0.0],
                    [1.0, 0.0, 0.0],
                    [0.0, 0.0, 2.0],
                    [0.0, 1.0, 2.0],
                ]
                .map(|[x, y, z]| v1::Vec3 { x, y, z })
                .to_vec(),
            }),
            ..v1::ColliderShape::default()
        },
    );
    ramp.position = vec3(4.0, 0.0, 1.0);
    ramp.heading = Some(0.7);
    let mound = collider(
        "mound",
        v1::ColliderShape {
            heightfield: Some(v1::HeightfieldShape {
                rows: 2,
                columns: 3,
                width: 4.0,
                depth: 2.0,
                heights: vec![0.0, 0.5, 0.0, 0.0, 0.25, 1.0],
            }),
            ..v1::ColliderShape::default()
        },
    );
    let mut tilted = cup("tilted", 3.0);
    let q = Quat::from_rotation_x(0.4);
    tilted.rotation = Some(v1::Quat {
        w: q.w,
        x: q.x,
        y: q.y,
        z: q.z,
    });
    v1::Scene {
        name: "yard".into(),
        ground: -0.5,
        colliders: vec![collider("block", cuboid([0.5, 1.0, 2.0])), ramp, mound],
        objects: vec![cup("cup", 1.5), tilted],
        ..v1::Scene::default()
    }
}

fn read(scene: &v1::Scene) -> Result<Scene, WorldError> {
    read_scene(&Path::root().field("scene"), scene, &Cups).map(|named| named.scene)
}

fn near(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-4)
}

fn points(shape: &ColliderShape) -> Vec<Vec3> {
    use troupe_character::scene::Shape;
    match shape {
        ColliderShape::Solid(Shape::Box {
            center_m,
            half_extents_m,
        }) => vec![*center_m, *half_extents_m],
        ColliderShape::Solid(Shape::Convex { points_m }) => points_m.clone(),
        ColliderShape::Heightfield(field) => field
            .heights_m
            .iter()
            .map(|&height| Vec3::new(field.size_m[0], height, field.size_m[1]))
            .collect(),
    }
}

#[test]
fn a_scene_is_the_same_in_every_convention() {
    let cell = SceneCell::new(read(&yard()).unwrap());
    let native = cell.snapshot();
    for convention in Convention::ALL {
        let message = write_scene("yard", &cell, convention, true);
        assert_eq!(message.ground, -0.5 * convention.units_per_metre());
        let again = read(&message).unwrap();
        assert!((again.ground_y_m() - native.ground_y_m()).abs() < 1e-6);
        for (was, is) in native.colliders().zip(again.colliders()) {
            assert_eq!(was.id, is.id);
            assert!(near(was.transform.position, is.transform.position));
            assert!(angle_between(was.transform.rotation, is.transform.rotation) < 1e-3);
            let (was, is) = (points(&was.shape), points(&is.shape));
            assert!(
                was.len() == is.len() && was.iter().zip(&is).all(|(a, b)| near(*a, *b)),
                "{is:?}"
            );
        }
        for was in native.instances() {
            let is = again.instance(&was.id).unwrap();
            assert!(near(was.transform.position, is.transform.position));
            assert!(angle_between(was.transform.rotation, is.transform.rotation) < 1e-3);
        }
    }
    let without = write_scene("yard", &cell, Convention::Native, false);
    assert!(without.colliders.is_empty() && without.objects.len() == 2);
}

/// Forward is Unreal's X, and right its Y.
#[test]
fn a_scene_in_centimetres_is_where_it_should_be() {
    let scene = v1::Scene {
        name: "yard".into(),
        convention: v1::Convention::Unreal.into(),
        colliders: vec![v1::Collider {
            position: vec3(500.0, 200.0, 50.0),
            ..collider("block", cuboid([30.0, 10.0, 50.0]))
        }],
        ..v1::Scene::default()
    };
    let native = read(&scene).unwrap();
    let hit = |x: f32, z: f32| {
        let hit = native.support(Vec3::new(x, 3.0, z), 10.0, None).unwrap();
        (hit.surface == Surface::Collider("block".into())).then_some(hit.point.y)
    };
    assert_eq!(hit(-2.0, 5.0), Some(1.0));
    // 0.3 m forward and back, 0.1 m to the sides.
    assert_eq!((hit(-2.05, 5.25), hit(-2.25, 5.05)), (Some(1.0), None));
}

type Change = fn(&mut v1::Scene);

fn set_shape(scene: &mut v1::Scene, index: usize, shape: v1::ColliderShape) {
    scene.colliders[index].shape = Some(shape);
}

fn flat() -> v1::ColliderShape {
    v1::ColliderShape {
        convex: Some(v1::ConvexShape {
            points: vec![v1::Vec3::default(); 4],
        }),
        ..v1::ColliderShape::default()
    }
}

#[test]
fn errors_name_the_field_and_its_range_in_the_requests_unit() {
    let wrong = |change: Change| {
        let mut scene = yard();
        change(&mut scene);
        match read(&scene).unwrap_err() {
            WorldError::Field(error) => (error.field, error.allowed),
            WorldError::Object { field, .. } => (field, String::new()),
            other => panic!("{other}"),
        }
    };
    let cases: Vec<(Change, &str, &str)> = vec![
        (|s| s.name = "a b".into(), "scene.name", "1 to 64 letters"),
        (|s| s.convention = 9, "scene.convention", "CONVENTION_NATIVE (0)"),
        (|s| s.ground = f32::NAN, "scene.ground", "-10000 to 10000"),
        (
            |s| {
                s.convention = v1::Convention::Unreal.into();
                s.ground = 2e6;
            },
            "scene.ground",
            "-1000000 to 1000000",
        ),
        (
            |s| s.colliders[1].id = "block".into(),
            "scene.colliders[1].id",
            "ids that are all different",
        ),
        (
            |s| s.colliders[1].id.clear(),
            "scene.colliders[1].id",
            "1 to 128 bytes",
        ),
        (
            |s| s.colliders[0].shape = None,
            "scene.colliders[0].shape",
            "exactly one of",
        ),
        (
            |s| set_shape(s, 0, cuboid([0.5, 0.0, 1.0])),
            "scene.colliders[0].shape.box.half_extents.y",
            "0.001 to 1000",
        ),
        (
            |s| set_shape(s, 1, flat()),
            "scene.colliders[1].shape.convex.points",
            "points apart from each other",
        ),
        (
            |s| {
                let field = s.colliders[2]
                    .shape
                    .as_mut()
                    .unwrap()
                    .heightfield
                    .as_mut()
                    .unwrap();
                field.heights.pop();
            },
            "scene.colliders[2].shape.heightfield.heights",
            "rows x columns, 6",
        ),
        (
            |s| {
                let q = Quat::from_rotation_z(0.3);
                s.colliders[2].rotation = Some(v1::Quat {
                    w: q.w,
                    x: q.x,
                    y: q.y,
                    z: q.z,
                });
            },
            "scene.colliders[2].rotation",
            "a rotation about +Y alone",
        ),
        (
            |s| s.colliders[1].rotation = Some(v1::Quat::default()),
            "scene.colliders[1].rotation",
            "at most one of the two",
        ),
        (
            |s| s.objects[1].rotation = Some(v1::Quat::default()),
            "scene.objects[1].rotation",
            "unit length",
        ),
        (
            |s| s.objects[0].definition = "mug".into(),
            "scene.objects[0].definition",
            "cup",
        ),
        (
            |s| s.objects[0].id = "x".repeat(129),
            "scene.objects[0].id",
            "1 to 128 bytes",
        ),
        (
            |s| s.objects[1].id = "cup".into(),
            "scene.objects[1].id",
            "ids that are all different",
        ),
        (
            |s| s.objects[0].position = vec3(0.0, 0.0, 20_000.0),
            "scene.objects[0].position.z",
            "-10000 to 10000",
        ),
        (
            |s| s.objects[0].heading = Some(2000.0),
            "scene.objects[0].heading",
            "-1000 to 1000",
        ),
    ];
    for (change, field, allowed) in cases {
        let (found, hint) = wrong(change);
        assert_eq!(found, field);
        assert!(hint.starts_with(allowed), "{field}: {hint}");
    }
}

#[test]
fn values_that_are_not_given_stay_unchanged() {
    let at = Transform::upright(Vec3::new(1.0, 2.0, 3.0), 0.5);
    let place = |given| place(&Path::root(), given, Convention::Native, at).unwrap();
    assert_eq!(place((None, None, None)), at);
    let moved = place((vec3(0.0, 0.0, 1.0), None, None));
    assert_eq!((moved.position, moved.rotation), (Vec3::Z, at.rotation));
    let turned = place((None, Some(1.0), None));
    assert_eq!(
        (turned.position, turned.heading()),
        (at.position, yaw(1.0).mul_vec3(Vec3::Z).x.asin())
    );
    // What a box reaches is where the message said.
    let scene = read(&yard()).unwrap();
    let trace = BoxTrace::new(
        Transform::upright(Vec3::new(0.0, 0.1, 0.7), 0.0),
        Vec3::splat(0.25),
        Vec3::ZERO,
    );
    let found = scene.detect(&trace.unwrap());
    assert_eq!(found.len(), 1);
    assert_eq!(&*found[0].instance.id, "cup");
}

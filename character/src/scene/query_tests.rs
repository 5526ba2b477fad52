//! Compares queries with geometry worked out by hand and by brute force.

use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::{Quat, Vec3};

use super::testing::{any_rotation, any_shape, any_transform, any_vector, body, box_shape, boxed, place};
use super::*;

fn standing(at: Transform, half: Vec3) -> BoxTrace {
    BoxTrace::new(at, half, Vec3::ZERO).unwrap()
}

fn collider(id: &str, shape: ColliderShape, transform: Transform) -> Collider {
    Collider {
        id: id.to_owned(),
        shape,
        transform,
    }
}

fn solid(half: Vec3) -> ColliderShape {
    ColliderShape::Solid(box_shape(half))
}

/// Points of a box at even steps, with its corners.
fn samples(half: Vec3, steps: i32) -> impl Iterator<Item = Vec3> {
    let at = move |i: i32| (i as f32 / steps as f32) * 2.0 - 1.0;
    (0..=steps).flat_map(move |x| {
        (0..=steps).flat_map(move |y| (0..=steps).map(move |z| half * Vec3::new(at(x), at(y), at(z))))
    })
}

/// Whether a sampled point of the moved box is in the volume.
fn sampled_meets(
    start: Transform,
    half: Vec3,
    sweep: Vec3,
    volume: &Volume,
    at: Transform,
    sweep_steps: i32,
) -> bool {
    (0..=sweep_steps).any(|step| {
        let moved = sweep * (step as f32 / sweep_steps.max(1) as f32);
        samples(half, 10).any(|p| volume.contains(at, start.point(p) + moved))
    })
}

/// As [`sampled_meets`] the other way round: points of the volume's bounds that are in the volume
/// and in the moved box. It finds meetings that a coarse grid of the box misses, such as a corner
/// through a face.
fn sampled_back(
    start: Transform,
    half: Vec3,
    sweep: Vec3,
    volume: &Volume,
    at: Transform,
    steps: i32,
) -> bool {
    let grown = 2.0;
    samples(Vec3::splat(grown), 24).any(|p| {
        let point = at.point(p);
        volume.contains(at, point)
            && (0..=steps).any(|step| {
                let moved = sweep * (step as f32 / steps.max(1) as f32);
                let local = start.local_point(point - moved).abs();
                local.x <= half.x && local.y <= half.y && local.z <= half.z
            })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(192))]

    /// If samples meet, the trace does too. If the trace meets, a slightly larger box and volume
    /// do.
    #[test]
    fn traces_agree_with_sampling(
        shape in any_shape(),
        at in any_transform(1.5),
        start in any_transform(1.5),
        half in prop::array::uniform3(0.1_f32..0.8),
        sweep in prop_oneof![Just(Vec3::ZERO), any_vector(1.5)],
    ) {
        let half = Vec3::from(half);
        let mut scene = Scene::new(0.0).unwrap();
        scene.add("it", "it", body(&shape, 0.0), at).unwrap();
        let trace = BoxTrace::new(start, half, sweep).unwrap();
        let found = !scene.detect(&trace).is_empty();
        let steps = if sweep == Vec3::ZERO { 0 } else { 24 };
        let volume = Volume::new(&shape).unwrap();
        let sampled = sampled_meets(start, half, sweep, &volume, at, steps)
            || sampled_back(start, half, sweep, &volume, at, steps);
        if sampled {
            prop_assert!(found, "samples meet, the trace does not");
        }
        if found {
            let wider = Volume::grown(&shape, 0.15).unwrap();
            let half = half + Vec3::splat(0.15);
            prop_assert!(
                sampled_meets(start, half, sweep, &wider, at, steps)
                    || sampled_back(start, half, sweep, &wider, at, steps),
                "the trace meets, samples of a wider box do not"
            );
        }
    }

    /// The share of a sweep is where the meeting begins: a little before it there is none, a little
    /// after it there is.
    #[test]
    fn a_sweep_gives_where_it_meets(
        shape in any_shape(),
        at in any_transform(0.5),
        rotation in any_rotation(),
        side in any_vector(0.5),
    ) {
        let start = Transform::new(side + Vec3::new(-6.0, 0.0, 0.0), rotation);
        let half = Vec3::splat(0.3);
        let sweep = Vec3::new(12.0, 0.0, 0.0);
        let mut scene = Scene::new(0.0).unwrap();
        scene.add("it", "it", body(&shape, 0.0), at).unwrap();
        if let Some(found) = scene.detect(&BoxTrace::new(start, half, sweep).unwrap()).first() {
            let moved = |share: f32| Transform::new(start.position + sweep * share, start.rotation);
            let slack = Vec3::splat(0.02);
            prop_assert!(scene.detect(&standing(moved(found.share - 0.005), half - slack)).is_empty());
            prop_assert!(!scene.detect(&standing(moved(found.share), half + slack)).is_empty());
        }
    }

    /// Many instances, and every query with the tree and without.
    #[test]
    fn the_broad_phase_loses_nothing(
        places in prop::collection::vec(any_transform(6.0), 1..60),
        moves in prop::collection::vec((any::<prop::sample::Index>(), any_transform(6.0)), 0..60),
        gone in prop::collection::vec(any::<prop::sample::Index>(), 0..20),
        start in any_transform(6.0),
        direction in any_vector(1.0),
    ) {
        let mut scene = Scene::new(-20.0).unwrap();
        let body = boxed(0.4);
        for (index, &at) in places.iter().enumerate() {
            scene.add(&index.to_string(), "crate", Arc::clone(&body), at).unwrap();
        }
        for (which, to) in &moves {
            scene.move_to(&which.index(places.len()).to_string(), *to).unwrap();
        }
        for which in &gone {
            // Some ids come twice.
            let _ = scene.remove(&which.index(places.len()).to_string());
        }
        let trace = BoxTrace::new(start, Vec3::splat(1.0), direction).unwrap();
        let mut found: Vec<_> = scene.detect(&trace).into_iter().map(|one| one.instance.id.to_string()).collect();
        found.sort();
        let alone = |instance: &Instance| {
            let mut one = Scene::new(-20.0).unwrap();
            one.add(&instance.id, "crate", Arc::clone(&instance.body), instance.transform).unwrap();
            one
        };
        let mut expected: Vec<_> = scene
            .instances()
            .filter(|instance| !alone(instance).detect(&trace).is_empty())
            .map(|instance| instance.id.to_string())
            .collect();
        expected.sort();
        prop_assert_eq!(found, expected);

        let hit = scene.cast_ray(start.position, direction, 30.0, None);
        let nearest = scene
            .instances()
            .filter_map(|instance| alone(instance).cast_ray(start.position, direction, 30.0, None))
            .map(|hit| hit.distance_m)
            .fold(f32::INFINITY, f32::min);
        if let Some(hit) = hit {
            prop_assert!((hit.distance_m - nearest).abs() < 1e-4 || scene.is_empty());
        } else {
            prop_assert_eq!(nearest, f32::INFINITY);
        }
    }

    /// A trigger moves with its instance.
    #[test]
    fn moving_an_instance_moves_its_trigger(
        shape in any_shape(),
        path in prop::collection::vec(any_transform(30.0), 1..12),
    ) {
        let mut scene = Scene::new(0.0).unwrap();
        scene.add("it", "it", body(&shape, 0.3), path[0]).unwrap();
        for step in path.windows(2) {
            let middle = |at: Transform| at.point(Volume::new(&shape).unwrap().center());
            let probe = |at: Transform| standing(place(middle(at).x, middle(at).y, middle(at).z), Vec3::splat(0.01));
            prop_assert_eq!(scene.detect(&probe(step[0])).len(), 1);
            let revision = scene.instance("it").unwrap().revision;
            scene.move_to("it", step[1]).unwrap();
            prop_assert_eq!(scene.detect(&probe(step[1])).len(), 1);
            prop_assert!(scene.instance("it").unwrap().revision > revision);
            if middle(step[0]).distance(middle(step[1])) > 6.0 {
                prop_assert!(scene.detect(&probe(step[0])).is_empty());
            }
        }
    }

    /// A ray ends on the surface: just before the hit it is outside, just after inside.
    #[test]
    fn rays_end_on_surfaces(shape in any_shape(), at in any_transform(1.0), from in any_vector(6.0)) {
        let volume = Volume::new(&shape).unwrap();
        prop_assume!(!volume.contains(at, from));
        let mut scene = Scene::new(-100.0).unwrap();
        scene.add("it", "it", body(&shape, 0.0), at).unwrap();
        let direction = (at.point(volume.center()) - from).normalize();
        let hit = scene.cast_ray(from, direction, 50.0, None).unwrap();
        prop_assert_eq!(&hit.surface, &Surface::Object("it".into()));
        prop_assert!((hit.normal.length() - 1.0).abs() < 1e-3 && hit.normal.dot(direction) <= 1e-3);
        let widened = Volume::grown(&shape, 2e-3).unwrap();
        prop_assert!(widened.contains(at, hit.point));
        prop_assert!(!volume.contains(at, hit.point - direction * 0.01));
    }

    /// The surface of a heightfield lies between the samples around a place; at a sample, it is the
    /// sample.
    #[test]
    fn support_finds_the_height_of_a_heightfield(
        heights in prop::collection::vec(-1.0_f32..1.0, 20),
        x in -1.99_f32..1.99,
        z in -1.49_f32..1.49,
        turn in -3.0_f32..3.0,
    ) {
        let field = Heightfield { rows: 4, columns: 5, size_m: [4.0, 3.0], heights_m: heights.clone() };
        let at = Transform::upright(Vec3::new(7.0, 1.0, -3.0), turn);
        let mut scene = Scene::new(-50.0).unwrap();
        scene.set_colliders(&[collider("hill", ColliderShape::Heightfield(field), at)]).unwrap();
        let below = |x: f32, z: f32| scene.support(at.point(Vec3::new(x, 0.0, z)) + Vec3::Y * 10.0, 50.0, None).unwrap();

        let hit = below(x, z);
        prop_assert_eq!(&hit.surface, &Surface::Collider("hill".into()));
        prop_assert!(hit.normal.y > 0.0);
        let (column, row) = ((x + 2.0).floor() as usize, (z + 1.5).floor() as usize);
        let about = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(r, c)| heights[(row + r).min(3) * 5 + (column + c).min(4)]);
        let (low, high) = about.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        prop_assert!((low - 1e-3..=high + 1e-3).contains(&(hit.point.y - 1.0)));

        let (column, row) = (column.clamp(1, 3), row.clamp(1, 2));
        let sample = below(column as f32 - 2.0, row as f32 - 1.5);
        prop_assert!((sample.point.y - 1.0 - heights[row * 5 + column]).abs() < 1e-2);
    }
}

#[test]
fn triggers_of_held_objects_are_not_found() {
    let mut scene = Scene::new(0.0).unwrap();
    for (id, x) in [("far", 1.2), ("near", 0.8), ("gone", 0.0)] {
        scene.add(id, "crate", boxed(0.2), place(x, 0.2, 0.0)).unwrap();
    }
    scene.hold("gone", &Holder::new("a")).unwrap();
    let trace = standing(place(0.0, 1.0, 0.0), Vec3::new(0.6, 1.0, 0.6));
    let found: Vec<_> = scene
        .detect(&trace)
        .into_iter()
        .map(|one| one.instance.id.to_string())
        .collect();
    assert_eq!(found, ["near", "far"]);
    assert_eq!(
        scene
            .support(Vec3::new(0.0, 2.0, 0.0), 5.0, None)
            .unwrap()
            .surface,
        Surface::Ground
    );
}

#[test]
fn a_box_on_its_way_hits_what_is_solid() {
    let mut scene = Scene::new(0.0).unwrap();
    scene
        .set_colliders(&[
            collider("wall", solid(Vec3::new(3.0, 1.0, 0.1)), place(0.0, 1.0, 4.0)),
            collider(
                "hill",
                ColliderShape::Heightfield(Heightfield {
                    rows: 2,
                    columns: 2,
                    size_m: [2.0, 2.0],
                    heights_m: vec![0.5; 4],
                }),
                place(0.0, 0.0, -5.0),
            ),
        ])
        .unwrap();
    scene
        .add("crate", "crate", boxed(0.5), place(0.0, 0.5, 2.0))
        .unwrap();
    let sweep = |z: f32| {
        BoxTrace::new(
            place(0.0, 0.9, 0.0),
            Vec3::new(0.3, 0.8, 0.3),
            Vec3::new(0.0, 0.0, z),
        )
        .unwrap()
    };
    let (share, what) = scene.first_solid(&sweep(10.0), None).unwrap();
    assert_eq!(what, Surface::Object("crate".into()));
    assert!((share - 0.12).abs() < 1e-3, "{share}");
    let (share, what) = scene.first_solid(&sweep(10.0), Some("crate")).unwrap();
    assert_eq!(what, Surface::Collider("wall".into()));
    assert!((share - 0.36).abs() < 1e-3, "{share}");
    assert_eq!(scene.first_solid(&sweep(1.0), None), None);
    let (share, what) = scene.first_solid(&sweep(-10.0), None).unwrap();
    assert_eq!(what, Surface::Collider("hill".into()));
    assert!((share - 0.37).abs() < 1e-2, "{share}");
    let (share, what) = scene.first_solid(&standing_in_crate(), None).unwrap();
    assert_eq!((share, what), (0.0, Surface::Object("crate".into())));
}

fn standing_in_crate() -> BoxTrace {
    standing(place(0.1, 0.9, 1.9), Vec3::splat(0.3))
}

#[test]
fn rays_find_ground_colliders_and_objects() {
    let mut scene = Scene::new(-0.5).unwrap();
    scene
        .set_colliders(&[collider(
            "step",
            solid(Vec3::new(1.0, 0.1, 1.0)),
            place(5.0, 0.1, 0.0),
        )])
        .unwrap();
    scene
        .add("crate", "crate", boxed(0.25), place(5.0, 0.45, 0.0))
        .unwrap();
    let down = |x: f32, ignore| scene.support(Vec3::new(x, 1.5, 0.0), 3.0, ignore).unwrap();
    let ground = down(0.0, None);
    assert_eq!(
        (ground.surface, ground.point.y, ground.distance_m),
        (Surface::Ground, -0.5, 2.0)
    );
    let on_crate = down(5.0, None);
    assert_eq!(on_crate.surface, Surface::Object("crate".into()));
    assert!((on_crate.point.y - 0.7).abs() < 1e-5 && (on_crate.normal - Vec3::Y).length() < 1e-5);
    let on_step = down(5.0, Some("crate"));
    assert_eq!(on_step.surface, Surface::Collider("step".into()));
    assert!((on_step.point.y - 0.2).abs() < 1e-5);
    // Too short, upward, beside, from inside, and not finite.
    assert_eq!(scene.support(Vec3::new(0.0, 1.5, 0.0), 1.9, None), None);
    assert_eq!(
        scene.cast_ray(Vec3::new(0.0, 1.5, 0.0), Vec3::Y, 100.0, None),
        None
    );
    let inside = scene.support(Vec3::new(5.0, 0.5, 0.0), 1.0, None).unwrap();
    assert!(inside.is_inside() && inside.distance_m == 0.0);
    assert_eq!(scene.cast_ray(Vec3::NAN, Vec3::Y, 1.0, None), None);
    assert_eq!(scene.cast_ray(Vec3::ZERO, Vec3::ZERO, 1.0, None), None);
    assert_eq!(scene.cast_ray(Vec3::ZERO, Vec3::NEG_Y, f32::NAN, None), None);
}

#[test]
fn invalid_box_traces_are_refused() {
    for (start, half, sweep, what) in [
        (place(f32::NAN, 0.0, 0.0), Vec3::ONE, Vec3::ZERO, "start"),
        (
            place(0.0, 0.0, 0.0),
            Vec3::new(1.0, -1.0, 1.0),
            Vec3::ZERO,
            "half extent",
        ),
        (place(0.0, 0.0, 0.0), Vec3::ONE, Vec3::INFINITY, "sweep"),
        (
            Transform::new(Vec3::ZERO, Quat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
            Vec3::ONE,
            Vec3::ZERO,
            "start",
        ),
    ] {
        let error = BoxTrace::new(start, half, sweep).unwrap_err().to_string();
        assert!(error.contains(what) && error.contains("allowed: "), "{error}");
    }
}

/// Cost of a query, a move and a shared move with 1,000 instances. Measured with `--release`; a
/// debug build only runs it.
#[test]
fn queries_of_a_large_scene_are_quick() {
    use std::time::{Duration, Instant};
    let mut scene = Scene::new(0.0).unwrap();
    let body = boxed(0.4);
    let at = |i: usize| place((i % 40) as f32 * 2.5, 0.4, (i / 40) as f32 * 2.5);
    let ids: Vec<String> = (0..1000).map(|index| format!("crate-{index}")).collect();
    for (index, id) in ids.iter().enumerate() {
        scene.add(id, "crate", Arc::clone(&body), at(index)).unwrap();
    }
    let rounds = 2000;
    let time = |work: &mut dyn FnMut(usize)| {
        let mut best = Duration::MAX;
        for _ in 0..5 {
            let start = Instant::now();
            (0..rounds).for_each(&mut *work);
            best = best.min(start.elapsed());
        }
        best / rounds as u32
    };
    let mut found = Vec::new();
    let mut met = 0;
    let detection = time(&mut |i| {
        let start = Transform::upright(at(i % 1000).position + Vec3::Y * 0.5, i as f32);
        let trace = BoxTrace::new(start, Vec3::new(0.6, 0.9, 0.6), Vec3::ZERO).unwrap();
        scene.detect_into(&trace, &mut found);
        met += found.len();
    });
    assert!(met >= rounds);
    let sweep = time(&mut |i| {
        let start = Transform::upright(at(i % 1000).position + Vec3::Y * 0.5, i as f32);
        let trace = BoxTrace::new(start, Vec3::new(0.3, 0.9, 0.3), start.rotation * Vec3::Z * 1.5).unwrap();
        scene.detect_into(&trace, &mut found);
    });
    let ray = time(&mut |i| {
        let hit = scene.support(at(i % 1000).position + Vec3::new(0.3, 3.0, 0.2), 5.0, None);
        assert!(hit.is_some());
    });
    let moving = time(&mut |i| {
        let shift = Vec3::new((i % 7) as f32 * 0.1, 0.0, (i % 5) as f32 * 0.1);
        let to = at(i % 1000).position + shift;
        scene.move_to(&ids[i % 1000], place(to.x, to.y, to.z)).unwrap();
    });
    let cell = SceneCell::new(scene);
    let shared = time(&mut |i| {
        let to = at(i % 1000).position;
        cell.update(|scene| scene.move_to(&ids[i % 1000], place(to.x + 0.1, to.y, to.z)))
            .unwrap();
    });
    println!("detect {detection:?}, swept {sweep:?}, ray {ray:?}, move {moving:?}, shared move {shared:?}");
    if !cfg!(debug_assertions) {
        assert!(detection < Duration::from_micros(20), "{detection:?}");
        assert!(moving < Duration::from_micros(20), "{moving:?}");
    }
}

#[test]
fn a_box_is_bare_without_solid_things() {
    let mut scene = Scene::new(0.0).unwrap();
    let bare =
        |scene: &Scene, x: f32| scene.is_bare(Vec3::new(x - 0.5, -1.0, -0.5), Vec3::new(x + 0.5, 2.0, 0.5));
    assert!(bare(&scene, 0.0), "the ground is no obstacle");
    scene
        .add("crate", "crate", boxed(0.5), place(3.0, 0.5, 0.0))
        .unwrap();
    assert!(bare(&scene, 0.0) && !bare(&scene, 2.2));
    scene.hold("crate", &Holder::new("a")).unwrap();
    assert!(bare(&scene, 2.2), "held objects do not count");
    let wall = Collider {
        id: "wall".to_owned(),
        shape: ColliderShape::Solid(box_shape(Vec3::new(0.1, 1.0, 5.0))),
        transform: place(-2.0, 1.0, 0.0),
    };
    scene.set_colliders(&[wall]).unwrap();
    assert!(bare(&scene, 0.0) && !bare(&scene, -1.8));
}

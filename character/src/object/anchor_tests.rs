//! Anchoring is rigid, its inverse undoes it, and it turns only what it should.

use std::f32::consts::PI;

use proptest::prelude::*;
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::testing::definition;
use super::*;
use crate::scene::Transform;
use crate::scene::testing::{any_rotation, any_transform, any_vector};

fn any_anchor() -> impl Strategy<Value = Anchor> {
    (any_transform(20.0), any_vector(1.0), -PI..PI, -1.0_f32..1.0).prop_map(
        |(object, pivot, side, ground_y)| {
            let mut thing = definition();
            thing.pivot_m = pivot;
            thing.anchor(object, side, ground_y)
        },
    )
}

fn any_keyframe() -> impl Strategy<Value = Keyframe> {
    let points = prop::collection::vec(any_vector(2.0), 0..4);
    let place = prop::option::of(prop::array::uniform2(-3.0_f32..3.0));
    let pose = prop::option::of(prop::collection::vec(any_rotation(), 6));
    (
        any::<bool>(),
        any::<bool>(),
        place,
        -PI..PI,
        0.3_f32..1.2,
        pose,
        points,
    )
        .prop_map(
            |(pivot, from_ground, place_m, heading, height, rotations, points)| Keyframe {
                pivot,
                from_ground,
                place_m,
                heading: Some(heading),
                height_m: Some(height),
                pose_scale: None,
                rotations,
                points: (points.into_iter().enumerate())
                    .map(|(joint, position_m)| Point { joint, position_m })
                    .collect(),
            },
        )
}

fn near(a: Vec3, b: Vec3) -> bool {
    (a - b).length() < 1e-4
}

proptest! {
    #[test]
    fn anchoring_is_rigid(anchor in any_anchor(), pivot: bool, a in any_vector(3.0), b in any_vector(3.0)) {
        let (wa, wb) = (anchor.point(pivot, a), anchor.point(pivot, b));
        prop_assert!((wa.distance(wb) - a.distance(b)).abs() < 1e-4);
        prop_assert!((wa.y - wb.y - (a.y - b.y)).abs() < 1e-4, "up stays up");
        prop_assert!(near(anchor.local_point(pivot, wa), a));
        prop_assert!(near(anchor.point(pivot, anchor.local_pivot_m), anchor.pivot), "the pivot stays");
    }

    #[test]
    fn the_inverse_restores_a_keyframe(anchor in any_anchor(), key in any_keyframe()) {
        let world = anchor.keyframe(&key);
        let back = anchor.local_keyframe(&world, key.pivot, key.from_ground);
        prop_assert_eq!(back.place_m.is_some(), key.place_m.is_some());
        for (a, b) in back.place_m.iter().flatten().zip(key.place_m.iter().flatten()) {
            prop_assert!((a - b).abs() < 1e-4);
        }
        prop_assert!(wrap_angle(back.heading.unwrap() - key.heading.unwrap()).abs() < 1e-4);
        prop_assert!((back.height_m.unwrap() - key.height_m.unwrap()).abs() < 1e-4);
        for (a, b) in back.rotations.iter().flatten().zip(key.rotations.iter().flatten()) {
            prop_assert!(a.dot(*b).abs() > 0.9999);
        }
        for (a, b) in back.points.iter().zip(&key.points) {
            prop_assert!(a.joint == b.joint && near(a.position_m, b.position_m));
        }
    }

    /// Turning object and character together turns the result, and nothing else.
    #[test]
    fn it_turns_with_the_world(
        object in any_transform(5.0),
        from in any_vector(8.0),
        turn in -PI..PI,
        key in any_keyframe(),
    ) {
        // Near a half turn about a level axis, an object's heading is only rounding.
        prop_assume!(object.rotation.y.hypot(object.rotation.w) > 0.05);
        let thing = definition();
        let away = from - thing.pivot(object);
        prop_assume!(away.x.hypot(away.z) > 0.1);
        let world = Transform::upright(Vec3::new(3.0, 0.0, -2.0), turn);
        let at = |object: Transform, from: Vec3| {
            thing.anchor(object, thing.side_of(object, from), 0.0).keyframe(&key)
        };
        let (before, after) = (at(object, from), at(world * object, world.point(from)));
        let place = |key: &WorldKeyframe| key.place.map(|[x, z]| Vec3::new(x, 0.0, z));
        if let (Some(a), Some(b)) = (place(&before), place(&after)) {
            let moved = world.point(a);
            prop_assert!((moved - b).length() < 2e-2, "{} {}", moved, b);
        }
        prop_assert!(wrap_angle(after.heading.unwrap() - before.heading.unwrap() - turn).abs() < 2e-3);
        prop_assert_eq!(after.height.is_some(), before.height.is_some());
        for (a, b) in after.height.iter().zip(before.height.iter()) {
            prop_assert!((a - b).abs() < 1e-4, "{} {}", a, b);
        }
    }

    /// With ω, the character has the pivot in front of it from any side. Without, the side does not
    /// matter.
    #[test]
    fn the_pivot_flag_decides(object in any_transform(5.0), side in -PI..PI, distance in 0.2_f32..2.0) {
        let thing = definition();
        let anchor = thing.anchor(object, side, 0.0);
        let key = |pivot| Keyframe {
            pivot,
            place_m: Some([thing.pivot_m.x, thing.pivot_m.z + distance]),
            heading: Some(PI),
            ..Keyframe::default()
        };
        let turned = anchor.keyframe(&key(true));
        let [x, z] = turned.place.unwrap();
        let away = Vec3::new(x, anchor.pivot.y, z) - anchor.pivot;
        prop_assert!((away.length() - distance).abs() < 1e-3);
        prop_assert!(wrap_angle(thing.side_of(object, anchor.pivot + away) - side).abs() < 1e-2);
        let facing = yaw(turned.heading.unwrap()) * Vec3::Z;
        prop_assert!(near(facing * distance, -away));
        let start = anchor.start(distance);
        prop_assert!(near(Vec3::new(x, 0.0, z), start.position));
        prop_assert!(wrap_angle(start.heading - turned.heading.unwrap()).abs() < 1e-4);

        let fixed = |side| thing.anchor(object, side, 0.0).keyframe(&key(false));
        prop_assert_eq!(fixed(side), fixed(0.0));
        prop_assert_eq!(thing.anchor(object, 0.0, 0.0).keyframe(&key(false)).place, thing.anchor(object, 0.0, 0.0).keyframe(&key(true)).place);
    }

    /// The heading of the anchored pose is the anchored heading.
    #[test]
    fn poses_turn_with_their_heading(anchor in any_anchor(), heading in -PI..PI, bend in -0.8_f32..0.8, pivot: bool) {
        let key = Keyframe {
            pivot,
            heading: Some(heading),
            height_m: Some(0.9),
            rotations: Some(vec![Quat::from_rotation_x(bend), Quat::from_rotation_z(0.3)]),
            ..Keyframe::default()
        };
        let world = anchor.keyframe(&key);
        let rotations = world.rotations.unwrap();
        let found = heading_of(rotations[0], Vec3::X);
        prop_assert!(wrap_angle(found - world.heading.unwrap()).abs() < 1e-3);
        prop_assert!(rotations[1].dot(Quat::from_rotation_z(0.3)).abs() > 0.9999, "others are unchanged");
    }
}

#[test]
fn heights_count_from_the_object_or_the_ground() {
    let thing = definition();
    let shelf = Transform::upright(Vec3::new(2.0, 1.2, 0.0), 0.4);
    let anchor = thing.anchor(shelf, 0.0, 0.25);
    let key = |from_ground| Keyframe {
        from_ground,
        height_m: Some(0.9),
        points: vec![Point {
            joint: 1,
            position_m: Vec3::new(0.0, 0.1, 0.0),
        }],
        ..Keyframe::default()
    };
    let heights = |from_ground| {
        let world = anchor.keyframe(&key(from_ground));
        (world.height.unwrap(), world.points[0].position.y)
    };
    let close = |(a, b): (f32, f32), (c, d): (f32, f32)| (a - c).abs() < 1e-5 && (b - d).abs() < 1e-5;
    assert!(close(heights(false), (2.1, 1.3)), "{:?}", heights(false));
    assert!(close(heights(true), (1.15, 0.35)), "{:?}", heights(true));
}

#[test]
fn sets_of_the_character_follow_its_root() {
    let root = GlobalRoot::new(Vec3::new(1.0, 0.93, 2.0), PI / 2.0);
    let anchor = Anchor::of_character(root, 0.1);
    let world = anchor.keyframe(&Keyframe {
        place_m: Some([0.0, 0.5]),
        heading: Some(0.25),
        height_m: Some(0.8),
        ..Keyframe::default()
    });
    let [x, z] = world.place.unwrap();
    assert!((x - 1.5).abs() < 1e-5 && (z - 2.0).abs() < 1e-5);
    assert!((world.height.unwrap() - 0.9).abs() < 1e-5);
    assert!((world.heading.unwrap() - (PI / 2.0 + 0.25)).abs() < 1e-5);
    assert_eq!(world.root().unwrap().position.x, x);
    let partly = WorldKeyframe {
        height: Some(0.5),
        ..WorldKeyframe::default()
    };
    assert_eq!(partly.root(), None);
    let filled = partly.root_or(root);
    assert_eq!(filled, GlobalRoot::new(Vec3::new(1.0, 0.5, 2.0), PI / 2.0));
}

#[test]
fn the_side_is_seen_from_the_pivot() {
    let thing = definition();
    let object = Transform::upright(Vec3::new(4.0, 0.0, 0.0), PI / 2.0);
    // The object faces +X. A character there is at its front; one at +Z is on its left, at -90
    // degrees.
    let side = |x: f32, z: f32| thing.side_of(object, Vec3::new(x, 1.0, z)).to_degrees();
    assert!(side(9.0, 0.0).abs() < 1e-3);
    assert!((side(4.0, 3.0) + 90.0).abs() < 1e-3);
    assert!((side(4.0, -3.0) - 90.0).abs() < 1e-3);
    assert_eq!(side(4.0, 0.0), 0.0);
}

use troupe_motion::rotation::angle_between;

use super::*;
use crate::live::behaviour::testing::{HAND, definitions, doll_rig, doll_style};
use crate::object::{Definition, Keyframe, Point};
use crate::scene::Transform;

/// The definition of `object`, and its set of this name.
fn set_of(object: &str, name: &str) -> (std::sync::Arc<Definition>, Set) {
    let definition = definitions(&doll_rig()).get(object).unwrap().definition;
    let set = definition.set(name).unwrap().clone();
    (definition, set)
}

/// The doll, standing at a place.
fn standing(x: f32, z: f32, heading: f32) -> (Vec3, Vec<Quat>) {
    let style = doll_style();
    let mut rotations = style.idle().rotations.clone();
    rotations[0] = yaw(heading) * rotations[0];
    (Vec3::new(x, style.idle().height_m, z), rotations)
}

fn worked_out(
    set: &Set,
    anchor: &Anchor,
    ground: f32,
    from: &(Vec3, Vec<Quat>),
) -> Result<Vec<Key>, Unreachable> {
    let (rig, style) = (doll_rig(), doll_style());
    let legs = legs(&rig.skeleton);
    let body = BodyParts {
        skeleton: &rig.skeleton,
        legs: &legs,
        standing: style.idle(),
    };
    let from = Posed {
        root: from.0,
        rotations: &from.1,
    };
    keys(set, anchor, ground, &body, from)
}

#[test]
fn a_hand_is_brought_to_its_point() {
    let (cup, reach) = set_of("cup", "reach");
    let object = Transform::upright(Vec3::new(1.0, 1.0, 2.0), 0.3);
    // From the object's own +Z side, on ground at 0.2 m.
    let anchor = cup.anchor(object, 0.0, 0.2);
    let key = &worked_out(&reach, &anchor, 0.2, &standing(0.0, 0.0, 0.0)).unwrap()[0];
    let place = object.point(Vec3::new(0.0, 0.0, 0.45));
    assert!(
        (key.root - place).with_y(0.0).length() < 0.25,
        "{} is not near {place}",
        key.root
    );
    let root = key.global_root(Vec3::X);
    assert!(wrap_angle(root.heading - 0.3 - std::f32::consts::PI).abs() < 0.05);
    let skeleton = &doll_rig().skeleton;
    let hand = joint_transform(skeleton, key.root, &key.rotations, HAND).0;
    let want = object.point(Vec3::new(-0.05, 0.12, 0.06)) - Vec3::Y * 0.2;
    assert!(hand.distance(want) < 1e-3, "{hand} is not {want}");
    assert_eq!(key.error(skeleton, key.posed()), KeyframeError::default());
}

#[test]
fn a_point_out_of_reach_is_an_error() {
    let (cup, reach) = set_of("cup", "reach");
    let anchor = cup.anchor(Transform::upright(Vec3::new(0.0, 2.6, 0.0), 0.0), 0.0, 0.0);
    let unreachable = worked_out(&reach, &anchor, 0.0, &standing(0.0, 1.0, 0.0)).unwrap_err();
    assert_eq!(unreachable.joint, HAND);
    assert!(unreachable.short_m > 0.3, "{unreachable:?}");
}

#[test]
fn a_keyframe_is_completed_by_the_one_before() {
    let (_, mut set) = set_of("sign", "rise");
    set.keyframes = vec![Keyframe {
        heading: Some(1.0),
        ..Keyframe::default()
    }];
    let from = standing(2.0, 3.0, 0.4);
    let anchor = Anchor::of_character(GlobalRoot::new(from.0, 0.4), 0.0);
    let key = &worked_out(&set, &anchor, 0.0, &from).unwrap()[0];
    assert_eq!(key.root, from.0);
    assert!(angle_between(key.rotations[0], yaw(1.4)) < 1e-5);
    assert_eq!(key.rotations[1..], from.1[1..]);
}

#[test]
fn keyframes_go_on_from_each_other() {
    let (_, mut set) = set_of("sign", "rise");
    let place = Keyframe {
        place_m: Some([0.0, 0.5]),
        ..Keyframe::default()
    };
    let turn = Keyframe {
        heading: Some(0.5),
        ..Keyframe::default()
    };
    set.keyframes = vec![place, turn];
    let from = standing(0.0, 0.0, 0.0);
    let anchor = Anchor::of_character(GlobalRoot::new(from.0, 0.0), 0.0);
    let keys = worked_out(&set, &anchor, 0.0, &from).unwrap();
    assert_eq!(keys[1].root, keys[0].root);
    assert!((keys[1].root.z - 0.5).abs() < 1e-5);
}

#[test]
fn motions_without_the_networks() {
    let from = standing(0.0, 0.0, 0.0);
    let posed = Posed {
        root: from.0,
        rotations: &from.1,
    };
    let skeleton = &doll_rig().skeleton;
    let anchor = Anchor::of_character(GlobalRoot::new(from.0, 0.0), 0.0);
    let (_, mut lift) = set_of("cup", "lift");
    let keys = worked_out(&lift, &anchor, 0.0, &from).unwrap();
    assert!(suits_stance(&lift, &keys, posed), "only a point");
    let (frames, lean) = stance_frames(&lift, skeleton, posed, &keys[0]);
    assert!((10..=24).contains(&frames) && lean == 0.0);
    // Both feet step one after the other, which takes longer than the same distance at once.
    let aside = Key {
        root: keys[0].root + Vec3::X * 0.15,
        ..keys[0].clone()
    };
    let stepping = stance_frames(&lift, skeleton, posed, &aside).0;
    assert!(
        (18..=24).contains(&stepping) && stepping > frames,
        "{frames} {stepping}"
    );
    lift.frames = Some(17);
    assert_eq!(stance_frames(&lift, skeleton, posed, &keys[0]).0, 17);
    lift.motion = Some(Motion::Plan);
    assert!(!suits_stance(&lift, &keys, posed));
    let (bench, sit) = set_of("bench", "sit");
    let anchor = bench.anchor(Transform::upright(Vec3::new(0.0, 0.2, -0.3), 0.0), 0.0, 0.0);
    let seat = worked_out(&sit, &anchor, 0.0, &from).unwrap();
    assert!(suits_stance(&sit, &seat, posed) && suits_stance(&sit, &[], seat[0].posed()));
    assert_eq!(stance_frames(&sit, skeleton, posed, &seat[0]), LOW_STANCE);
    // The feet stay in place.
    let foot = |root, rotations: &[Quat]| joint_transform(skeleton, root, rotations, 12).0;
    assert!(foot(seat[0].root, &seat[0].rotations).distance(foot(from.0, &from.1)) < 0.02);
}

/// Token counts for a key `way` metres ahead.
fn counts(set: &Set, way: f32, turn: f32, speed: f32, first: bool) -> Vec<u32> {
    let rig = doll_rig();
    let (root, rotations) = standing(0.0, way, turn);
    let key = Key {
        root,
        rotations,
        points: Vec::new(),
    };
    let from = GlobalRoot::new(Vec3::new(0.0, 0.9, 0.0), 0.0);
    let velocity = Vec3::Z * speed;
    let way = Way {
        from,
        velocity,
        first,
    };
    targets(set, &[key], &rig, &way).allowed_token_counts
}

#[test]
fn a_plan_has_time_for_its_way() {
    let (_, set) = set_of("sign", "nod");
    // At half of 1.4 m/s, two metres take 2.9 s: 16 tokens, of which 15 may be asked for.
    assert_eq!(counts(&set, 2.0, 0.0, 1.4, true), [15, 16]);
    assert_eq!(counts(&set, 0.8, 0.0, 2.0, true), (7..=16).collect::<Vec<_>>());
    assert_eq!(counts(&set, 0.0, 3.0, 0.0, true), (6..=16).collect::<Vec<_>>());
    // From one keyframe to the next it takes about a second, and longer with a turn.
    assert_eq!(counts(&set, 0.0, 0.0, 0.0, false), [5, 6, 7, 8]);
    assert_eq!(counts(&set, 0.1, 1.57, 0.0, false), [9, 10, 11, 12]);
    assert_eq!(counts(&set, 0.5, 0.0, 0.0, false), (9..=16).collect::<Vec<_>>());
}

#[test]
fn frames_that_a_set_gives_are_kept_to() {
    let (_, mut again) = set_of("sign", "again");
    let way = Way {
        from: GlobalRoot::new(Vec3::ZERO, 0.0),
        velocity: Vec3::ZERO,
        first: false,
    };
    let asked = targets(&again, &[], &doll_rig(), &way);
    assert_eq!((asked.frames, asked.allowed_token_counts.len()), (Some(24), 0));
    again.frames = Some(8);
    assert_eq!(
        targets(&again, &[], &doll_rig(), &way).frames,
        Some(13),
        "it has to fade in"
    );
}

/// A hand that reaches far and low makes the body bow. Bowing moves hips back, but not away from a
/// given place.
#[test]
fn hips_come_to_the_place_that_is_given() {
    let (cup, reach) = set_of("cup", "reach");
    for height in [0.5, 0.7, 0.9] {
        let anchor = cup.anchor(Transform::upright(Vec3::Y * height, 0.0), 0.0, 0.0);
        let key = &worked_out(&reach, &anchor, 0.0, &standing(0.0, 2.0, 0.0)).unwrap()[0];
        let place = key.root.with_y(0.0);
        assert!(place.distance(Vec3::Z * 0.45) < 0.005, "at {height}: {place}");
    }
}

#[test]
fn several_joints_are_brought_to_their_points() {
    let (_, mut lift) = set_of("cup", "lift");
    let point = |joint, x: f32, y, z| Point {
        joint,
        position_m: Vec3::new(x, y, z),
    };
    lift.keyframes[0].points = vec![point(HAND, -0.2, 1.2, 0.3), point(9, 0.2, 1.3, 0.25)];
    let from = standing(0.0, 0.0, 0.0);
    let anchor = Anchor::of_character(GlobalRoot::new(from.0, 0.0), 0.0);
    let key = &worked_out(&lift, &anchor, 0.0, &from).unwrap()[0];
    let skeleton = &doll_rig().skeleton;
    for &(joint, place) in &key.points {
        let at = joint_transform(skeleton, key.root, &key.rotations, joint).0;
        assert!(at.distance(place) < 1e-3);
    }
}

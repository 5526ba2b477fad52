//! A doll with knees and elbows, objects that it can use, and a harness that drives it.

mod event;
mod harness;

use std::sync::Arc;

use troupe_motion::{ContactParams, Joint, Quat, Skeleton, Vec3};

use crate::object::{Definition, Definitions};
use crate::scene::{Collider, ColliderShape, Scene, Shape, Transform};
use crate::skill::Skills;
use crate::testing::rig_of;
use troupe_motion::model::Rig;

use crate::style::{Gait, Style, StyleKey};

pub(crate) use event::*;
pub(crate) use harness::*;

pub(crate) const HAND: usize = 6;

/// Angle of thigh and shin at which hips at 0.9 m have flat feet on the ground, radians.
const BEND: f32 = 0.342;

/// A pelvis, chest and head, two arms and two legs; left is +X, and it faces +Z.
pub(crate) fn doll() -> Arc<Skeleton> {
    let joint = |name: &str, parent, offset: [f32; 3]| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::from(offset),
    };
    let mut joints = vec![
        joint("Hips", None, [0.0; 3]),
        joint("Spine", Some(0), [0.0, 0.15, 0.0]),
        joint("Chest", Some(1), [0.0, 0.2, 0.0]),
        joint("Head", Some(2), [0.0, 0.3, 0.0]),
    ];
    for (side, x) in [("R", -0.18), ("L", 0.18)] {
        let first = joints.len();
        joints.push(joint(&format!("UpperArm_{side}"), Some(2), [x, 0.15, 0.0]));
        joints.push(joint(&format!("LowerArm_{side}"), Some(first), [0.0, -0.28, 0.0]));
        joints.push(joint(&format!("Hand_{side}"), Some(first + 1), [0.0, -0.26, 0.0]));
    }
    for (side, x) in [("L", 0.1), ("R", -0.1)] {
        let first = joints.len();
        joints.push(joint(&format!("UpperLeg_{side}"), Some(0), [x, -0.02, 0.0]));
        joints.push(joint(&format!("LowerLeg_{side}"), Some(first), [0.0, -0.44, 0.0]));
        joints.push(joint(&format!("Foot_{side}"), Some(first + 1), [0.0, -0.42, 0.0]));
    }
    let contacts = ContactParams {
        joints: vec![12, 15],
        max_height_m: vec![0.12; 2],
        max_speed_mps: 0.4,
        clearance_m: vec![0.07; 2],
    };
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
}

pub(crate) fn doll_rig() -> Arc<Rig> {
    Arc::new(rig_of("dolls", (*doll()).clone()))
}

/// A style that stands with bent knees and walks at 1.2 m/s.
pub(crate) fn doll_style() -> Arc<Style> {
    let key = |forward_mps: f32, swing: f32| {
        let mut rotations = vec![Quat::IDENTITY; doll().joint_count()];
        for (first, side) in [(10, 1.0), (13, -1.0)] {
            rotations[first] = Quat::from_rotation_x(-BEND + side * swing);
            rotations[first + 1] = Quat::from_rotation_x(2.0 * BEND);
            rotations[first + 2] = Quat::from_rotation_x(-BEND - side * swing);
        }
        for lower_arm in [5, 8] {
            rotations[lower_arm] = Quat::from_rotation_x(-0.2);
        }
        StyleKey {
            rotations,
            height_m: 0.9,
            left_mps: 0.0,
            forward_mps,
            turn_rps: 0.0,
        }
    };
    let gait = |name: &str, forward_mps: f32, keys: Vec<StyleKey>| Gait {
        name: name.to_owned(),
        left_mps: 0.0,
        forward_mps,
        turn_rps: 0.0,
        period_frames: if keys.len() > 1 { 30.0 } else { 0.0 },
        keys,
        built: false,
    };
    let walk = (0..10)
        .map(|k| key(1.2, 0.3 * (k as f32 * 0.628).sin()))
        .collect();
    Arc::new(Style {
        name: "calm".to_owned(),
        default_speed_mps: 1.2,
        replan_interval_frames: 9,
        allowed_token_counts: Vec::new(),
        is_static: false,
        root_ratio: 0.0,
        gaits: vec![gait("walk", 1.2, walk), gait("idle", 0.0, vec![key(0.0, 0.0)])],
        words: None,
        takes: Arc::default(),
        built_in: true,
        cache: Default::default(),
    })
}

/// A cup to take from a table, carry and put down.
pub(crate) const CUP: &str = r#"
format = 1
name = "cup"

[shape.box]
center_m = [0.0, 0.06, 0.0]
half_extents_m = [0.04, 0.06, 0.04]

[release]
max_drop_m = 1.2

[[sockets]]
name = "hand"
joint = "Hand_R"
position_m = [0.0, -0.1, 0.0]
blend_frames = 4

[[variants]]
name = "right"
entry = "reach"
exit = "put-down"

[[variants]]
name = "quick"
weight = 1.0
entry = "snatch"

[[sets]]
name = "reach"
next = "lift"
events = [{ attach = "hand" }]

[[sets.keyframes]]
pivot = true
place_m = [0.0, 0.45]
heading_deg = 180.0
points = [{ joint = "Hand_R", position_m = [-0.05, 0.12, 0.06] }]

[[sets]]
name = "lift"
origin = "character"
drop_frames = 8
hold_until_ended = true
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.2, 1.1, 0.3] }] }]

[[sets]]
name = "put-down"
origin = "character"
events = [{ release = true }]
keyframes = [{ from_ground = true, points = [{ joint = "Hand_R", position_m = [-0.1, 1.0, 0.42] }] }]

[[sets]]
name = "snatch"
hold_frames = 10
events = [{ attach = "hand" }]

[[sets.keyframes]]
pivot = true
place_m = [0.0, 0.5]
heading_deg = 180.0
points = [{ joint = "Hand_R", position_m = [-0.05, 0.12, 0.06] }]
"#;

/// A sign to nod at twice, for any number of characters at once: one hard keyframe, then a soft
/// one.
const SIGN: &str = r#"
format = 1
name = "sign"
solid = false
shared = true

[shape.box]
half_extents_m = [0.2, 1.0, 0.2]

[[approaches]]
name = "front"
directions_deg = [-60.0, 60.0]
distance_m = 1.0

[[approaches]]
name = "back"
directions_deg = [120.0, 240.0]
distance_m = 1.0

[[variants]]
name = "nod"
entry = "nod"

[[sets]]
name = "nod"
next = "again"
hold_frames = 6
keyframes = [{ pivot = true, place_m = [0.0, 1.0], heading_deg = 180.0, height_m = 0.88, from_ground = true }]

[[sets]]
name = "again"
next = "rise"
drop_frames = 5
motion = "plan"
frames = 20
keyframes = [{ pivot = true, place_m = [0.1, 1.0], heading_deg = 180.0, height_m = 0.86, from_ground = true }]

[[sets]]
name = "rise"
drop_frames = 4
keyframes = [{ pivot = true, heading_deg = 180.0, height_m = 0.9, from_ground = true }]
"#;

/// A low bench to sit on.
const BENCH: &str = r#"
format = 1
name = "bench"
solid = false

[shape.box]
half_extents_m = [0.5, 0.2, 0.2]

[[variants]]
name = "sit"
entry = "turn"
exit = "up"

[[sets]]
name = "turn"
next = "sit"
from_stand = true
keyframes = [{ place_m = [0.0, 0.3], heading_deg = 0.0 }]

[[sets]]
name = "sit"
hold_until_ended = true
keyframes = [{ place_m = [0.0, -0.05], heading_deg = 0.0, height_m = 0.45, from_ground = true }]

[[sets]]
name = "up"
keyframes = [{ place_m = [0.0, 0.3], heading_deg = 0.0, height_m = 0.9, from_ground = true }]
"#;

/// Lying down and getting up again, a squat, and a jump.
pub(crate) const SKILLS: [&str; 2] = [
    r#"
format = 1
name = "lie"
variants = [{ name = "down", entry = "sink", exit = "rise" }, { name = "squat", weight = 0.0, entry = "bend" }]

[[sets]]
name = "sink"
next = "lie"
frames = 20
drop_frames = 2
keyframes = [{ height_m = 0.6, from_ground = true, heading_deg = 0.0, place_m = [0.0, 0.1] }]

[[sets]]
name = "lie"
frames = 20
hold_until_ended = true
keyframes = [{ height_m = 0.4, from_ground = true, heading_deg = 0.0, place_m = [0.0, 0.2] }]

[[sets]]
name = "rise"
frames = 24
keyframes = [{ height_m = 0.9, from_ground = true, heading_deg = 0.0, place_m = [0.0, 0.1] }]

[[sets]]
name = "bend"
hold_frames = 10
keyframes = [{ height_m = 0.5, from_ground = true, heading_deg = 0.0 }]
"#,
    r#"
format = 1
name = "spring"
variants = [{ name = "up", entry = "off" }]

[[sets]]
name = "off"
next = "land"
frames = 12
drop_frames = 2
keyframes = [{ height_m = 1.2, from_ground = true, heading_deg = 0.0, place_m = [0.0, 0.2] }]

[[sets]]
name = "land"
frames = 12
keyframes = [{ height_m = 0.9, from_ground = true, heading_deg = 0.0, place_m = [0.0, 0.2] }]
"#,
];

pub(crate) fn skills(rig: &Rig) -> Arc<Skills> {
    let read = |text: &&str| Definition::skill_from_toml(text, rig).unwrap();
    Arc::new(Skills::new(SKILLS.iter().map(read)))
}

pub(crate) fn definitions(rig: &Rig) -> Arc<Definitions> {
    let all = [CUP, SIGN, BENCH].map(|text| Definition::from_toml(text, rig).unwrap());
    Arc::new(Definitions::new(all).unwrap())
}

pub(crate) fn block(id: &str, center: [f32; 3], half: [f32; 3]) -> Collider {
    Collider {
        id: id.to_owned(),
        shape: ColliderShape::Solid(Shape::Box {
            center_m: Vec3::ZERO,
            half_extents_m: Vec3::from(half),
        }),
        transform: Transform::new(Vec3::from(center), Quat::IDENTITY),
    }
}

/// A table of 0.8 m with a cup 3 m ahead of the origin, a sign 4 m to its left, and a bench behind.
pub(crate) fn room(definitions: &Definitions) -> Scene {
    let mut scene = Scene::new(0.0).unwrap();
    let table = block("table", [0.0, 0.4, 3.15], [0.6, 0.4, 0.25]);
    scene.set_colliders(&[table]).unwrap();
    let body = |name: &str| Arc::clone(&definitions.get(name).unwrap().definition.body);
    let at = |x: f32, y: f32, z: f32| Transform::new(Vec3::new(x, y, z), Quat::IDENTITY);
    scene.add("cup", "cup", body("cup"), at(0.0, 0.8, 3.0)).unwrap();
    scene
        .add("sign", "sign", body("sign"), at(4.0, 0.0, 0.0))
        .unwrap();
    scene
        .add("bench", "bench", body("bench"), at(0.0, 0.2, -3.0))
        .unwrap();
    scene
}

#[test]
fn the_doll_stands() {
    let skeleton = doll();
    assert_eq!(troupe_motion::ik::legs(&skeleton).len(), 2);
    assert_eq!(skeleton.joint_index("Hand_R"), Some(HAND));
    let rig = {
        let mut rig = Harness::new();
        rig.tick();
        rig
    };
    for foot in [12, 15] {
        let place = rig.joints(0)[foot];
        assert!((place.y - 0.07).abs() < 1e-3, "{place}");
    }
    let body: &crate::scene::Body = &rig.object("cup").body;
    assert!(body.solid && !body.shared);
}

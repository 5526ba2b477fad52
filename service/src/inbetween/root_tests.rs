use std::f32::consts::{FRAC_PI_2, PI};

use troupe_character::testing::toy_rig;
use troupe_motion::model::KeyframeTask;

use super::*;
use crate::inbetween::{Plan, RequestLimits, prepare};

fn root(frame: u32, x: f32, z: f32) -> v1::RootKey {
    v1::RootKey {
        frame,
        x: Some(x),
        z: Some(z),
        ..v1::RootKey::default()
    }
}

fn keyframe(x: f32) -> v1::Keyframe {
    let (z, turned) = (2.0, troupe_motion::Quat::from_rotation_y(FRAC_PI_2));
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x, y: 0.9, z }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: vec![turned.w, turned.x, turned.y, turned.z, 1.0, 0.0, 0.0, 0.0],
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

/// Walks along +X, which it faces, at 3 m/s from x = 5, for 30 frames: the last context frame is at
/// 5.3, the target at 7.9.
fn character(roots: Vec<v1::RootKey>) -> v1::Character {
    v1::Character {
        context: (0..4).map(|frame| keyframe(5.0 + 0.1 * frame as f32)).collect(),
        targets: vec![keyframe(7.9)],
        frame_count: Some(30),
        root: roots,
        ..v1::Character::default()
    }
}

fn prepared(character: v1::Character) -> Result<(KeyframeTask, Plan), FieldError> {
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
        skeleton: String::new(),
    };
    let (mut items, mut plans) = prepare(
        &Path::root(),
        &request,
        &toy_rig(),
        RequestLimits { max_characters: 1 },
    )?;
    Ok((items.remove(0), plans.remove(0)))
}

fn assert_near(key: &RootKey, ground: [f32; 2], height: Option<f32>, heading: Option<f32>) {
    let near = |a: Option<f32>, b: Option<f32>| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() < 1e-5,
        (a, b) => a == b,
    };
    let [x, z] = key.ground.unwrap();
    assert!(
        (x - ground[0]).abs() < 1e-5 && (z - ground[1]).abs() < 1e-5,
        "{key:?}"
    );
    assert!(near(key.height, height) && near(key.heading, heading), "{key:?}");
}

#[test]
fn roots_come_into_the_segment_frame_beside_those_of_the_targets() {
    let full = v1::RootKey {
        height: Some(0.8),
        heading: Some(-PI),
        ..root(15, 6.5, 2.5)
    };
    let (item, plan) = prepared(character(vec![root(10, 6.0, 1.75), full])).unwrap();
    let over = item.root_override.unwrap();
    // One who faces +X has +Z at the right, which is the segment's -X.
    assert_near(&over.keys()[0], [0.25, 0.7], None, None);
    assert_near(&over.keys()[1], [-0.5, 1.2], Some(0.8), Some(FRAC_PI_2));
    assert_near(&over.keys()[2], [0.0, 2.6], Some(0.9), Some(0.0));
    let frames: Vec<usize> = over.keys().iter().map(|key| key.frame).collect();
    assert_eq!(frames, [10, 15, 29]);
    let given = plan.root.unwrap();
    assert_eq!((given.over, given.frames), (over, vec![10, 15]));
    assert!(prepared(character(Vec::new())).unwrap().0.root_override.is_none());
}

#[test]
fn every_frame_may_have_a_root_that_repeats_the_keyframes() {
    let all = (0..30).map(|frame| v1::RootKey {
        heading: Some(FRAC_PI_2),
        ..root(frame, 5.0 + 0.1 * frame as f32, 2.0)
    });
    let (item, plan) = prepared(character(all.collect())).unwrap();
    let over = item.root_override.unwrap();
    assert_eq!((over.keys().len(), plan.root.unwrap().frames.len()), (26, 30));
    // A target's own root is whole.
    assert_near(&over.keys()[25], [0.0, 2.6], Some(0.9), Some(0.0));
}

#[test]
fn an_entry_may_give_a_part_alone() {
    let part = v1::RootKey {
        frame: 12,
        heading: Some(0.0),
        ..v1::RootKey::default()
    };
    let over = prepared(character(vec![part])).unwrap().0.root_override.unwrap();
    assert_eq!((over.keys()[0].ground, over.keys()[0].height), (None, None));
    assert!((over.keys()[0].heading.unwrap() + FRAC_PI_2).abs() < 1e-5);
}

#[test]
fn a_target_without_a_root_takes_the_given_one() {
    let mut posed = character(vec![root(29, 7.0, 3.0)]);
    posed.targets[0].root = None;
    posed.targets[0].pose.as_mut().unwrap().root_height = Some(0.9);
    let (item, _) = prepared(posed).unwrap();
    let over = item.root_override.unwrap();
    assert_near(&over.keys()[0], [-1.0, 1.7], None, None);
    assert_eq!(over.keys().len(), 1);
}

/// Changes a good character, and what the error must say: field and allowed range.
type Case = (fn(&mut v1::Character), &'static str, &'static str);

#[rustfmt::skip]
const CASES: &[Case] = &[
    (|c| c.frame_count = None, "frame_count", "12 to 64"),
    (|c| c.root[1].frame = 30, "root[1].frame", "11 to 29"),
    (|c| c.root[1].frame = u32::MAX, "root[1].frame", "11 to 29"),
    (|c| c.root[1].frame = 10, "root[1].frame", "frames that rise from entry to entry"),
    (|c| c.root[1].frame = 0, "root[1].frame", "frames that rise from entry to entry"),
    (|c| c.root[0].x = Some(f32::NAN), "root[0].x", "a finite number"),
    (|c| c.root[0].z = Some(f32::INFINITY), "root[0].z", "a finite number"),
    (|c| c.root[0].x = None, "root[0].x", "both x and z, or neither"),
    (|c| c.root[1].z = None, "root[1].z", "both x and z, or neither"),
    (|c| c.root[1] = v1::RootKey { frame: 15, ..Default::default() }, "root[1]", "at least one of x and z, height and heading"),
    (|c| c.root[1].height = Some(f32::NAN), "root[1].height", "a finite number"),
    (|c| c.root[1].height = Some(100.5), "root[1].height", "-100 to 100"),
    (|c| c.root[1].heading = Some(f32::NEG_INFINITY), "root[1].heading", "a finite number"),
    (|c| c.root[0].x = Some(1.1e4), "root[0]", "at most 10000 m from the last context frame"),
    (|c| c.root[0].z = Some(f32::MAX), "root[0]", "at most 10000 m from the last context frame"),
    (|c| c.root[0] = root(3, 5.4, 2.0), "root[0]", "x and z within 0.001 m of 5.3 and 2"),
    (|c| c.root[1] = root(29, 7.9, 2.5), "root[1]", "x and z within 0.001 m of 7.9 and 2"),
    (|c| c.root[1] = v1::RootKey { height: Some(0.8), ..root(29, 7.9, 2.0) }, "root[1].height", "within 0.001 m of 0.9, or left out"),
    (|c| c.root[1] = v1::RootKey { heading: Some(0.0), ..root(29, 7.9, 2.0) }, "root[1].heading", "within 0.01 rad of 1.5707964, or left out"),
    (|c| { posed(c); c.root[1] = v1::RootKey { heading: Some(0.0), ..root(29, 7.0, 3.0) } }, "root[1].heading", "within 0.01 rad of 1.5707964, or left out"),
    (|c| { posed(c); c.root[1] = v1::RootKey { height: Some(0.0), ..root(29, 7.0, 3.0) } }, "root[1].height", "within 0.001 m of 0.9, or left out"),
];

/// Leaves a pose of the target alone.
fn posed(character: &mut v1::Character) {
    character.targets[0].root = None;
    character.targets[0].pose.as_mut().unwrap().root_height = Some(0.9);
}

#[test]
fn every_bad_value_is_named_with_its_range() {
    for (index, (change, field, allowed)) in CASES.iter().enumerate() {
        let mut character = character(vec![root(10, 6.0, 1.75), root(15, 6.5, 2.5)]);
        change(&mut character);
        let error = prepared(character).expect_err(&format!("case {index}, {field}"));
        assert_eq!(
            (error.field.as_str(), error.allowed.as_str()),
            (&*format!("characters[0].{field}"), *allowed),
            "case {index}"
        );
    }
}

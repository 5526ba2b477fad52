use std::f32::consts::FRAC_PI_2;

use troupe_motion::Quat;

use super::*;
use troupe_character::testing::toy_rig;

const LIMITS: RequestLimits = RequestLimits { max_characters: 2 };

fn position(x: f32, y: f32, z: f32) -> Option<v1::Vec3> {
    Some(v1::Vec3 { x, y, z })
}

fn pose(heading: f32) -> v1::Pose {
    let q = Quat::from_rotation_y(heading);
    v1::Pose {
        rotations: vec![q.w, q.x, q.y, q.z, 1.0, 0.0, 0.0, 0.0],
        root_height: None,
    }
}

fn keyframe(x: f32, z: f32, heading: f32) -> v1::Keyframe {
    v1::Keyframe {
        root: Some(v1::Root {
            position: position(x, 0.9, z),
            heading: None,
        }),
        velocity: None,
        qpos: Vec::new(),
        pose: Some(pose(heading)),
    }
}

/// Walks along +X (facing it) at 3 m/s, from x = 5.
fn character() -> v1::Character {
    v1::Character {
        context: (0..4)
            .map(|frame| keyframe(5.0 + 0.1 * frame as f32, 2.0, FRAC_PI_2))
            .collect(),
        targets: vec![keyframe(8.3, 2.0, FRAC_PI_2)],
        ..v1::Character::default()
    }
}

fn prepared(character: v1::Character) -> Result<(KeyframeTask, Plan), FieldError> {
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
        skeleton: String::new(),
    };
    let (mut items, mut plans) = prepare(&Path::root(), &request, &toy_rig(), LIMITS)?;
    Ok((items.remove(0), plans.remove(0)))
}

fn assert_near(actual: &[f32], expected: &[f32]) {
    assert_eq!(actual.len(), expected.len());
    for (a, b) in actual.iter().zip(expected) {
        assert!((a - b).abs() < 1e-4, "{actual:?} is not {expected:?}");
    }
}

#[test]
fn the_segment_frame_starts_at_the_last_context_frame() {
    let (item, plan) = prepared(character()).unwrap();
    assert_near(&item.context[3].global_root.unwrap(), &[0.0, 0.9, 0.0, 1.0, 0.0]);
    assert_near(&item.context[0].global_root.unwrap(), &[0.0, 0.9, -0.3, 1.0, 0.0]);
    assert_near(&item.targets[0].global_root.unwrap(), &[0.0, 0.9, 3.0, 1.0, 0.0]);
    assert_eq!(item.targets[0].local_root, None);
    for key in &item.context {
        assert_near(&key.local_root.unwrap(), &[0.0, 3.0, 0.0, 0.9]);
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let expected = [[0.0, 0.9, 0.0].as_slice(), &identity, &[0.0, 0.1, 0.0], &identity].concat();
        assert_near(key.pose.as_ref().unwrap(), &expected);
    }
    assert_near(&plan.frame.origin.to_array(), &[5.3, 0.0, 2.0]);
    assert!((plan.frame.heading - FRAC_PI_2).abs() < 1e-5);
    assert!(item.allowed_counts.iter().all(|&may| may));
    assert_eq!((item.pose_steps, item.frames), (1, None));
}

#[test]
fn given_headings_and_velocities_win_over_derived_ones() {
    let mut given = character();
    given.targets = vec![keyframe(8.0, 2.0, 0.0), keyframe(8.1, 2.0, 0.0)];
    given.targets[1].root.as_mut().unwrap().heading = Some(0.0);
    given.targets[1].velocity = Some(v1::RootVelocity {
        x: 6.0,
        z: 0.0,
        angular: 0.5,
        height: None,
    });
    let (item, plan) = prepared(given).unwrap();
    assert!((plan.targets[1].root.unwrap().heading + FRAC_PI_2).abs() < 1e-5);
    assert_near(&item.targets[0].local_root.unwrap(), &[0.0, 3.0, 0.0, 0.9]);
    assert_near(&item.targets[1].local_root.unwrap(), &[0.0, 6.0, 0.5, 0.9]);
}

#[test]
fn what_a_keyframe_gives_twice_may_differ_by_rounding() {
    let mut twice = character();
    let target = &mut twice.targets[0];
    root(target).heading = Some(FRAC_PI_2 - 0.009);
    height(target, 0.9005);
    target.velocity = Some(v1::RootVelocity {
        height: Some(0.8995),
        ..Default::default()
    });
    let (item, _) = prepared(twice).unwrap();
    assert_near(&item.targets[0].local_root.unwrap(), &[0.0, 0.0, 0.0, 0.9]);

    // A heading a turn further is the same one, and one who lies on a side has none to compare
    // with.
    let mut turned = character();
    root(&mut turned.targets[0]).heading = Some(FRAC_PI_2 - std::f32::consts::TAU);
    prepared(turned).unwrap();
    let mut lying = character();
    let side = Quat::from_rotation_z(FRAC_PI_2);
    rotations(&mut lying.targets[0])[..4].copy_from_slice(&[side.w, side.x, side.y, side.z]);
    root(&mut lying.targets[0]).heading = Some(2.0);
    prepared(lying).unwrap();
}

#[test]
fn any_subset_makes_a_target() {
    let mut partial = character();
    partial.targets = vec![
        v1::Keyframe {
            root: Some(v1::Root {
                position: position(6.0, 0.9, 2.0),
                heading: Some(0.0),
            }),
            ..Default::default()
        },
        v1::Keyframe {
            pose: Some(v1::Pose {
                root_height: Some(0.7),
                ..pose(FRAC_PI_2)
            }),
            ..Default::default()
        },
        v1::Keyframe {
            velocity: Some(v1::RootVelocity {
                x: 1.0,
                z: 0.0,
                angular: 0.0,
                height: Some(0.8),
            }),
            ..Default::default()
        },
    ];
    let (item, plan) = prepared(partial).unwrap();
    let has = |key: &troupe_motion::model::KeyTensors| {
        (
            key.local_root.is_some(),
            key.global_root.is_some(),
            key.pose.is_some(),
        )
    };
    let expected = [(false, true, false), (false, false, true), (true, false, false)];
    assert_eq!(item.targets.iter().map(has).collect::<Vec<_>>(), expected);
    assert_near(&item.targets[1].pose.as_ref().unwrap()[..3], &[0.0, 0.7, 0.0]);
    assert_near(&item.targets[2].local_root.unwrap(), &[0.0, 1.0, 0.0, 0.8]);
    assert_eq!(
        plan.targets
            .iter()
            .map(|key| (key.root.is_some(), key.height))
            .collect::<Vec<_>>(),
        [(true, Some(0.9)), (false, Some(0.7)), (false, Some(0.8))]
    );
}

#[test]
fn counts_follow_the_request() {
    let allowed = |change: &dyn Fn(&mut v1::Character)| {
        let mut character = character();
        change(&mut character);
        let (item, _) = prepared(character).unwrap();
        (0..)
            .zip(item.allowed_counts)
            .filter(|count| count.1)
            .map(|count| count.0 + 3)
            .collect::<Vec<i32>>()
    };
    assert_eq!(allowed(&|c| c.frame_count = Some(12)), [3]);
    assert_eq!(allowed(&|c| c.frame_count = Some(13)), [4]);
    assert_eq!(allowed(&|c| c.frame_count = Some(64)), [16]);
    assert_eq!(
        allowed(&|c| c.allowed_token_counts = vec![16, 3, 5, 3]),
        [3, 5, 16]
    );
}

#[test]
fn keyframes_alone_can_ask_for_more_tokens() {
    let mut pack = toy_rig();
    pack.dims.min_tokens = 1;
    let mut request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character()],
        skeleton: String::new(),
    };
    let (items, _) = prepare(&Path::root(), &request, &pack, LIMITS).unwrap();
    assert_eq!(items[0].allowed_counts[..3], [false, true, true]);
    request.characters[0].frame_count = Some(4);
    let error = prepare(&Path::root(), &request, &pack, LIMITS).unwrap_err();
    assert_eq!(
        (error.field.as_str(), error.allowed.as_str()),
        ("characters[0].frame_count", "5 to 64")
    );
    request.characters[0].frame_count = None;
    request.characters[0].allowed_token_counts = vec![1];
    let error = prepare(&Path::root(), &request, &pack, LIMITS).unwrap_err();
    assert_eq!(error.allowed, "2 to 16");
}

/// Changes a good character, and what the error must say: field and allowed range.
type Case = (fn(&mut v1::Character), &'static str, &'static str);

#[rustfmt::skip]
const CASES: &[Case] = &[
    (|c| c.id = "x".repeat(129), "id", "at most 128 bytes"),
    (|c| c.context.truncate(3), "context", "exactly 4"),
    (|c| c.context.push(keyframe(0.0, 0.0, 0.0)), "context", "exactly 4"),
    (|c| c.targets.clear(), "targets", "1 to 4"),
    (|c| c.targets = vec![keyframe(6.0, 2.0, 0.0); 5], "targets", "1 to 4"),
    (|c| c.temperature = -0.1, "temperature", "0 to 2"),
    (|c| c.temperature = f32::NAN, "temperature", "0 to 2"),
    (|c| c.temperature = f32::INFINITY, "temperature", "0 to 2"),
    (|c| c.pose_steps = Some(0), "pose_steps", "1 to 10"),
    (|c| c.pose_steps = Some(11), "pose_steps", "1 to 10"),
    (|c| c.frame_count = Some(11), "frame_count", "12 to 64"),
    (|c| c.frame_count = Some(65), "frame_count", "12 to 64"),
    (|c| c.frame_count = Some(u32::MAX), "frame_count", "12 to 64"),
    (|c| c.allowed_token_counts = vec![3, 2], "allowed_token_counts[1]", "3 to 16"),
    (|c| c.allowed_token_counts = vec![17], "allowed_token_counts[0]", "3 to 16"),
    (|c| { c.frame_count = Some(12); c.allowed_token_counts = vec![3] }, "allowed_token_counts", "only one of the two"),
    (|c| c.context[1].root = None, "context[1].root", "root and pose in every context keyframe"),
    (|c| c.context[2].pose = None, "context[2].pose", "root and pose in every context keyframe"),
    (|c| root(&mut c.context[0]).position = None, "context[0].root.position", "x, y and z in metres"),
    (|c| c.targets[0] = v1::Keyframe::default(), "targets[0]", "at least one of root, velocity and pose"),
    (|c| root(&mut c.targets[0]).position = None, "targets[0].root.position", "x, y and z in metres"),
    (|c| root(&mut c.targets[0]).position = position(f32::NAN, 0.0, 0.0), "targets[0].root.position.x", "a finite number"),
    (|c| root(&mut c.context[3]).position = position(0.0, 0.0, f32::INFINITY), "context[3].root.position.z", "a finite number"),
    (|c| root(&mut c.targets[0]).heading = Some(f32::NEG_INFINITY), "targets[0].root.heading", "a finite number"),
    (|c| c.targets[0].pose = None, "targets[0].root.heading", "a heading in radians, or a pose in the same keyframe"),
    (|c| root(&mut c.targets[0]).position = position(1.1e4, 0.9, 2.0), "targets[0].root.position", "at most 10000 m from the last context frame"),
    (|c| root(&mut c.context[0]).position = position(5.0, 3e38, 2.0), "context[0].root.position.y", "-100 to 100"),
    (|c| c.context.iter_mut().chain(&mut c.targets).for_each(|key| root(key).position = position(5.0, 3e38, 2.0)), "context[0].root.position.y", "-100 to 100"),
    (|c| root(&mut c.targets[0]).position = position(5.0, -100.1, 2.0), "targets[0].root.position.y", "-100 to 100"),
    (|c| root(&mut c.targets[0]).heading = Some(1.55), "targets[0].root.heading", "within 0.01 rad of 1.5707964, or left out"),
    (|c| height(&mut c.targets[0], 0.902), "targets[0].pose.root_height", "within 0.001 m of 0.9, or left out"),
    (|c| c.targets[0].velocity = Some(v1::RootVelocity { height: Some(0.8), ..Default::default() }), "targets[0].velocity.height", "within 0.001 m of 0.9, or left out"),
    (|c| rotations(&mut c.context[2]).truncate(7), "context[2].pose.rotations", "exactly 8: 4 (w, x, y, z) for each of the pack's 2 joints"),
    (|c| rotations(&mut c.targets[0]).clear(), "targets[0].pose.rotations", "exactly 8: 4 (w, x, y, z) for each of the pack's 2 joints"),
    (|c| rotations(&mut c.context[2])[5] = f32::NAN, "context[2].pose.rotations[5]", "a finite number"),
    (|c| rotations(&mut c.context[2])[4] = 1.002, "context[2].pose.rotations[4]", "unit length, 0.999 to 1.001"),
    (|c| rotations(&mut c.targets[0])[4] = 0.0, "targets[0].pose.rotations[4]", "unit length, 0.999 to 1.001"),
    (|c| rotations(&mut c.targets[0])[4] = f32::MAX, "targets[0].pose.rotations[4]", "unit length, 0.999 to 1.001"),
    (|c| c.targets[0].root = None, "targets[0].pose.root_height", "the root joint's height in metres, or a root"),
    (|c| { c.targets[0].root = None; height(&mut c.targets[0], f32::NAN) }, "targets[0].pose.root_height", "a finite number"),
    (|c| { c.targets[0].root = None; height(&mut c.targets[0], -2e4) }, "targets[0].pose.root_height", "-100 to 100"),
    (|c| c.context[0].velocity = Some(v1::RootVelocity { z: f32::NAN, ..Default::default() }), "context[0].velocity.z", "a finite number"),
    (|c| c.targets[0].velocity = Some(v1::RootVelocity { x: -1001.0, ..Default::default() }), "targets[0].velocity.x", "-1000 to 1000"),
    (|c| c.targets[0].velocity = Some(v1::RootVelocity { angular: f32::INFINITY, ..Default::default() }), "targets[0].velocity.angular", "a finite number"),
    (|c| only_velocity(&mut c.targets[0], None), "targets[0].velocity.height", "the root joint's height in metres, or a root"),
    (|c| only_velocity(&mut c.targets[0], Some(f32::NAN)), "targets[0].velocity.height", "a finite number"),
    (|c| only_velocity(&mut c.targets[0], Some(2e4)), "targets[0].velocity.height", "-100 to 100"),
];

fn root(key: &mut v1::Keyframe) -> &mut v1::Root {
    key.root.as_mut().unwrap()
}

fn rotations(key: &mut v1::Keyframe) -> &mut Vec<f32> {
    &mut key.pose.as_mut().unwrap().rotations
}

fn height(key: &mut v1::Keyframe, height: f32) {
    key.pose.as_mut().unwrap().root_height = Some(height);
}

fn only_velocity(key: &mut v1::Keyframe, height: Option<f32>) {
    *key = v1::Keyframe {
        velocity: Some(v1::RootVelocity {
            height,
            ..Default::default()
        }),
        ..v1::Keyframe::default()
    };
}

#[test]
fn every_bad_value_is_named_with_its_range() {
    for (index, (change, field, allowed)) in CASES.iter().enumerate() {
        let mut character = character();
        change(&mut character);
        let error = prepared(character).expect_err(&format!("case {index}, {field}"));
        assert_eq!(
            (error.field.as_str(), error.allowed.as_str()),
            (&*format!("characters[0].{field}"), *allowed)
        );
    }
}

#[test]
fn the_frame_count_error_speaks_of_the_gap() {
    let mut short = character();
    short.frame_count = Some(11);
    let text = prepared(short).unwrap_err().to_string();
    assert!(
        text.contains("counts the 4 context frames, the gap and the targets; allowed: 12 to 64"),
        "{text}"
    );
}

#[test]
fn the_number_of_characters_is_limited() {
    for (count, message) in [(0, "is empty"), (3, "has 3 characters")] {
        let request = v1::InBetweenRequest {
            pack: String::new(),
            characters: vec![character(); count],
            skeleton: String::new(),
        };
        let error = prepare(&Path::root(), &request, &toy_rig(), LIMITS).unwrap_err();
        assert_eq!(
            (
                error.field.as_str(),
                error.message.as_str(),
                error.allowed.as_str()
            ),
            ("characters", message, "1 to 2")
        );
    }
}

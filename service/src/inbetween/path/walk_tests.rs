use std::path::Path as FilePath;

use troupe_motion::rotation::to_wxyz;

use super::*;

/// The trained pack and its styles; its networks are not looked at.
fn human() -> (Pack, StyleTable) {
    let folder = FilePath::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../models/human"));
    let pack = Pack::load(folder).unwrap();
    let styles = StyleTable::load(&pack.rig, folder, None).unwrap();
    (pack, styles)
}

fn at(x: f32, z: f32, time: Option<f32>) -> v1::PathPoint {
    v1::PathPoint {
        position: Some(v1::Vec3 { x, y: 0.0, z }),
        time,
        ..v1::PathPoint::default()
    }
}

/// Four metres ahead at 1 m/s.
fn straight() -> v1::PathGoal {
    v1::PathGoal {
        points: vec![at(0.0, 0.0, Some(0.0)), at(0.0, 4.0, Some(4.0))],
        ..v1::PathGoal::default()
    }
}

/// The pack's idle pose with its root at a place.
fn key(styles: &StyleTable, x: f32, z: f32) -> v1::Keyframe {
    let style = styles.default_style().unwrap();
    let idle = style.idle();
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x,
                y: idle.height_m,
                z,
            }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: idle.rotations.iter().copied().flat_map(to_wxyz).collect(),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

fn keyframe(time: f32, keyframe: v1::Keyframe) -> v1::PathKeyframe {
    v1::PathKeyframe {
        time,
        keyframe: Some(keyframe),
    }
}

fn prepared(request: &v1::GenerateRequest, goal: &v1::PathGoal) -> Result<Walking, FieldError> {
    let (pack, styles) = human();
    prepare_walk(&Path::root(), request, goal, &pack, &styles)
}

#[test]
fn a_path_becomes_a_take_with_its_past_keyframes_and_targets() {
    let (_, styles) = human();
    let past: Vec<_> = (0..4)
        .map(|frame| key(&styles, 0.0, -0.01 * (3 - frame) as f32))
        .collect();
    let request = v1::GenerateRequest {
        past,
        seed: 9,
        ..v1::GenerateRequest::default()
    };
    let goal = v1::PathGoal {
        keyframes: vec![
            keyframe(3.0, key(&styles, 0.5, 3.0)),
            keyframe(1.0, key(&styles, 0.0, 1.0)),
        ],
        targets: (0..2).map(|_| key(&styles, 0.2, 4.1)).collect(),
        ..straight()
    };
    let walking = prepared(&request, &goal).unwrap();
    let take = &walking.path.take;
    assert_eq!((take.frames, take.seed, take.look.temperature), (120, 9, 1.0));
    assert!(take.past.is_some() && take.in_parts);
    // The last frame of the past is at time 0.
    let frames: Vec<usize> = take.wanted.keys.iter().map(|key| key.frame).collect();
    assert_eq!(frames, [29, 89, 118, 119]);
    let way = &walking.path.way;
    assert_eq!(way.len(), 121);
    assert!(
        (way[90][0] - 0.5).abs() < 1e-3,
        "it bends to the keyframe: {:?}",
        way[90]
    );
    assert!(way[70][0].abs() < 1e-3, "and only near it: {:?}", way[70]);
    assert_eq!(walking.notes(&Path::root()), [""; 0]);
}

#[test]
fn a_keyframe_without_a_root_is_on_the_path() {
    let (_, styles) = human();
    let mut pose = key(&styles, 0.0, 0.0);
    pose.root = None;
    pose.pose.as_mut().unwrap().root_height = Some(0.9);
    let goal = v1::PathGoal {
        keyframes: vec![keyframe(2.0, pose)],
        ..straight()
    };
    let walking = prepared(&v1::GenerateRequest::default(), &goal).unwrap();
    let key = &walking.path.take.wanted.keys[0];
    let root = key.root.unwrap();
    assert_eq!(key.frame, 60);
    assert!(
        (root.z - 2.0).abs() < 1e-3 && (root.y - 0.9).abs() < 1e-6,
        "{root}"
    );
}

#[test]
fn a_path_that_the_style_cannot_keep_up_with_has_a_note() {
    let goal = v1::PathGoal {
        points: vec![at(0.0, 0.0, Some(0.0)), at(0.0, 30.0, Some(4.0))],
        ..v1::PathGoal::default()
    };
    let walking = prepared(&v1::GenerateRequest::default(), &goal).unwrap();
    let notes = walking.notes(&Path::root());
    assert!(
        notes[0].contains("7.5 m/s") && notes[0].contains("falls behind"),
        "{notes:?}"
    );
}

type Change = fn(&mut v1::GenerateRequest, &mut v1::PathGoal, &StyleTable);

#[test]
fn what_makes_no_sense_names_its_field() {
    let (pack, styles) = human();
    let cases: [(Change, &str); 19] = [
        (
            |_, goal, _| goal.body = "horse".into(),
            "path.body: is given; allowed: none: the pack human has one skeleton",
        ),
        (
            |_, goal, _| goal.skeleton = Some(v1::BodySkeleton::default()),
            "path.skeleton: is given; allowed: none: the pack human has one skeleton",
        ),
        (
            |_, goal, _| goal.steps = Some(4),
            "path.steps: is given; allowed: none: the pack human has no sampler",
        ),
        (
            |_, goal, _| goal.guidance = Some(2.0),
            "path.guidance: is 2; allowed: 1, or left out: the pack human has no sampler",
        ),
        (
            |_, goal, _| goal.style = vec![word("moonwalk", None)],
            "path.style[0].word: is \"moonwalk\"; allowed: ",
        ),
        (
            |_, goal, _| goal.style = vec![word("normal", Some(0.5))],
            "path.style[0].weight: is 0.5; allowed: 1, or left out: the pack human blends no styles",
        ),
        (
            |_, goal, _| goal.style = vec![word("normal", None), word("old", None)],
            "path.style: has 2 entries; allowed: at most 1: the pack human walks in one style",
        ),
        (
            |request, _, styles| request.past = vec![key(styles, 0.0, 0.0)],
            "past: has 1 keyframes; allowed: none, or exactly 4",
        ),
        (
            |request, _, styles| request.past = vec![key(styles, 6.0, 0.0); 4],
            "past[3].root.position: is 6.0 m from the path's begin; allowed: at most 5 m",
        ),
        (
            |_, goal, styles| goal.targets = vec![key(styles, 0.0, 10.0)],
            "path.targets[0].root.position: is 6.0 m from the path's end; allowed: at most 5 m",
        ),
        (
            |_, goal, styles| goal.keyframes = vec![keyframe(4.5, key(styles, 0.0, 4.0))],
            "path.keyframes[0].time: is 4.5; allowed: 0.00 to 4.00, inside the motion",
        ),
        (
            |_, goal, styles| goal.keyframes = vec![keyframe(2.0, key(styles, 0.0, 2.0)); 2],
            "path.keyframes[1].time: is 2, in the frame of another keyframe; allowed: one keyframe a frame",
        ),
        (
            |_, goal, styles| goal.keyframes = vec![keyframe(2.0, key(styles, 8.0, 2.0))],
            "path.keyframes[0].keyframe.root.position: is 8.0 m from the path; allowed: at most 5 m",
        ),
        (
            |_, goal, _| goal.keyframes = vec![v1::PathKeyframe::default()],
            "path.keyframes[0].keyframe: is missing; allowed: a keyframe with a pose",
        ),
        (
            |_, goal, styles| {
                let mut key = key(styles, 0.0, 2.0);
                key.pose = None;
                key.root.as_mut().unwrap().heading = Some(0.0);
                goal.keyframes = vec![keyframe(2.0, key)];
            },
            "path.keyframes[0].keyframe.pose: is missing; allowed: a pose in every keyframe of a path",
        ),
        (
            |_, goal, styles| {
                let mut key = key(styles, 0.0, 2.0);
                key.velocity = Some(v1::RootVelocity::default());
                goal.keyframes = vec![keyframe(2.0, key)];
            },
            "path.keyframes[0].keyframe.velocity: is given; allowed: none beside a path",
        ),
        (
            |request, _, _| {
                request.sampling = Some(v1::Sampling {
                    top_k: Some(3),
                    ..v1::Sampling::default()
                });
            },
            "sampling.top_k: is given; allowed: none: the pack human has no language model",
        ),
        (
            |_, goal, _| goal.points.clear(),
            "path.points: is empty; allowed: 1 to 10000",
        ),
        (
            |_, goal, _| goal.points[1].time = Some(0.1),
            "path.points[1]: is reached at 40.0 m/s; allowed: at most 15 m/s",
        ),
    ];
    for (change, said) in cases {
        let (mut request, mut goal) = (v1::GenerateRequest::default(), straight());
        change(&mut request, &mut goal, &styles);
        let error = prepare_walk(&Path::root(), &request, &goal, &pack, &styles).unwrap_err();
        assert!(error.to_string().starts_with(said), "{error}");
    }
}

fn word(word: &str, weight: Option<f32>) -> v1::StyleWord {
    v1::StyleWord {
        word: word.to_owned(),
        weight,
    }
}

#[test]
fn a_strict_path_is_one_that_the_style_and_the_data_show() {
    let (pack, _) = human();
    let refused = |goal: &v1::PathGoal| {
        let walking = prepared(&v1::GenerateRequest::default(), goal).unwrap();
        strict::refuse_walk(&Path::root(), &walking, &pack.rig)
            .err()
            .map(|error| error.0.to_string())
    };
    assert_eq!(refused(&straight()), None);
    let fast = v1::PathGoal {
        points: vec![at(0.0, 0.0, Some(0.0)), at(0.0, 30.0, Some(4.0))],
        ..v1::PathGoal::default()
    };
    let error = refused(&fast).unwrap();
    assert!(error.starts_with("path.points: "), "{error}");
}

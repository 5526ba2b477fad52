use std::path::Path as FilePath;

use super::*;
use troupe_character::post::roots;
use troupe_character::take::speed_mps;
use troupe_motion::model::{Motion, PathTask};
use troupe_motion::rotation::six_d;
use troupe_motion::{GlobalRoot, Vec3};

/// The trained pack's manifest and bodies; its network is not looked at.
fn pack() -> Pack {
    Pack::load(FilePath::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../models/unimogen"
    )))
    .unwrap()
}

fn at(x: f32, z: f32) -> v1::PathPoint {
    v1::PathPoint {
        position: Some(v1::Vec3 { x, y: 0.0, z }),
        ..v1::PathPoint::default()
    }
}

fn straight(seconds: f32) -> v1::PathGoal {
    v1::PathGoal {
        points: vec![at(0.0, 0.0), at(0.0, 1.2 * seconds)],
        seconds: Some(seconds),
        ..v1::PathGoal::default()
    }
}

fn plan(goal: &v1::PathGoal) -> Result<PathPlan, FieldError> {
    prepare_path(&Path::root(), goal, &[], 5, &pack())
}

/// The neutral pose along the task's path.
fn follow(task: &PathTask) -> Motion {
    let mut motion = Motion::default();
    for &[x, z, heading] in &task.path {
        let root = GlobalRoot::new(Vec3::new(x, task.body.height_m, z), heading);
        motion.root.extend(root.to_array());
        let turn = troupe_motion::rotation::yaw(heading);
        for neutral in &task.body.neutral {
            motion.rotations.extend(six_d(turn * *neutral));
        }
        motion.contacts.extend(vec![1.0; task.body.rig.dims.contacts]);
    }
    motion
}

/// All frames of a plan, made by [`follow`]: world x, z and heading.
fn walked(plan: &mut PathPlan) -> (Vec<[f32; 3]>, Vec<PathTask>) {
    let (mut frames, mut tasks) = (Vec::new(), Vec::new());
    while let Some((task, frame)) = plan.next_task() {
        let (fresh, is_last) = plan.receive(&follow(&task), &frame);
        frames.extend(roots(&fresh.root).map(|root| {
            let root = frame.to_world_root(root);
            [root.position.x, root.position.z, root.heading]
        }));
        assert_eq!(is_last, plan.next_task().is_none());
        tasks.push(task);
    }
    (frames, tasks)
}

#[test]
fn a_motion_of_any_length_is_made_window_by_window() {
    for (seconds, windows) in [(0.1, 1), (2.0, 1), (2.3, 2), (10.0, 5), (60.0, 29)] {
        let mut plan = plan(&straight(seconds)).unwrap();
        let (frames, tasks) = walked(&mut plan);
        assert_eq!(frames.len(), (seconds * 30.0).round() as usize + 1, "{seconds} s");
        assert_eq!(tasks.len(), windows, "{seconds} s");
        for (frame, [x, z, heading]) in frames.iter().enumerate() {
            let wanted = 1.2 * frame as f32 / 30.0;
            assert!(
                (z - wanted).abs() < 1e-3 && x.abs() < 1e-3 && heading.abs() < 1e-3,
                "{frame}: {x} {z}"
            );
        }
        for (number, task) in tasks.iter().enumerate() {
            assert!((20..=68).contains(&task.path.len()) && task.path.len().is_multiple_of(4));
            assert_eq!(task.context.len(), if number == 0 { 0 } else { 4 });
            assert_eq!((task.seed, task.steps), (5 + number as u64, 4));
        }
    }
}

/// A keyframe of the human in its neutral pose.
fn key(x: f32, z: f32) -> v1::Keyframe {
    let body = pack().body("human").unwrap().clone();
    let mut rotations = Vec::new();
    for (joint, neutral) in body.neutral.iter().enumerate() {
        let parent = body.rig.skeleton.joints[joint].parent;
        let local = parent.map_or(*neutral, |parent| body.neutral[parent].inverse() * *neutral);
        rotations.extend(troupe_motion::rotation::to_wxyz(local));
    }
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x, y: 0.94, z }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations,
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

#[test]
fn it_leads_over_from_the_past_and_ends_at_the_targets() {
    let past: Vec<_> = (0..4)
        .map(|frame| key(1.0, -0.12 + 0.04 * frame as f32))
        .collect();
    let targets: Vec<_> = (0..2).map(|frame| key(-0.5, 4.8 + 0.04 * frame as f32)).collect();
    let goal = v1::PathGoal {
        targets,
        body: "human".into(),
        ..straight(4.0)
    };
    let mut plan = prepare_path(&Path::root(), &goal, &past, 5, &pack()).unwrap();
    let (frames, tasks) = walked(&mut plan);
    assert_eq!(frames.len(), 120);
    assert_eq!(tasks[0].context.len(), 4);
    let last = tasks.last().unwrap();
    assert_eq!((last.targets.len(), last.path.len()), (2, 4 + 120 - 64));
    let steps = frames.windows(2).map(|pair| speed_mps(pair, 30.0));
    assert!(steps.fold(0.0, f32::max) < 6.0);
    let [first, middle, end] = [frames[0], frames[60], frames[119]];
    assert!((first[0] - 1.0).abs() < 0.05, "{first:?}");
    assert!(middle[0].abs() < 0.01, "{middle:?}");
    assert!(
        (end[0] + 0.5).abs() < 1e-3 && (end[1] - 4.84).abs() < 1e-3,
        "{end:?}"
    );

    let far = prepare_path(
        &Path::root(),
        &straight(2.0),
        &[key(6.0, 0.0), key(6.0, 0.0), key(6.0, 0.0), key(6.0, 0.0)],
        5,
        &pack(),
    );
    let error = far.map(|_| ()).unwrap_err();
    assert_eq!(error.field, "past[3].root.position");
}

#[test]
fn what_makes_no_sense_names_its_field() {
    let timed = |times: &[f32]| v1::PathGoal {
        points: times
            .iter()
            .map(|&time| v1::PathPoint {
                time: Some(time),
                ..at(time, 0.0)
            })
            .collect(),
        ..v1::PathGoal::default()
    };
    let with = |change: &dyn Fn(&mut v1::PathGoal)| {
        let mut goal = straight(2.0);
        change(&mut goal);
        goal
    };
    let word = |word: &str, weight: f32| {
        with(&|goal| {
            goal.style.push(v1::StyleWord {
                word: word.into(),
                weight: Some(weight),
            })
        })
    };
    let skeleton = |joints: &[(&str, &str, f32)]| {
        let joints = joints.iter().map(|&(name, parent, y)| v1::BodyJoint {
            name: name.into(),
            parent: parent.into(),
            offset: Some(v1::Vec3 { x: 0.0, y, z: 0.0 }),
        });
        let joints = joints.collect();
        with(&|goal| {
            goal.skeleton = Some(v1::BodySkeleton {
                joints: Vec::clone(&joints),
                ..v1::BodySkeleton::default()
            });
        })
    };
    let cases = [
        (v1::PathGoal::default(), "path.points"),
        (timed(&[0.0, 0.0]), "path.points[1].time"),
        (timed(&[0.0]), "path.seconds"),
        (timed(&[0.0, 301.0]), "path.points"),
        (with(&|goal| goal.seconds = Some(f32::NAN)), "path.seconds"),
        (with(&|goal| goal.seconds = Some(301.0)), "path.seconds"),
        (with(&|goal| goal.speed = Some(16.0)), "path.speed"),
        (
            with(&|goal| goal.points[1].position = None),
            "path.points[1].position",
        ),
        (
            with(&|goal| goal.points[1] = at(f32::NAN, 0.0)),
            "path.points[1].position.x",
        ),
        (
            with(&|goal| goal.points[0].time = Some(0.0)),
            "path.points[1].time",
        ),
        (
            with(&|goal| goal.points[1].heading = Some(f32::INFINITY)),
            "path.points[1].heading",
        ),
        (
            with(&|goal| {
                goal.points[1] = v1::PathPoint {
                    time: Some(1.0),
                    ..at(0.0, 40.0)
                };
                goal.points[0].time = Some(0.0);
            }),
            "path.points[1]",
        ),
        (with(&|goal| goal.body = "cat".into()), "path.body"),
        (with(&|goal| goal.steps = Some(0)), "path.steps"),
        (with(&|goal| goal.steps = Some(51)), "path.steps"),
        (with(&|goal| goal.guidance = Some(9.0)), "path.guidance"),
        (
            with(&|goal| goal.targets = vec![v1::Keyframe::default()]),
            "path.targets[0].root",
        ),
        (word("moonwalk", 1.0), "path.style[0].word"),
        (word("walk", 1.5), "path.style[0].weight"),
        (skeleton(&[]), "path.skeleton.joints"),
        (
            skeleton(&[("a", "b", 1.0), ("b", "a", 1.0)]),
            "path.skeleton.joints[0].parent",
        ),
        (
            skeleton(&[("a", "", 1.0), ("b", "", 1.0)]),
            "path.skeleton.joints[1].parent",
        ),
        (
            skeleton(&[("a", "", 1.0), ("b", "x", 1.0)]),
            "path.skeleton.joints[1].parent",
        ),
        (
            skeleton(&[("a", "", 1.0), ("b", "a", 0.0)]),
            "path.skeleton.joints[1].offset",
        ),
        (
            skeleton(&[("a", "", 1.0), ("b", "a", f32::NAN)]),
            "path.skeleton.joints[1].offset",
        ),
    ];
    for (goal, field) in cases {
        let error = plan(&goal).map(|_| ()).unwrap_err();
        assert_eq!(error.field, field, "{error}");
        assert!(!error.allowed.is_empty(), "{error}");
    }
}

#[test]
fn what_no_clip_shows_has_a_note() {
    let mut goal = v1::PathGoal {
        body: "horse".into(),
        ..straight(2.0)
    };
    assert_eq!(plan(&goal).unwrap().notes, Vec::<String>::new());
    goal.style.push(v1::StyleWord {
        word: "chimpira".into(),
        weight: None,
    });
    goal.points[1] = at(0.0, 24.0);
    let notes = plan(&goal).unwrap().notes;
    assert!(
        notes[0].contains("m/s fast") && notes[1] == "no clip of horse shows chimpira",
        "{notes:?}"
    );
}

#[test]
fn a_skeleton_of_ones_own_is_a_body() {
    let joint = |name: &str, parent: &str, x, y| v1::BodyJoint {
        name: name.into(),
        parent: parent.into(),
        offset: Some(v1::Vec3 { x, y, z: 0.0 }),
    };
    let goal = v1::PathGoal {
        skeleton: Some(v1::BodySkeleton {
            joints: vec![
                joint("hips", "", 0.0, 1.0),
                joint("left", "hips", 0.1, -0.4),
                joint("left foot", "left", 0.0, -0.4),
                joint("right", "hips", -0.1, -0.4),
                joint("right foot", "right", 0.0, -0.4),
            ],
            ..v1::BodySkeleton::default()
        }),
        ..straight(2.0)
    };
    let plan = plan(&goal).unwrap();
    assert_eq!(
        (plan.body.joints(), &*plan.body.sides),
        (5, &[0, 1, 1, -1, -1][..])
    );
    assert!((plan.body.height_m - 0.8).abs() < 1e-6, "{}", plan.body.height_m);
}

/// A person whose arms are at an angle below the horizontal.
fn person(arms_down_deg: f32) -> v1::BodySkeleton {
    let joint = |name: &str, parent: &str, x: f32, y: f32| v1::BodyJoint {
        name: name.into(),
        parent: parent.into(),
        offset: Some(v1::Vec3 { x, y, z: 0.0 }),
    };
    let mut joints = vec![
        joint("hips", "", 0.0, 1.0),
        joint("spine", "hips", 0.0, 0.4),
        joint("head", "spine", 0.0, 0.3),
    ];
    let (sin, cos) = arms_down_deg.to_radians().sin_cos();
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let name = |part: &str| format!("{side} {part}");
        for (part, parent, x, y) in [
            ("hip", "hips".to_owned(), 0.1, 0.0),
            ("knee", name("hip"), 0.0, -0.45),
            ("foot", name("knee"), 0.0, -0.45),
            ("shoulder", "spine".to_owned(), 0.18, 0.2),
            ("elbow", name("shoulder"), 0.28 * cos, -0.28 * sin),
            ("hand", name("elbow"), 0.25 * cos, -0.25 * sin),
        ] {
            joints.push(joint(&name(part), &parent, sign * x, y));
        }
    }
    v1::BodySkeleton {
        joints,
        ..v1::BodySkeleton::default()
    }
}

#[test]
fn arms_of_a_t_pose_are_let_down_with_a_note_and_others_ask_for_the_neutral_pose() {
    let goal = |arms_down_deg: f32| v1::PathGoal {
        skeleton: Some(person(arms_down_deg)),
        ..straight(2.0)
    };
    let notes = plan(&goal(0.0)).unwrap().notes;
    assert!(
        notes.iter().any(|note| note.contains("limbs are let down")),
        "{notes:?}"
    );
    let hanging = plan(&goal(85.0)).unwrap().notes;
    assert!(
        !hanging.iter().any(|note| note.contains("let down")),
        "{hanging:?}"
    );
    let error = plan(&goal(-60.0)).map(|_| ()).unwrap_err();
    assert_eq!(error.field, "path.skeleton.neutral", "{error}");
    assert!(error.message.contains("is left out"), "{error}");
}

#[test]
fn a_recorded_root_is_followed_as_it_is_and_noted() {
    let tasks = |goal: &v1::PathGoal| {
        let mut plan = plan(goal).unwrap();
        let notes = plan.notes.join(" ");
        (walked(&mut plan).1, notes)
    };
    let (drawn, notes) = tasks(&straight(3.0));
    assert!(drawn.iter().all(|task| task.sways) && notes.is_empty(), "{notes}");
    let point = |frame: u8| {
        let t = f32::from(frame) / 30.0;
        v1::PathPoint {
            time: Some(t),
            ..at(0.0, 1.2 * t + 0.025 * (11.3 * t).sin())
        }
    };
    let recorded = v1::PathGoal {
        points: (0..90).map(point).collect(),
        ..v1::PathGoal::default()
    };
    let (recorded, notes) = tasks(&recorded);
    assert!(
        recorded.iter().all(|task| !task.sways) && notes.contains("recorded root"),
        "{notes}"
    );
}

#[test]
fn a_body_of_the_caller_with_two_feet_sways_like_the_packs() {
    let joint = |(name, parent, x, y): &(&str, &str, f32, f32)| v1::BodyJoint {
        name: (*name).into(),
        parent: (*parent).into(),
        offset: Some(v1::Vec3 { x: *x, y: *y, z: 0.0 }),
    };
    let legs = [
        ("hips", "", 0.0, 0.0),
        ("thigh-l", "hips", 0.1, -0.05),
        ("shin-l", "thigh-l", 0.0, -0.4),
        ("foot-l", "shin-l", 0.0, -0.4),
        ("thigh-r", "hips", -0.1, -0.05),
        ("shin-r", "thigh-r", 0.0, -0.4),
        ("foot-r", "shin-r", 0.0, -0.4),
    ];
    let sways = |joints: &[(&str, &str, f32, f32)]| {
        let goal = v1::PathGoal {
            skeleton: Some(v1::BodySkeleton {
                joints: joints.iter().map(joint).collect(),
                ..v1::BodySkeleton::default()
            }),
            ..straight(2.0)
        };
        plan(&goal).unwrap().body.sway.is_some()
    };
    assert!(sways(&legs) && !sways(&legs[..4]));
}

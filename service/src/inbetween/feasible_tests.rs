use std::sync::Arc;

use troupe_character::testing::toy_rig;
use troupe_motion::feasibility::LimitsDoc;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{GLOBAL_ROOT, Motion};
use troupe_motion::robot::{HingeDoc, RobotDoc};
use troupe_motion::rotation::six_d;
use troupe_motion::{Quat, Vec3};

use super::*;
use crate::inbetween::{RequestLimits, finish_judged, prepare};

const LIMITS: &str = r#"
beyond = 0.001
windows = 100
root_speed_mps = 5.0
root_acceleration_mps2 = 20.0
turning_rad_per_s = 6.0
joint_speed_mps = 4.0
joint_acceleration_mps2 = 40.0
below_ground_m = 0.1
off_ground_m = 0.4
upright = [0.0, 1.0, 0.0]
tilt_rad = 0.5
bend_rad = 0.1
reach_frames = [1, 61]
root_reach_m = [0.05, 3.05]
turn_reach_rad = [0.1, 3.1]
pose_reach_m = [0.1, 0.7]
bends = [{ joint = "Foot", usual = [1.0, 0.0, 0.0, 0.0], low = [-0.5, -0.1, -0.1], high = [0.5, 0.1, 0.1] }]
"#;

fn rig() -> Rig {
    let mut rig = toy_rig();
    let doc: LimitsDoc = toml::from_str(LIMITS).unwrap();
    rig.limits = Some(Arc::new(Limits::new(&doc, &rig.skeleton).unwrap()));
    rig
}

fn key(x: f32, z: f32, pelvis: Quat) -> v1::Keyframe {
    let y = 0.9;
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x, y, z }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: vec![pelvis.w, pelvis.x, pelvis.y, pelvis.z, 1.0, 0.0, 0.0, 0.0],
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}

/// Stands, and is asked for targets, strictly.
fn standing(targets: Vec<v1::Keyframe>, frame_count: Option<u32>) -> v1::Character {
    v1::Character {
        context: vec![key(2.0, 1.0, Quat::IDENTITY); 4],
        targets,
        frame_count,
        strict: true,
        ..v1::Character::default()
    }
}

fn plan(character: v1::Character, rig: &Rig) -> Result<Plan, FieldError> {
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
        skeleton: String::new(),
    };
    let limits = RequestLimits { max_characters: 1 };
    prepare(&Path::root(), &request, rig, limits).map(|(_, mut plans)| plans.remove(0))
}

/// What a strict request is refused for before anything is made.
fn refused(character: v1::Character) -> Option<FieldError> {
    let rig = rig();
    let plan = plan(character, &rig).unwrap();
    refuse_keyframes(&[plan], &rig).err().map(|error| error.0)
}

/// The networks' answer of so many frames, whose root is at `z` of each.
fn raw(frames: usize, z: impl Fn(usize) -> f32) -> Motion {
    let pose = [six_d(Quat::IDENTITY), six_d(Quat::IDENTITY)].concat();
    Motion {
        root: (0..frames)
            .flat_map(|frame| [0.0, 0.9, z(frame), 1.0, 0.0])
            .collect(),
        rotations: pose.repeat(frames),
        contacts: vec![0.0; frames],
        trace: None,
    }
}

#[test]
fn a_target_in_reach_passes() {
    // 30 frames from the last context frame: 1.5 m.
    assert_eq!(
        refused(standing(vec![key(2.0, 2.4, Quat::IDENTITY)], Some(34))),
        None
    );
    let far = v1::Character {
        strict: false,
        ..standing(vec![key(2.0, 9.0, Quat::IDENTITY)], Some(34))
    };
    assert_eq!(refused(far), None, "not strict");
}

fn aside(frame: u32, x: f32, z: f32) -> v1::RootKey {
    v1::RootKey {
        frame,
        x: Some(x),
        z: Some(z),
        ..v1::RootKey::default()
    }
}

#[test]
fn a_given_root_that_is_too_fast_is_refused_before_anything_is_made() {
    let by = |root: Vec<v1::RootKey>| v1::Character {
        root,
        ..standing(vec![key(2.0, 2.4, Quat::IDENTITY)], Some(34))
    };
    assert_eq!(refused(by(vec![aside(10, 2.3, 1.2), aside(20, 2.3, 1.8)])), None);
    // 3 m in 10 frames are 9 m/s, and so is the way back to the target for whatever entry is the
    // last.
    for (root, field) in [
        (
            vec![aside(10, 2.0, 1.2), aside(20, 5.0, 1.2)],
            "characters[0].root[1]",
        ),
        (
            vec![aside(10, 2.0, 1.2), aside(32, 2.0, 3.0)],
            "characters[0].root[1]",
        ),
        (
            vec![aside(4, 2.3, 1.0), aside(20, 2.0, 2.0)],
            "characters[0].root[0]",
        ),
    ] {
        let error = refused(by(root)).unwrap();
        assert_eq!(
            (error.field.as_str(), error.allowed.as_str()),
            (field, "at most 5.00 m/s")
        );
        assert!(error.message.contains("moves the root at"), "{error}");
    }
}

#[test]
fn a_motion_along_a_given_root_names_its_next_entry() {
    let rig = rig();
    let character = v1::Character {
        root: vec![aside(10, 2.0, 1.3), aside(20, 2.0, 1.9)],
        ..standing(vec![key(2.0, 2.4, Quat::IDENTITY)], Some(34))
    };
    let plan = plan(character, &rig).unwrap();
    let mut judge = Judge::new(&rig).unwrap();
    // The networks jump between the entries.
    let raw = raw(36, |frame| if frame < 16 { 0.0 } else { 1.0 });
    let (_, found) = finish_judged(&raw, &plan, &rig, Some(&mut judge)).unwrap();
    let error = refuse(0, &plan, &rig, &found.unwrap(), 34).unwrap_err().0;
    assert_eq!(error.field, "characters[0].root[1]");
    assert!(error.message.contains("in frame"), "{error}");
}

#[test]
fn a_target_too_far_away_is_refused_with_the_distance_and_the_frames_that_would_do() {
    let error = refused(standing(vec![key(2.0, 2.98, Quat::IDENTITY)], Some(34))).unwrap();
    assert_eq!(error.field, "characters[0].targets[0].root.position");
    assert!(
        error.message.contains("1.98 m") && error.message.contains("30 frames"),
        "{error}"
    );
    assert_eq!(
        error.allowed,
        "at most 1.50 m from the last context frame in this direction in 30 frames; or frame_count 44 or more"
    );
    let error = refused(standing(vec![key(2.0, 11.0, Quat::IDENTITY)], Some(34))).unwrap();
    assert!(
        error
            .allowed
            .ends_with("no segment of at most 64 frames reaches it"),
        "{error}"
    );
}

#[test]
fn the_longest_length_counts_if_the_model_chooses() {
    let near = |z: f32| standing(vec![key(2.0, 1.0 + z, Quat::IDENTITY)], None);
    assert_eq!(refused(near(2.9)), None);
    assert!(refused(near(3.2)).is_some());
    let mut short = near(2.88);
    short.allowed_token_counts = vec![3, 4];
    let error = refused(short).unwrap();
    assert!(error.allowed.contains("or frame_count 62 or more"), "{error}");
}

#[test]
fn turns_heads_and_contradictions_are_refused_by_their_field() {
    let about = Quat::from_rotation_y(2.97);
    let error = refused(standing(vec![key(2.0, 1.0, about)], Some(14))).unwrap();
    assert_eq!(error.field, "characters[0].targets[0].pose");
    assert!(
        error.message.contains("turns the pelvis by 170° in 10 frames"),
        "{error}"
    );
    assert!(error.allowed.contains("or frame_count 63 or more"), "{error}");

    let head = Quat::from_rotation_z(3.0);
    let error = refused(standing(vec![key(2.0, 1.0, head)], Some(64))).unwrap();
    assert_eq!(error.field, "characters[0].targets[0].pose");
    assert_eq!(
        (error.message.as_str(), error.allowed.as_str()),
        ("tilts the pelvis by 172°", "at most 29°")
    );

    let apart = vec![key(2.0, 1.0, Quat::IDENTITY), key(2.0, 1.5, Quat::IDENTITY)];
    let error = refused(standing(apart, Some(64))).unwrap();
    assert_eq!(error.field, "characters[0].targets[1].root");
    assert_eq!(error.allowed, "at most 5.00 m/s");
}

#[test]
fn frames_that_are_not_feasible_are_refused_with_the_frames_that_would_do() {
    let rig = rig();
    let plan = plan(standing(vec![key(2.0, 2.4, Quat::IDENTITY)], Some(34)), &rig).unwrap();
    // Half a metre in one frame in the middle.
    let motion = raw(36, |frame| if frame < 18 { 0.0 } else { 0.5 });
    let mut judge = Judge::new(&rig);
    let (result, found) = finish_judged(&motion, &plan, &rig, judge.as_mut()).unwrap();
    let message = result.feasibility.unwrap();
    let found = found.unwrap();
    assert!(!message.feasible && !found.is_feasible());
    assert_eq!(message.worst, "root_acceleration");
    assert_eq!(
        (message.hinge_speed, message.hinge_acceleration),
        (None, None),
        "no robot"
    );
    let acceleration = message.root_acceleration.unwrap();
    assert!((acceleration.value / acceleration.limit - message.ratio).abs() < 1e-3);
    let error = refuse(0, &plan, &rig, &found, 34).unwrap_err().0;
    assert_eq!(error.field, "characters[0].targets");
    assert!(error.message.contains("accelerates the root by 4"), "{error}");
    assert!(
        error
            .allowed
            .contains("no segment of at most 64 frames leaves time for"),
        "{error}"
    );

    let smooth = |frame: usize| smoothstep(((frame as f32 - 3.0) / 30.0).clamp(0.0, 1.0));
    let still = raw(36, |frame| 1.4 * smooth(frame));
    let (result, found) = finish_judged(&still, &plan, &rig, judge.as_mut()).unwrap();
    assert!(result.feasibility.unwrap().feasible, "{found:?}");
    assert_eq!(refuse(0, &plan, &rig, &found.unwrap(), 34), Ok(()));
    assert_eq!(still.root.len(), 36 * GLOBAL_ROOT);
}

/// The rig as a robot, whose foot turns about its left axis.
fn robot_rig() -> Rig {
    let foot = HingeDoc {
        joint: "Foot".to_owned(),
        axis: Vec3::X,
        rest: [1.0, 0.0, 0.0, 0.0],
        lower_rad: -1.0,
        upper_rad: 1.0,
        max_speed_rad_per_s: 6.0,
        max_acceleration_rad_per_s2: None,
    };
    let robot = RobotDoc {
        name: "hopper".to_owned(),
        hinges: vec![foot],
        mimics: Vec::new(),
    };
    let rig = rig();
    let skeleton = (*rig.skeleton).clone().with_robot(&robot).unwrap();
    Rig {
        skeleton: Arc::new(skeleton),
        ..rig
    }
}

/// Stands for 36 frames, and turns the foot.
fn turning(angle: impl Fn(usize) -> f32) -> Motion {
    let pose = |frame: usize| [six_d(Quat::IDENTITY), six_d(Quat::from_rotation_x(angle(frame)))];
    Motion {
        rotations: (0..36).flat_map(pose).flatten().collect(),
        ..raw(36, |_| 0.0)
    }
}

#[test]
fn hinges_that_are_too_fast_are_reported_and_refused() {
    let rig = robot_rig();
    let plan = plan(standing(vec![key(2.0, 1.0, Quat::IDENTITY)], Some(34)), &rig).unwrap();
    let mut judge = Judge::new(&rig).unwrap();
    // Up in one frame and down in one frame: 27 rad/s of 6.
    let jerk = turning(|frame| if (10..20).contains(&frame) { 0.9 } else { 0.0 });
    let (result, found) = finish_judged(&jerk, &plan, &rig, Some(&mut judge)).unwrap();
    let message = result.feasibility.unwrap();
    assert_eq!((message.feasible, message.worst.as_str()), (false, "hinge_speed"));
    let speed = message.hinge_speed.unwrap();
    assert!((speed.value - 27.0).abs() < 0.01, "{speed:?}");
    assert_eq!((speed.limit, speed.joint), (6.0, Some(1)));
    assert!([10, 20].contains(&speed.frame), "{speed:?}");
    assert_eq!(message.hinge_acceleration, None, "the robot has no such limit");

    let frames = result.frames.unwrap();
    let ratios = &frames.hinge_speed_ratios;
    assert_eq!((ratios.len(), frames.fastest_hinges.len()), (34, 34));
    for (frame, ratio) in ratios.iter().enumerate() {
        let wanted = if [10, 20].contains(&frame) { 4.5 } else { 0.0 };
        assert!((ratio - wanted).abs() < 1e-3, "{frame}: {ratio}");
    }
    // From rest to 27 rad/s in a frame.
    assert!((frames.hinge_accelerations[10] - 810.0).abs() < 0.5);

    let error = refuse(0, &plan, &rig, &found.unwrap(), 34).unwrap_err().0;
    assert_eq!(error.field, "characters[0].targets");
    assert!(error.message.contains("turns a hinge at 27.00 rad/s"), "{error}");
    assert!(error.message.ends_with("(Foot)"), "{error}");
    assert!(
        error.allowed.starts_with("at most 6.00 rad/s, which no"),
        "{error}"
    );
}

#[test]
fn hinges_within_their_speeds_are_feasible() {
    let rig = robot_rig();
    let plan = plan(standing(vec![key(2.0, 1.0, Quat::IDENTITY)], Some(34)), &rig).unwrap();
    let mut judge = Judge::new(&rig).unwrap();
    // 4.5 rad/s up, and down again.
    let calm = turning(|frame| 0.15 * (frame as f32 - 5.0).min(25.0 - frame as f32).clamp(0.0, 4.0));
    let (result, found) = finish_judged(&calm, &plan, &rig, Some(&mut judge)).unwrap();
    let message = result.feasibility.unwrap();
    assert!(message.feasible, "{message:?}");
    assert!((message.hinge_speed.unwrap().value - 4.5).abs() < 0.01);
    assert_eq!(refuse(0, &plan, &rig, &found.unwrap(), 34), Ok(()));
    let ratios = result.frames.unwrap().hinge_speed_ratios;
    assert!(ratios.iter().all(|&ratio| ratio < 0.76), "{ratios:?}");
}

#[test]
fn without_limits_there_are_no_figures_and_no_strict_requests() {
    let bare = toy_rig();
    let asked = standing(vec![key(2.0, 2.0, Quat::IDENTITY)], Some(34));
    let error = plan(asked.clone(), &bare).unwrap_err();
    assert_eq!(error.field, "characters[0].strict");
    let asked = v1::Character {
        strict: false,
        ..asked
    };
    let plan = plan(asked, &bare).unwrap();
    let mut judge = Judge::new(&bare);
    let (result, found) = finish_judged(&raw(36, |_| 0.0), &plan, &bare, judge.as_mut()).unwrap();
    assert_eq!((result.feasibility, found), (None, None));
}

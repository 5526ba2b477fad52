use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::testing::{Tables, clip_of_rows, g1, tables};
use super::*;
use crate::clip::Clip;
use crate::fk::world_transforms;
use crate::rotation::angle_between;
use crate::rotation::tests::any_quat;
use crate::skeleton::{Joint, Skeleton};

/// A frame of a dancing G1 (Unitree's retargeted LaFAN1).
const ROW: &str = "-0.454012,1.290769,0.706152,-0.050104,-0.006376,0.791350,-0.609274,-0.762612,-0.170397,0.194791,0.920348,-0.193344,0.205975,-0.318028,-0.071232,-0.256859,2.105103,-0.176397,0.079349,0.056391,-0.104017,0.265327,0.457306,0.453763,0.112765,-0.484084,0.565661,-0.123619,0.028122,0.593701,-0.581201,0.626666,0.498754,-0.922128,0.094379,0.246345";

fn robot(skeleton: &Skeleton) -> &Robot {
    skeleton.robot.as_ref().unwrap()
}

/// Angles of the G1 at shares (0 to 1) of their ranges.
fn angles(skeleton: &Skeleton, shares: &[f32]) -> Vec<f32> {
    let hinges = robot(skeleton).hinges().iter();
    hinges
        .zip(shares)
        .map(|(hinge, share)| hinge.limited(hinge.lower_rad + share * (hinge.upper_rad - hinge.lower_rad)))
        .collect()
}

fn shares() -> impl Strategy<Value = Vec<f32>> {
    proptest::collection::vec(0.0_f32..=1.0, 29)
}

/// Positions and rotations of a pose in the world.
fn world(skeleton: &Skeleton, root: Vec3, pose: &[Quat]) -> (Vec<Vec3>, Vec<Quat>) {
    let mut places = vec![Vec3::ZERO; skeleton.joint_count()];
    let mut turns = vec![Quat::IDENTITY; skeleton.joint_count()];
    world_transforms(skeleton, root, pose, &mut places, &mut turns);
    (places, turns)
}

#[test]
fn a_frame_of_the_data_agrees_with_the_urdf() {
    // Positions of joints and the X axes of their links, by forward kinematics of the URDF in
    // another program.
    let expected = [
        (
            "left_knee",
            [1.081969, 0.349408, -0.436502],
            [-0.920335, -0.253417, -0.297933],
        ),
        (
            "left_ankle_roll",
            [1.174394, 0.048699, -0.477554],
            [-0.961032, -0.067073, -0.268181],
        ),
        (
            "right_ankle_roll",
            [1.514406, 0.365248, -0.42192],
            [0.074692, -0.987056, 0.141922],
        ),
        (
            "waist_pitch",
            [1.29151, 0.750261, -0.456375],
            [-0.918388, -0.342113, -0.198806],
        ),
        (
            "left_wrist_yaw",
            [1.106612, 0.791844, -0.259084],
            [-0.934203, -0.214826, -0.284809],
        ),
        (
            "right_wrist_yaw",
            [1.40643, 0.717278, -0.667857],
            [0.339863, -0.940441, 0.008064],
        ),
    ];
    let skeleton = g1();
    let clip = clip_of_rows(ROW, &skeleton);
    let (places, turns) = world(&skeleton, clip.root_positions[0], clip.rotations_at(0));
    for (name, place, ahead) in expected {
        let joint = skeleton.joint_index(name).unwrap();
        assert!(
            places[joint].abs_diff_eq(place.into(), 2e-6),
            "{name}: {}",
            places[joint]
        );
        assert!((turns[joint] * Vec3::Z).abs_diff_eq(ahead.into(), 3e-6), "{name}");
    }
}

#[test]
fn a_csv_comes_back_digit_by_digit() {
    let skeleton = g1();
    let text = format!("{ROW}\n{}\n", ROW.replace("0.920348", "0.820348"));
    let clip = clip_of_rows(&text, &skeleton);
    assert_eq!((clip.frames(), clip.fps), (2, 30.0));
    let written = write_csv(&clip).unwrap();
    let numbers =
        |text: &str| -> Vec<f32> { text.split([',', '\n']).filter_map(|n| n.parse().ok()).collect() };
    let (read, back) = (numbers(&text), numbers(&written));
    assert_eq!(read.len(), back.len());
    // The sign of a rotation is free, but does not jump between rows.
    let sign = if read[6] < 0.0 { -1.0 } else { 1.0 };
    for (at, (a, b)) in read.iter().zip(&back).enumerate() {
        let turns = (3..7).contains(&(at % 36));
        let a = if turns { a * sign } else { *a };
        assert!((a - b).abs() < 1.5e-6, "column {}: {a} came back as {b}", at % 36);
    }
    assert_eq!(clip_of_rows(&written, &skeleton).frames(), 2);
}

#[test]
fn only_a_robots_motion_is_written_as_csv() {
    assert_eq!(write_csv(&crate::testing::walk(2)), Err(CsvError::NoRobot));
}

#[test]
fn angles_outside_are_held_at_the_limit_when_written() {
    let skeleton = g1();
    // A left knee that is bent the wrong way by 0.5 rad.
    let clip = clip_of_rows(&ROW.replace("0.920348", "-0.5"), &skeleton);
    let knee = robot(&skeleton).hinges()[3];
    let angle = knee.angle_of(clip.rotations_at(0)[knee.joint]);
    assert!((angle + 0.5).abs() < 1e-6);
    let written = write_csv(&clip).unwrap();
    assert_eq!(written.split(',').nth(10), Some("-0.087267"));
}

/// A pelvis, a hinge with a rest and limits beyond half a turn, and a fixed end.
fn crane(lower: f32, upper: f32) -> Skeleton {
    let joint = |name: &str, parent| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::Y,
    };
    let joints = vec![joint("base", None), joint("arm", Some(0)), joint("hook", Some(1))];
    let rest = Quat::from_rotation_z(FRAC_PI_2);
    let doc = RobotDoc {
        name: "crane".to_owned(),
        hinges: vec![HingeDoc {
            joint: "arm".to_owned(),
            axis: Vec3::X,
            rest: [rest.w, rest.x, rest.y, rest.z],
            lower_rad: lower,
            upper_rad: upper,
            max_speed_rad_per_s: 1.0,
            max_acceleration_rad_per_s2: None,
        }],
        mimics: Vec::new(),
    };
    Skeleton::new(joints, Vec3::X, 0.0, None)
        .unwrap()
        .with_robot(&doc)
        .unwrap()
}

#[test]
fn a_pose_comes_to_the_nearest_angle_within_the_limits() {
    let fit = |skeleton: &Skeleton, angle: f32| {
        let robot = robot(skeleton);
        let mut fitted = Fitted::default();
        let mut pose = [Quat::IDENTITY, robot.hinges()[0].rotation(angle), Quat::IDENTITY];
        robot.fit(&mut pose, &mut fitted);
        (fitted.angles[0], fitted.clamped, fitted.residual_rad)
    };
    let near = |(angle, clamped, residual): (f32, usize, f32), want: (f32, usize, f32)| {
        assert_eq!(clamped, want.1);
        assert!(
            (angle - want.0).abs() < 1e-5 && (residual - want.2).abs() < 1e-4,
            "{angle} {residual}"
        );
    };
    // H1's shoulder yaw: limits on both sides of half a turn.
    let shoulder = crane(-1.3, 4.45);
    near(fit(&shoulder, 4.4), (4.4, 0, 0.0));
    near(fit(&shoulder, 4.4 - TAU), (4.4, 0, 0.0));
    near(fit(&shoulder, -1.2 + TAU), (-1.2, 0, 0.0));
    // The gap from 4.45 to 4.98 (-1.3): the nearer limit.
    near(fit(&shoulder, 4.55), (4.45, 1, 0.1));
    near(fit(&shoulder, 4.9), (-1.3, 1, 4.9831853 - 4.9));
    // Rounding is not a violation.
    near(fit(&shoulder, 4.45 + 5e-5), (4.45, 0, 5e-5));
    assert!(crane(-4.0, 4.0).robot.unwrap().hinges()[0].is_endless());
}

#[test]
fn the_residual_reports_what_no_hinge_can_do() {
    let skeleton = crane(-1.0, 1.0);
    let robot = robot(&skeleton);
    let mut fitted = Fitted::default();
    // 0.3 rad about the hinge, then 0.2 rad across it. The hook turns with the arm, whatever its
    // own target.
    let across = robot.hinges()[0].rotation(0.3) * Quat::from_rotation_y(0.2);
    let mut pose = [Quat::from_rotation_y(2.0), across, Quat::IDENTITY];
    robot.fit(&mut pose, &mut fitted);
    assert!(
        (fitted.residual_rad - 0.2).abs() < 1e-5 && fitted.clamped == 0,
        "{fitted:?}"
    );
    assert!((fitted.angles[0] - 0.3).abs() < 1e-5);
    assert_eq!((pose[0], pose[2]), (Quat::from_rotation_y(2.0), Quat::IDENTITY));
    assert!(angle_between(pose[1], robot.hinges()[0].rotation(0.3)) < 1e-5);
}

#[test]
fn a_hinge_corrects_the_errors_of_those_above_it() {
    let skeleton = g1();
    let robot = robot(&skeleton);
    let joint = |name: &str| skeleton.joint_index(name).unwrap();
    // The first hinge of the waist, which only turns left and right, gets the whole bow.
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    robot.pose(Quat::IDENTITY, &[0.0; 29], &mut pose);
    pose[joint("waist_yaw")] = Quat::from_rotation_x(0.4);
    let (_, wanted) = world(&skeleton, Vec3::ZERO, &pose);
    let mut fitted = Fitted::default();
    robot.fit(&mut pose, &mut fitted);
    let (_, got) = world(&skeleton, Vec3::ZERO, &pose);
    let (torso, pitch) = (
        joint("waist_pitch"),
        robot.hinge_of(joint("waist_pitch")).unwrap(),
    );
    assert!((fitted.angles[pitch] - 0.4).abs() < 1e-5, "{:?}", fitted.angles);
    assert!(angle_between(wanted[torso], got[torso]) < 1e-5);
    // The joints between are off by all of it.
    assert!((fitted.residual_rad - 0.4).abs() < 1e-4);
}

#[test]
fn every_mistake_of_a_robot_names_field_and_range() {
    type Change = fn(&mut RobotDoc);
    let cases: [(Change, &str); 14] = [
        (|r| r.name.clear(), "robot.name is empty"),
        (
            |r| r.hinges.clear(),
            "robot.hinges is empty; allowed: at least one",
        ),
        (
            |r| r.hinges[2].joint = "tail".to_owned(),
            "robot.hinges[2].joint is \"tail\"; allowed: a joint of the skeleton",
        ),
        (
            |r| r.hinges[2].joint = "pelvis".to_owned(),
            "robot.hinges[2].joint is \"pelvis\", the root",
        ),
        (
            |r| r.hinges[2].joint = "left_hip_pitch".to_owned(),
            "robot.hinges[2].joint is \"left_hip_pitch\", as that of a hinge before it",
        ),
        (
            |r| r.hinges.swap(2, 3),
            "robot.hinges[2].joint is \"left_knee\", which comes before \"left_hip_yaw\"",
        ),
        (
            |r| r.hinges[4].axis = Vec3::ONE,
            "robot.hinges[4].axis has length 1.7",
        ),
        (
            |r| r.hinges[4].axis = Vec3::NAN,
            "robot.hinges[4].axis has length NaN; allowed: 0.999 to 1.001",
        ),
        (
            |r| r.hinges[4].rest = [0.0; 4],
            "robot.hinges[4].rest has length 0;",
        ),
        (
            |r| r.hinges[5].lower_rad = f32::NAN,
            "robot.hinges[5].lower_rad is NaN; allowed: -100 to 100",
        ),
        (
            |r| r.hinges[5].upper_rad = -0.2618,
            "robot.hinges[5].upper_rad is -0.2618; allowed: above -0.2618, to 100",
        ),
        (
            |r| r.hinges[5].upper_rad = f32::INFINITY,
            "robot.hinges[5].upper_rad is inf",
        ),
        (
            |r| r.hinges[6].max_speed_rad_per_s = 0.0,
            "robot.hinges[6].max_speed_rad_per_s is 0; allowed: above 0",
        ),
        (
            |r| r.hinges[6].max_acceleration_rad_per_s2 = Some(-1.0),
            "robot.hinges[6].max_acceleration_rad_per_s2 is -1; allowed: above 0",
        ),
    ];
    for (change, want) in cases {
        let Tables { skeleton, mut robot } = tables();
        change(&mut robot);
        let error = skeleton.with_robot(&robot).unwrap_err().to_string();
        assert!(error.contains(want), "{error}");
    }
    let Tables { skeleton, mut robot } = tables();
    robot.hinges[6].max_acceleration_rad_per_s2 = Some(400.0);
    let made = skeleton.clone().with_robot(&robot).unwrap().robot.unwrap();
    let back = RobotDoc::from((&made, &skeleton));
    assert_eq!(back.hinges.len(), 29);
    assert_eq!(
        skeleton.with_robot(&back).unwrap().robot.unwrap(),
        made,
        "unchanged by writing and reading"
    );
}

proptest! {
    #[test]
    fn angles_make_rotations_and_come_back(shares in shares(), root in any_quat()) {
        let skeleton = g1();
        let robot = robot(&skeleton);
        let given = angles(&skeleton, &shares);
        let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
        robot.pose(root, &given, &mut pose);
        let before = pose.clone();
        let mut fitted = Fitted::default();
        robot.fit(&mut pose, &mut fitted);
        prop_assert_eq!(fitted.clamped, 0);
        prop_assert!(fitted.residual_rad < 1e-5, "{}", fitted.residual_rad);
        for (a, b) in given.iter().zip(&fitted.angles) {
            prop_assert!((a - b).abs() < 3e-6, "{} came back as {}", a, b);
        }
        for (a, b) in before.iter().zip(&pose) {
            prop_assert!(a.abs_diff_eq(*b, 3e-6));
        }
    }

    #[test]
    fn any_pose_comes_within_the_limits_and_stays_there(
        root in any_quat(),
        turns in proptest::collection::vec(any_quat(), 33),
    ) {
        let skeleton = g1();
        let robot = robot(&skeleton);
        let mut pose: Vec<Quat> = std::iter::once(root).chain(turns).collect();
        let mut fitted = Fitted::default();
        robot.fit(&mut pose, &mut fitted);
        for (hinge, angle) in robot.hinges().iter().zip(&fitted.angles) {
            prop_assert!((hinge.lower_rad..=hinge.upper_rad).contains(angle));
        }
        prop_assert!(fitted.residual_rad <= PI + 1e-5);
        prop_assert_eq!(pose[0], root);
        // The angles give the pose, and fitting again changes nothing.
        let mut said = pose.clone();
        robot.pose(root, &fitted.angles, &mut said);
        prop_assert_eq!(&said, &pose);
        let mut again = Fitted::default();
        robot.fit(&mut pose, &mut again);
        prop_assert_eq!(again.clamped, 0);
        prop_assert!(again.residual_rad < 1e-5);
    }

    #[test]
    fn qpos_comes_back(shares in shares(), root in any_quat(), place in [-99.0_f32..99.0, -2.0_f32..2.0, -99.0_f32..99.0]) {
        let skeleton = g1();
        let robot = robot(&skeleton);
        let given = angles(&skeleton, &shares);
        let place = Vec3::from(place);
        let mut qpos = [0.0; 36];
        robot.write_qpos(place, root, &given, &mut qpos);
        prop_assert_eq!([qpos[0], qpos[1], qpos[2]], [place.z, place.x, place.y], "forward, left, up");
        let (read_place, read_root, read_angles) = robot.read_qpos(&qpos);
        prop_assert_eq!(read_place, place);
        prop_assert!(read_root.abs_diff_eq(root, 1e-6));
        prop_assert_eq!(read_angles, &given[..]);
    }

    #[test]
    fn a_fit_never_reports_less_than_its_error(turns in proptest::collection::vec([-0.2_f32..0.2, -0.2_f32..0.2, -0.2_f32..0.2], 34)) {
        let skeleton = g1();
        let robot = robot(&skeleton);
        let mut pose = vec![Quat::IDENTITY; 34];
        robot.pose(Quat::IDENTITY, &angles(&skeleton, &[0.5; 29]), &mut pose);
        for (rotation, turn) in pose.iter_mut().zip(turns) {
            *rotation = (*rotation * Quat::from_scaled_axis(turn.into())).normalize();
        }
        let (_, wanted) = world(&skeleton, Vec3::ZERO, &pose);
        let mut fitted = Fitted::default();
        robot.fit(&mut pose, &mut fitted);
        let (_, got) = world(&skeleton, Vec3::ZERO, &pose);
        let most = wanted.iter().zip(&got).map(|(a, b)| angle_between(*a, *b)).fold(0.0, f32::max);
        prop_assert!((most - fitted.residual_rad).abs() < 1e-4, "{} {}", most, fitted.residual_rad);
    }
}

#[test]
fn a_quarter_turn_of_the_robot_by_hand() {
    // Facing left: a quarter turn about MuJoCo's Z.
    let skeleton = g1();
    let mut qpos = [0.0; 36];
    robot(&skeleton).write_qpos(
        Vec3::new(1.0, 0.8, 2.0),
        crate::rotation::yaw(FRAC_PI_2),
        &[0.0; 29],
        &mut qpos,
    );
    let half = (FRAC_PI_2 / 2.0).sin();
    for (a, b) in qpos.iter().zip([2.0, 1.0, 0.8, half, 0.0, 0.0, half]) {
        assert!((a - b).abs() < 1e-6, "{qpos:?}");
    }
}

#[test]
fn clips_of_a_robot_share_its_skeleton() {
    let skeleton = g1();
    let clip: Clip = clip_of_rows(ROW, &skeleton);
    assert!(Arc::ptr_eq(&clip.skeleton, &skeleton));
}

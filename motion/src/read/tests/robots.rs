//! Robots' numbers in every form, and what makes them another robot's.

use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::Arc;

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::names_its_options;
use crate::clip::Clip;
use crate::files::{write_beyond_mimic, write_qpos};
use crate::read::{
    AngleUnit, Basis, Format, JointOrder, LeadingPose, Options, QuaternionOrder, ReadErrorKind, RestPose,
    Source, Topic, Understood, Up, read,
};
use crate::robot::testing::g1;
use crate::robot::{Reference, reference, sonic_files, write_csv};
use crate::rotation::angle_between;
use crate::skeleton::Skeleton;

/// A G1 that walks on a circle; hinges swing within a share of their limits.
pub(super) fn walk(frames: usize, fps: f32, share: f32) -> Clip {
    let skeleton = g1();
    let robot = skeleton.robot.as_ref().unwrap();
    let mut rotations = Vec::new();
    let mut roots = Vec::new();
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    for frame in 0..frames {
        let t = frame as f32 / fps;
        let heading = 1.2 * t;
        let angles: Vec<f32> = robot
            .hinges()
            .iter()
            .enumerate()
            .map(|(nth, hinge)| {
                let middle = 0.5 * (hinge.lower_rad + hinge.upper_rad);
                let half = 0.5 * (hinge.upper_rad - hinge.lower_rad);
                middle + share * half * (2.0 * t + nth as f32).sin()
            })
            .collect();
        robot.pose(
            crate::rotation::yaw(heading) * Quat::from_rotation_x(0.1),
            &angles,
            &mut pose,
        );
        rotations.extend(&pose);
        roots.push(Vec3::new(-heading.cos(), 0.76, heading.sin()));
    }
    Clip::new(skeleton, fps, roots, rotations).unwrap()
}

pub(super) fn on_g1() -> Options {
    Options {
        skeleton: Some(g1()),
        ..Options::default()
    }
}

pub(super) fn with(
    name: &str,
    bytes: &[u8],
    options: &Options,
) -> Result<Understood, crate::read::ReadError> {
    read(&Source::new(name, bytes), options).inspect_err(names_its_options)
}

/// Rows of numbers, each changed.
pub(super) fn rows(text: &str, change: impl Fn(&mut Vec<f64>)) -> String {
    let row = |line: &str| {
        let mut row: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        change(&mut row);
        let row: Vec<String> = row.iter().map(|n| format!("{n:.6}")).collect();
        row.join(",") + "\n"
    };
    text.lines().map(row).collect()
}

pub(super) fn same(a: &Clip, b: &Clip) -> bool {
    let places = a.root_positions.iter().zip(&b.root_positions);
    let turns = a.rotations.iter().zip(&b.rotations);
    a.frames() == b.frames()
        && places.into_iter().all(|(a, b)| a.distance(*b) < 5e-4)
        && turns
            .into_iter()
            .all(|(a, b)| angle_between(*a, *b).to_degrees() < 0.1)
}

pub(super) fn topics(found: &Understood) -> Vec<Topic> {
    found.report.repairs.iter().map(|note| note.topic).collect()
}

#[test]
fn unitrees_rows_need_no_repair() {
    let truth = walk(150, 30.0, 0.8);
    let found = with("walk.csv", write_csv(&truth).unwrap().as_bytes(), &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!((topics(&found), &found.report.oddities[..]), (vec![], &[][..]));
    assert_eq!(
        (found.report.format.value, found.report.fps.basis),
        (Format::RobotCsv, Basis::Assumed)
    );
    assert!(found.report.skeleton.value.contains("g1"));
    let options = Options {
        fps: Some(60.0),
        ..on_g1()
    };
    let found = with("walk.csv", write_csv(&truth).unwrap().as_bytes(), &options).unwrap();
    assert_eq!((found.clip.fps, found.report.fps.basis), (60.0, Basis::Given));
}

#[test]
fn errors_in_rows_name_the_place() {
    let row = write_csv(&walk(1, 30.0, 0.5)).unwrap();
    let row = row.trim_end();
    let cell = |nth: usize, with: &str| -> String {
        let mut cells: Vec<&str> = row.split(',').collect();
        cells[nth] = with;
        cells.join(",")
    };
    let cases = [
        (
            format!("{row}\n\n{row},0.1\n"),
            "line 3: 37 columns; the first row has 36",
        ),
        (
            format!("{row},0.1\n"),
            "37 columns; robot g1_29dof_rev_1_0 has 36",
        ),
        (
            cell(10, "high"),
            "line 1, column 11: \"high\" is no finite number",
        ),
        (cell(10, "inf"), "line 1, column 11: \"inf\" is no finite number"),
        (
            cell(5, "0.9"),
            "frame 0: the length of the root's quaternion is 1.3",
        ),
        ("time,x,y".to_owned(), "at least one frame"),
        (String::new(), "at least one frame"),
    ];
    for (text, wanted) in cases {
        let error = with("walk.csv", text.as_bytes(), &on_g1())
            .unwrap_err()
            .to_string();
        assert!(error.contains(wanted), "{wanted}: {error}");
    }
    let human = Options {
        skeleton: Some(crate::testing::biped()),
        ..Options::default()
    };
    let error = with("walk.csv", row.as_bytes(), &human).unwrap_err().to_string();
    assert!(error.contains("--pack or --urdf gives the robot"), "{error}");
}

#[test]
fn another_order_of_the_quaternion_is_found_by_who_stands_upright() {
    let truth = walk(150, 30.0, 0.8);
    let text = rows(&write_csv(&truth).unwrap(), |row| row[3..7].rotate_right(1));
    let found = with("walk.csv", text.as_bytes(), &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!(topics(&found), [Topic::Quaternion]);
    assert!(
        found.report.repairs[0].text.contains("w x y z"),
        "{:?}",
        found.report.repairs
    );
    // MuJoCo's qpos with x y z w.
    let qpos = write_qpos(&truth).unwrap();
    assert!(same(&truth, &with("walk.npy", &qpos, &on_g1()).unwrap().clip));
    let (_, numbers) = crate::files::npz::read_array(&qpos).unwrap();
    let mut numbers = numbers;
    numbers
        .chunks_exact_mut(36)
        .for_each(|row| row[3..7].rotate_left(1));
    let mut bytes = Vec::new();
    crate::files::npz::write_array(&mut bytes, &[150, 36], &numbers).unwrap();
    let found = with("walk.npy", &bytes, &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!(topics(&found), [Topic::Quaternion]);
}

#[test]
fn a_quaternion_that_stands_upright_in_both_orders_is_told_by_where_it_walks() {
    // Facing backwards the whole way, so that both orders are upright.
    let mut truth = walk(60, 30.0, 0.2);
    for frame in 0..60 {
        truth.root_positions[frame] = Vec3::new(0.0, 0.76, -0.05 * frame as f32);
        truth.rotations_at_mut(frame)[0] = crate::rotation::yaw(std::f32::consts::PI);
    }
    let wxyz = rows(&write_csv(&truth).unwrap(), |row| row[3..7].rotate_right(1));
    let error = with("walk.csv", wxyz.as_bytes(), &on_g1()).unwrap_err();
    assert!(
        matches!(
            error.kind,
            ReadErrorKind::Open {
                topic: Topic::Quaternion,
                ..
            }
        ),
        "{error}"
    );
    assert!(
        error
            .to_string()
            .contains("--quaternion xyzw or --quaternion wxyz decides")
    );
    assert_eq!(error.options()[0].values, ["xyzw", "wxyz"]);
    let options = Options {
        quaternion: Some(QuaternionOrder::Wxyz),
        ..on_g1()
    };
    assert!(same(
        &truth,
        &with("walk.csv", wxyz.as_bytes(), &options).unwrap().clip
    ));
    assert!(same(
        &truth,
        &with("walk.csv", write_csv(&truth).unwrap().as_bytes(), &on_g1())
            .unwrap()
            .clip
    ));
}

#[test]
fn a_robot_that_stands_upright_in_both_orders_is_noted() {
    let clip = walk(60, 30.0, 0.8);
    let text = write_csv(&clip).unwrap();
    // It faces ahead: with w first, it would face backwards.
    let stands = rows(&text, |row| {
        row[..3].copy_from_slice(&[0.0, 0.0, 0.76]);
        row[3..7].copy_from_slice(&[0.0, 0.05, 0.0, 0.998_749]);
    });
    let found = with("walk.csv", stands.as_bytes(), &on_g1()).unwrap();
    let odd = &found.report.oddities[0];
    assert!(
        odd.topic == Topic::Quaternion && odd.text.ends_with("--quaternion decides"),
        "{odd:?}"
    );
    let options = Options {
        quaternion: Some(QuaternionOrder::Xyzw),
        ..on_g1()
    };
    let given = with("walk.csv", stands.as_bytes(), &options).unwrap();
    assert_eq!((&given.clip, &given.report.oddities[..]), (&found.clip, &[][..]));
}

#[test]
fn degrees_are_found_beyond_a_full_turn_and_asked_for_below() {
    let truth = walk(150, 30.0, 0.8);
    let degrees = |clip: &Clip| {
        rows(&write_csv(clip).unwrap(), |row| {
            row[7..].iter_mut().for_each(|n| *n = n.to_degrees())
        })
    };
    let found = with("walk.csv", degrees(&truth).as_bytes(), &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!(topics(&found), [Topic::Angles]);
    let options = Options {
        angles: Some(AngleUnit::Degrees),
        ..on_g1()
    };
    let found = with("walk.csv", degrees(&truth).as_bytes(), &options).unwrap();
    assert!(same(&truth, &found.clip) && topics(&found).is_empty());
    // A robot that hardly moves: 4.5 rad or 4.5 degrees.
    let small = rows(&write_csv(&walk(60, 30.0, 0.0)).unwrap(), |row| {
        row[7..].fill(0.0);
        row[10] = 4.5;
    });
    let error = with("walk.csv", small.as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("--degrees fits too, but then most frames turn no hinge farther than 4.5°")
            && error.contains("--joint-order")
            && error.contains("left_knee"),
        "{error}"
    );
    // Who follows that advice wrongly reads it again.
    let found = with("walk.csv", small.as_bytes(), &options).unwrap();
    assert!(
        found.report.oddities[0].text.contains("is --degrees right?"),
        "{:?}",
        found.report.oddities
    );
    // One frame beyond a full turn does not make degrees of the others.
    let text = write_csv(&truth).unwrap();
    let (first, others) = text.split_once('\n').unwrap();
    let broken = rows(first, |row| row[10] = 40.0) + others;
    let error = with("walk.csv", broken.as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("left_knee") && error.contains("in frame 0"),
        "{error}"
    );
}

#[test]
fn isaac_labs_order_is_found_by_the_limits() {
    let truth = walk(150, 30.0, 0.95);
    let order = truth.skeleton.robot.as_ref().unwrap().breadth_first();
    let text = rows(&write_csv(&truth).unwrap(), |row| {
        let angles = row[7..].to_vec();
        for (nth, &hinge) in order.iter().enumerate() {
            row[7 + nth] = angles[hinge];
        }
    });
    let found = with("walk.csv", text.as_bytes(), &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!(topics(&found), [Topic::JointOrder]);
    let options = Options {
        joint_order: Some(JointOrder::BreadthFirst),
        ..on_g1()
    };
    assert!(same(
        &truth,
        &with("walk.csv", text.as_bytes(), &options).unwrap().clip
    ));
    // No order fits a robot of other limits.
    let odd = rows(&text, |row| row[7..].iter_mut().for_each(|n| *n = 3.1));
    let options = Options {
        angles: Some(AngleUnit::Radians),
        ..on_g1()
    };
    let error = with("walk.csv", odd.as_bytes(), &options)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("beyond its limits") && error.contains("--joint-order"),
        "{error}"
    );
    let options = Options {
        joint_order: Some(JointOrder::Named(vec!["left_knee".to_owned()])),
        ..on_g1()
    };
    let error = with("walk.csv", text.as_bytes(), &options)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("--joint-order is left_knee; allowed: tree, isaaclab"),
        "{error}"
    );
}

#[test]
fn headers_and_times_say_what_the_columns_are() {
    let truth = walk(60, 50.0, 0.8);
    let skeleton = g1();
    let robot = skeleton.robot.as_ref().unwrap();
    let mut names: Vec<String> = robot
        .hinges()
        .iter()
        .map(|h| format!("{}_joint", skeleton.joints[h.joint].name))
        .collect();
    names.reverse();
    let text = rows(&write_csv(&truth).unwrap(), |row| row[7..].reverse());
    let times: String = text
        .lines()
        .enumerate()
        .map(|(n, row)| format!("{:.3},{row}\n", 0.02 * n as f64))
        .collect();
    let text = format!("time,x,y,z,qx,qy,qz,qw,{}\n{times}", names.join(","));
    let found = with("walk.csv", text.as_bytes(), &on_g1()).unwrap();
    assert!(same(&truth, &found.clip));
    assert_eq!((found.clip.fps, found.report.fps.basis), (50.0, Basis::Stated));
    // Without a header a column of times is still seen.
    let found = with(
        "walk.csv",
        times.as_bytes(),
        &Options {
            joint_order: Some(JointOrder::Named(names)),
            ..on_g1()
        },
    )
    .unwrap();
    assert!(same(&truth, &found.clip) && found.clip.fps == 50.0);
}

/// Unitree's rows under a header that names all columns.
pub(super) fn with_header(rows: &str) -> String {
    let skeleton = g1();
    let hinges = skeleton.robot.as_ref().unwrap().hinges();
    let names: Vec<&str> = hinges
        .iter()
        .map(|hinge| &*skeleton.joints[hinge.joint].name)
        .collect();
    format!("x,y,z,qx,qy,qz,qw,{}\n{rows}", names.join(","))
}

/// The time of a row, from 0.
pub(super) type Time<'a> = &'a dyn Fn(f64) -> String;

/// Rows with a column of times before them.
pub(super) fn timed(name: &str, rows: &str, time: Time<'_>) -> String {
    let lines = rows.lines().enumerate();
    let lines = lines.map(|(nth, row)| match nth {
        0 => format!("{name},{row}\n"),
        _ => format!("{},{row}\n", time(nth as f64 - 1.0)),
    });
    lines.collect()
}

#[test]
fn columns_of_times_give_their_rate_or_are_refused() {
    let text = with_header(&write_csv(&walk(90, 60.0, 0.8)).unwrap());
    let read = |name: &str, time: Time<'_>, options: &Options| {
        let found = with("walk.csv", timed(name, &text, time).as_bytes(), options);
        found.map(|found| (found.clip.fps, found.report.fps.basis))
    };
    let stated: [(&str, f32, Time<'_>); 7] = [
        ("time", 60.0, &|row| format!("{:.6}", row / 60.0)),
        ("Timestamp", 60.0, &|row| format!("{:.3}", 3.0 + row / 60.0)),
        ("time", 60.0, &|row| format!("{:.6}", 1000.0 * row / 60.0)),
        ("time_ms", 60.0, &|row| format!("{:.0}", 1000.0 * row / 60.0)),
        ("time_ms", 500.0, &|row| format!("{}", 2.0 * row)),
        ("t", 25.4, &|row| format!("{:.6}", row / 25.4)),
        ("time", 29.97, &|row| format!("{:.6}", row / 29.97)),
    ];
    for (name, fps, time) in stated {
        let (found, basis) = read(name, time, &on_g1()).unwrap();
        assert!(
            (found - fps).abs() < 1e-3 && basis == Basis::Stated,
            "{name} {fps}: {found}"
        );
    }
    let refused: [(&str, Time<'_>); 4] = [
        ("time", &|row| {
            format!("{:.6}", row / 60.0 + if row < 50.0 { 0.0 } else { 0.1 })
        }),
        ("time", &|row| format!("{}", row)),
        ("timestamp", &|row| format!("{:.0}", 1e9 * row / 60.0)),
        ("time", &|_| "0".to_owned()),
    ];
    for (name, time) in refused {
        let error = read(name, time, &on_g1()).unwrap_err();
        assert!(
            error.to_string().contains("the step of column") && error.to_string().ends_with("--fps decides"),
            "{error}"
        );
        let options = Options {
            fps: Some(60.0),
            ..on_g1()
        };
        assert_eq!(read(name, time, &options).unwrap(), (60.0, Basis::Given));
    }
    // A column that counts says nothing of the rate.
    let counted = read("frame", &|row| format!("{row}"), &on_g1()).unwrap();
    assert_eq!(counted, (30.0, Basis::Assumed));
}

#[test]
fn a_header_or_format_that_names_the_hinges_is_not_overridden() {
    let truth = walk(90, 30.0, 0.0);
    let skeleton = g1();
    let hinges = skeleton.robot.as_ref().unwrap().hinges();
    let mut guessed = 0;
    for (nth, hinge) in hinges.iter().enumerate() {
        let far = f64::from(hinge.upper_rad) + 0.55;
        let text = rows(&write_csv(&truth).unwrap(), |row| row[7..].fill(0.0));
        let (first, others) = text.split_once('\n').unwrap();
        let broken = rows(first, |row| row[7 + nth] = far) + others;
        guessed += u32::from(with("walk.csv", broken.as_bytes(), &on_g1()).is_ok());
        let error = with("walk.csv", with_header(&broken).as_bytes(), &on_g1()).unwrap_err();
        let name = &skeleton.joints[hinge.joint].name;
        let error = error.to_string();
        assert!(
            error.contains(&format!("({name}) is 0.55 rad beyond its limits"))
                && error.contains("--pack or --urdf")
                && !error.contains("--joint-order"),
            "{error}"
        );
    }
    assert!(guessed > 0, "no glitch looks like another order without names");
    // Named hinges may be in degrees.
    let swings = walk(90, 30.0, 0.8);
    let degrees = rows(&write_csv(&swings).unwrap(), |row| {
        row[7..].iter_mut().for_each(|n| *n = n.to_degrees())
    });
    let found = with("walk.csv", with_header(&degrees).as_bytes(), &on_g1()).unwrap();
    assert!(same(&swings, &found.clip));
    assert_eq!(topics(&found), [Topic::Angles]);
    let mut files = sonic_files(&reference(&truth).unwrap(), "walk");
    let order = skeleton.robot.as_ref().unwrap().breadth_first();
    for (column, &hinge) in order.iter().enumerate() {
        let whole = files[0].1.clone();
        let (header, text) = whole.split_once('\n').unwrap();
        let (first, others) = text.split_once('\n').unwrap();
        let far = f64::from(hinges[hinge].upper_rad) + 0.55;
        files[0].1 = format!("{header}\n{}{others}", rows(first, |row| row[column] = far));
        let error = sonic(&files, &on_g1()).unwrap_err().to_string();
        assert!(
            error.contains("beyond its limits") && !error.contains("--joint-order"),
            "{error}"
        );
        files[0].1 = whole;
    }
}

#[test]
fn options_of_files_with_joints_are_refused() {
    let text = write_csv(&walk(20, 30.0, 0.5)).unwrap();
    let qpos = write_qpos(&walk(20, 30.0, 0.5)).unwrap();
    let beyond = write_beyond_mimic(&walk(20, 30.0, 0.5)).unwrap();
    type Give = fn(&mut Options);
    let cases: [(&str, Give); 6] = [
        ("--up", |options| options.up = Some(Up::Y)),
        ("--unit", |options| options.unit_m = Some(0.001)),
        ("--root", |options| options.root = Some("nothere".to_owned())),
        ("--rest-pose", |options| options.rest_pose = Some(RestPose::T)),
        ("--max-slide", |options| options.max_slide_m = Some(0.1)),
        ("--leading-pose", |options| {
            options.leading_pose = LeadingPose::Drop
        }),
    ];
    for (flag, give) in cases {
        let mut options = on_g1();
        give(&mut options);
        for (name, bytes) in [("a.csv", text.as_bytes()), ("a.npy", &qpos), ("a.npz", &beyond)] {
            let error = with(name, bytes, &options).unwrap_err().to_string();
            let wanted =
                format!("{name}: {flag} does not apply to a robot's file: its axes and unit are fixed");
            assert!(error.starts_with(&wanted), "{error}");
        }
    }
    let options = Options {
        animation: Some("Walk".to_owned()),
        ..on_g1()
    };
    let error = with("a.csv", text.as_bytes(), &options).unwrap_err().to_string();
    assert!(error.contains("animation \"Walk\": only .glb"), "{error}");
}

#[test]
fn rows_of_another_robot_are_refused() {
    let text = write_csv(&walk(20, 30.0, 0.5)).unwrap();
    let wide = rows(&text, |row| row.push(0.0));
    let error = with("walk.csv", wide.as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("37 columns; robot g1_29dof_rev_1_0 has 36: 7 of the root and 29 angles"),
        "{error}"
    );
    let error = with("walk.csv", text.as_bytes(), &Options::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("--pack or --urdf gives the robot"), "{error}");
    let long = rows(&text, |row| row[6] = 1.2);
    let error = with("walk.csv", long.as_bytes(), &on_g1())
        .unwrap_err()
        .to_string();
    assert!(error.contains("length of the root's quaternion"), "{error}");
    // Upright in neither order: noted.
    let lying = rows(&text, |row| {
        row[3..7].copy_from_slice(&[0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0])
    });
    let found = with("walk.csv", lying.as_bytes(), &on_g1()).unwrap();
    assert!(
        found
            .report
            .oddities
            .iter()
            .any(|note| note.topic == Topic::Upright),
        "{:?}",
        found.report.oddities
    );
}

/// Reads SONIC's files back.
fn sonic(files: &[(&'static str, String)], options: &Options) -> Result<Understood, crate::read::ReadError> {
    let found = |name: &str| {
        let file = files.iter().find(|file| file.0 == name)?;
        Some(file.1.clone().into_bytes())
    };
    let bytes = found("joint_pos.csv").unwrap();
    let source = Source {
        name: "walk/joint_pos.csv",
        bytes: &bytes,
        beside: &found,
    };
    read(&source, options)
}

#[test]
fn trackers_layouts_are_read_back() {
    let truth = walk(100, 30.0, 0.8);
    let wanted = truth.resample(50.0).unwrap();
    let bytes = write_beyond_mimic(&truth).unwrap();
    let found = with("walk.npz", &bytes, &on_g1()).unwrap();
    assert!(same(&wanted, &found.clip));
    assert_eq!(
        (found.report.format.value, found.clip.fps),
        (Format::BeyondMimic, 50.0)
    );
    assert_eq!((topics(&found), &found.report.oddities[..]), (vec![], &[][..]));
    let files = sonic_files(&reference(&truth).unwrap(), "walk");
    assert_eq!(files.len(), 7);
    assert!(files[6].1.contains("Body part indexes:\n[0 1 2") && files[6].1.contains("Total timesteps: 166"));
    let found = sonic(&files, &on_g1()).unwrap();
    assert!(same(&wanted, &found.clip));
    let error = sonic(&files[..3], &on_g1()).unwrap_err().to_string();
    assert!(error.contains("body_quat.csv is missing beside it"), "{error}");
}

#[test]
fn references_have_velocities_in_their_bodies_order() {
    let truth = walk(100, 50.0, 0.8);
    let Reference {
        frames,
        joint_names,
        joint_pos,
        joint_vel,
        body_names,
        body_pos,
        body_lin_vel,
        body_ang_vel,
        body_quat,
    } = reference(&truth).unwrap();
    assert_eq!((frames, joint_names.len(), body_names.len()), (100, 29, 30));
    assert_eq!(
        &joint_names[..4],
        ["left_hip_pitch", "right_hip_pitch", "waist_yaw", "left_hip_roll"]
    );
    assert_eq!(&body_names[..2], ["pelvis", "left_hip_pitch"]);
    for joint in 0..29 {
        let rate = (joint_pos[42 * 29 + joint] - joint_pos[40 * 29 + joint]) / 0.04;
        assert!((joint_vel[41 * 29 + joint] - rate).abs() < 1e-3);
    }
    for body in 0..30 {
        for axis in 0..3 {
            let at = |frame: usize| body_pos[(frame * 30 + body) * 3 + axis];
            assert!((body_lin_vel[(41 * 30 + body) * 3 + axis] - (at(42) - at(40)) / 0.04).abs() < 1e-3);
        }
    }
    // The root turns left by 1.2 rad/s about Z.
    let root = &body_ang_vel[41 * 30 * 3..][..3];
    assert!((root[2] - 1.2).abs() < 1e-3 && root[0].abs() < 1e-3, "{root:?}");
    assert!((body_quat[..4].iter().map(|n| n * n).sum::<f32>() - 1.0).abs() < 1e-5);
    let human = crate::testing::walk(4);
    assert!(reference(&human).is_err() && write_beyond_mimic(&human).is_err());
}

#[test]
fn bodies_that_stand_elsewhere_are_noted() {
    let bytes = write_beyond_mimic(&walk(40, 50.0, 0.8)).unwrap();
    // A robot with longer legs.
    let skeleton = g1();
    let robot = skeleton
        .robot
        .as_ref()
        .map(|robot| crate::robot::RobotDoc::from((robot, &*skeleton)))
        .unwrap();
    let mut joints = skeleton.joints.clone();
    joints.iter_mut().for_each(|joint| joint.offset_m *= 1.3);
    let other = Skeleton::new(joints, skeleton.left_axis, 0.0, None)
        .unwrap()
        .with_robot(&robot)
        .unwrap();
    let options = Options {
        skeleton: Some(Arc::new(other)),
        ..Options::default()
    };
    let found = with("walk.npz", &bytes, &options).unwrap();
    assert!(
        found
            .report
            .oddities
            .iter()
            .any(|note| note.topic == Topic::JointOrder),
        "{:?}",
        found.report.oddities
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_robot_comes_back_in_every_dialect(
        share in 0.9_f32..1.0, wxyz: bool, degrees: bool, breadth_first: bool, fps in 20.0_f32..60.0,
    ) {
        let truth = walk(120, fps.round(), share);
        let order = truth.skeleton.robot.as_ref().unwrap().breadth_first();
        let text = rows(&write_csv(&truth).unwrap(), |row| {
            let angles = row[7..].to_vec();
            for (nth, &hinge) in order.iter().enumerate() {
                if breadth_first { row[7 + nth] = angles[hinge]; }
            }
            if degrees { row[7..].iter_mut().for_each(|n| *n = n.to_degrees()); }
            if wxyz { row[3..7].rotate_right(1); }
        });
        let options = Options {
            fps: Some(fps.round()),
            ..on_g1()
        };
        let found = with("walk.csv", text.as_bytes(), &options).unwrap();
        prop_assert!(same(&truth, &found.clip), "{:?}", found.report.repairs);
    }
}

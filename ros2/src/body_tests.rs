//! Known poses of Troupe in ROS.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{Quat, Vec3};
use troupe_motion::conventions::Convention;
use troupe_motion::robot::ROOT_QPOS;
use troupe_motion::rotation::to_wxyz;

use super::*;

/// A robot of two joints, the second of which turns without end.
fn body() -> Body {
    Body {
        joints: vec!["hip_joint".to_owned(), "wheel_joint".to_owned()],
        endless: vec![false, true],
        root: "one/pelvis".to_owned(),
    }
}

/// The `qpos` of a root in Troupe's axes: X left, Y up, Z ahead.
fn qpos(root: Vec3, rotation: Quat, angles: [f32; 2]) -> Vec<f32> {
    let place = Convention::Ros.position_from_native(root);
    let turn = to_wxyz(Convention::Ros.rotation_from_native(rotation));
    [&place.to_array()[..], &turn, &angles].concat()
}

fn shown(rotation: Quat) -> Shown {
    let row = qpos(Vec3::new(2.0, 0.8, 3.0), rotation, [0.1, 0.2]);
    body().shown(0, 50.0, &row, None).unwrap()
}

fn transform(rotation: Quat) -> Transform {
    let message = body().transform(&shown(rotation), Time::from_nanos(1_500_000_000));
    message.transforms[0].transform
}

#[test]
fn a_place_has_x_ahead_y_to_the_left_and_z_up() {
    let at = transform(Quat::IDENTITY).translation;
    // Two metres to the left, 0.8 up, three ahead.
    let wanted = DVec3::new(3.0, 2.0, f64::from(0.8_f32));
    assert_eq!(at, wanted.into());
}

#[test]
fn a_quaternion_has_its_w_at_the_end() {
    let turn = transform(Quat::IDENTITY).rotation;
    assert_eq!((turn.x, turn.y, turn.z, turn.w), (0.0, 0.0, 0.0, 1.0));
    // A quarter to the left, about Troupe's Y, is about Z.
    let left = transform(Quat::from_rotation_y(FRAC_PI_2)).rotation;
    let half = 0.5_f64.sqrt();
    for (got, wanted) in [(left.x, 0.0), (left.y, 0.0), (left.z, half), (left.w, half)] {
        assert!((got - wanted).abs() < 1e-6, "{left:?}");
    }
    // Bowing, about Troupe's X to the left, is about Y.
    let bowed = transform(Quat::from_rotation_x(0.5)).rotation;
    assert!((bowed.y - f64::from(0.25_f32.sin())).abs() < 1e-6, "{bowed:?}");
    // Leaning to the right, about Troupe's Z ahead, is about X.
    let leaned = transform(Quat::from_rotation_z(0.5)).rotation;
    assert!((leaned.x - f64::from(0.25_f32.sin())).abs() < 1e-6, "{leaned:?}");
}

#[test]
fn the_heading_is_that_of_the_x_axis() {
    for heading in [0.0, FRAC_PI_4, FRAC_PI_2, -3.0, 3.1] {
        // A robot that bows keeps its heading.
        let turn = Quat::from_rotation_y(heading) * Quat::from_rotation_x(0.4);
        let place = shown(turn).place();
        assert!(
            (place.heading - heading).abs() < 1e-5,
            "{place:?} instead of {heading}"
        );
        assert_eq!((place.x, place.y), (3.0, 2.0));
    }
}

#[test]
fn frames_and_stamps_are_those_of_the_robot() {
    let stamp = Time::from_nanos(1_500_000_000);
    let message = body().transform(&shown(Quat::IDENTITY), stamp);
    let [only] = message.transforms.as_slice() else {
        panic!("{message:?}")
    };
    assert_eq!(
        (&*only.header.frame_id, &*only.child_frame_id),
        ("odom", "one/pelvis")
    );
    assert_eq!(only.header.stamp, stamp);
    let state = body().joint_state(&shown(Quat::IDENTITY), stamp);
    assert_eq!(state.name, ["hip_joint", "wheel_joint"]);
    assert_eq!(state.position, [0.1_f32, 0.2].map(f64::from));
    assert_eq!((state.velocity, state.effort), (vec![0.0; 2], vec![]));
}

#[test]
fn speeds_are_those_since_the_frame_before() {
    let row = |angles| qpos(Vec3::ZERO, Quat::IDENTITY, angles);
    let first = body().shown(10, 50.0, &row([0.5, 3.0]), None).unwrap();
    // Two ticks later, because one was missed: 0.04 s.
    let next = body().shown(12, 50.0, &row([0.4, -3.0]), Some(&first)).unwrap();
    assert!((next.speeds[0] + 2.5).abs() < 1e-5, "{next:?}");
    // The wheel went on past half a turn: 0.2832 rad.
    assert!((next.speeds[1] - 0.283_185 / 0.04).abs() < 1e-4, "{next:?}");

    let mut begun = next.clone();
    begun.begin();
    let other = body().shown(40, 50.0, &row([0.0, 0.0]), Some(&begun)).unwrap();
    assert_eq!(other.speeds, [0.0, 0.0], "another stream");
    let mut held = next;
    held.stop();
    assert_eq!((held.speeds, held.angles[0]), (vec![0.0; 2], f64::from(0.4_f32)));
}

#[test]
fn a_frame_of_another_robot_is_none() {
    let row = qpos(Vec3::ZERO, Quat::IDENTITY, [0.0; 2]);
    assert_eq!(body().shown(0, 50.0, &row[..row.len() - 1], None), None);
    assert_eq!(body().shown(0, 50.0, &row[..ROOT_QPOS - 1], None), None);
}

//! Orders and the commands that follow from them.

use std::f32::consts::FRAC_PI_2;

use ros2_client::builtin_interfaces::Time;

use super::*;
use crate::messages::{Header, Pose, PoseStamped, Quaternion, Vector3};

const HERE: Place = Place {
    x: 1.0,
    y: 2.0,
    heading: FRAC_PI_2,
};
const TICK: Duration = Duration::from_millis(20);

fn moves(command: Option<Command>) -> Locomotion {
    match command {
        Some(Command::Move(locomotion)) => locomotion,
        other => panic!("{other:?}"),
    }
}

fn way(command: Option<Command>) -> Vec<[f32; 2]> {
    match command {
        Some(Command::Act(Act::FollowPath(path))) => path
            .points
            .iter()
            .map(|at| [at.position.x, at.position.y])
            .collect(),
        other => panic!("{other:?}"),
    }
}

fn path(frame: &str, places: &[[f64; 2]]) -> Path {
    let header = |frame: &str| Header {
        stamp: Time::ZERO,
        frame_id: frame.to_owned(),
    };
    let orientation = Quaternion {
        x: 0.0,
        y: 0.0,
        z: 0.0,
        w: 1.0,
    };
    let pose = |&[x, y]: &[f64; 2]| PoseStamped {
        header: header(""),
        pose: Pose {
            position: Vector3 { x, y, z: 0.0 },
            orientation,
        },
    };
    Path {
        header: header(frame),
        poses: places.iter().map(pose).collect(),
    }
}

#[test]
fn a_velocity_is_in_the_robots_own_frame() {
    let (mut steering, now) = (Steering::default(), Instant::now());
    assert_eq!(steering.take(Order::Drive([0.8, 0.2, 0.0]), now, HERE), None);
    let command = moves(steering.due(now, HERE));
    // It faces along Y: ahead is +Y, left is -X.
    let wanted = Vec3::new(-0.2, 0.8, 0.0);
    assert!(command.velocity.abs_diff_eq(wanted, 1e-6), "{command:?}");
    assert!((command.facing.unwrap() - FRAC_PI_2).abs() < 1e-6);
    assert_eq!(steering.due(now + TICK, HERE), None, "nothing changed");
}

#[test]
fn a_silent_robot_stands() {
    let (mut steering, now) = (Steering::default(), Instant::now());
    steering.take(Order::Drive([0.8, 0.0, 0.0]), now, HERE);
    steering.due(now, HERE);
    assert_eq!(steering.due(now + SILENCE, HERE), None);
    let later = now + SILENCE + TICK;
    assert_eq!(moves(steering.due(later, HERE)), Locomotion::stand());
    assert_eq!(steering.due(later + TICK, HERE), None);
}

#[test]
fn an_order_that_waited_too_long_moves_nothing() {
    let (mut steering, now) = (Steering::default(), Instant::now());
    steering.take(Order::Drive([0.8, 0.0, 0.0]), now, HERE);
    let command = moves(steering.due(now + Duration::from_secs(2), HERE));
    assert_eq!(command, Locomotion::stand());
}

#[test]
fn a_turn_goes_on_in_steps_of_a_tenth() {
    let (mut steering, mut now) = (Steering::default(), Instant::now());
    let mut place = Place::default();
    let mut sent = Vec::new();
    // Half a turn a second, for a second. The robot is 0.2 rad behind.
    for nth in 0..=50 {
        steering.take(Order::Drive([0.0, 0.0, 0.5]), now, place);
        if let Some(Command::Move(command)) = steering.due(now, place) {
            sent.push(command.facing.unwrap());
        }
        now += TICK;
        place.heading = (0.01 * nth as f32 - 0.2).max(0.0);
    }
    assert!((4..=6).contains(&sent.len()), "{sent:?}");
    assert!((sent.last().unwrap() - 0.5).abs() < TURN_RAD, "{sent:?}");
}

#[test]
fn a_robot_that_cannot_turn_has_the_heading_wait() {
    let (mut steering, mut now) = (Steering::default(), Instant::now());
    let place = Place::default();
    let mut most = 0.0_f32;
    for _ in 0..200 {
        steering.take(Order::Drive([0.0, 0.0, 2.0]), now, place);
        if let Some(Command::Move(command)) = steering.due(now, place) {
            most = most.max(command.facing.unwrap());
        }
        now += TICK;
    }
    assert!((0.8..=LEAD_RAD).contains(&most), "{most}");
}

#[test]
fn zero_stops_whatever_it_does() {
    let (mut steering, now) = (Steering::default(), Instant::now());
    steering.take(Order::Follow(vec![[1.0, 2.0], [3.0, 2.0]]), now, HERE);
    assert_eq!(
        steering.due(now + TICK, HERE),
        None,
        "a path needs no more orders"
    );
    steering.take(Order::Drive([0.0; 3]), now + TICK, HERE);
    assert_eq!(moves(steering.due(now + TICK, HERE)), Locomotion::stand());
    assert_eq!(steering.due(now + TICK * 40, HERE), None);
}

#[test]
fn a_path_ends_driving_and_keeps_its_places() {
    let (mut steering, now) = (Steering::default(), Instant::now());
    steering.take(Order::Drive([0.8, 0.0, 0.0]), now, HERE);
    let order = Order::of_path(&path("odom", &[[1.0, 2.0], [1.0, 2.001], [3.0, 2.5]])).unwrap();
    // Places that are one place count once.
    let places = way(steering.take(order, now, HERE));
    assert_eq!(places, [[1.0, 2.0], [3.0, 2.5]]);
    assert_eq!(
        steering.due(now + SILENCE * 2, HERE),
        None,
        "silence means nothing now"
    );
}

#[test]
fn a_single_place_is_a_way_from_here() {
    let mut steering = Steering::default();
    let order = Order::of_path(&path("", &[[4.0, 2.0]])).unwrap();
    let places = way(steering.take(order, Instant::now(), HERE));
    assert_eq!(places, [[1.0, 2.0], [4.0, 2.0]]);
    let nowhere = Order::of_path(&path("odom", &[])).unwrap();
    let command = steering.take(nowhere, Instant::now(), HERE);
    assert_eq!(moves(command), Locomotion::stand());
}

#[test]
fn a_long_path_is_thinned_to_its_ends() {
    let places: Vec<[f64; 2]> = (0..5000).map(|nth| [f64::from(nth) * 0.05, 0.0]).collect();
    let order = Order::of_path(&path("odom", &places)).unwrap();
    let way = way(Steering::default().take(order, Instant::now(), HERE));
    assert_eq!(way.len(), MAX_POINTS);
    assert_eq!((way[0], way[1023]), ([0.0, 0.0], [249.95, 0.0]));
}

#[test]
fn orders_that_cannot_be_are_named() {
    let of_path = |path: &Path| Order::of_path(path).unwrap_err();
    let map = of_path(&path("map", &[[0.0, 0.0]]));
    assert!(map.contains("its frame is \"map\"; allowed: \"odom\""), "{map}");
    let mut mixed = path("odom", &[[0.0, 0.0]]);
    mixed.poses[0].header.frame_id = "base".to_owned();
    assert!(of_path(&mixed).contains("\"base\""));
    assert!(of_path(&path("odom", &[[f64::NAN, 0.0]])).contains("no number"));
    let long = vec![[0.0, 0.0]; MAX_POSES + 1];
    assert!(of_path(&path("odom", &long)).contains("100001 poses; allowed: at most 100000"));
    let mut twist = Twist::default();
    twist.angular.z = f64::INFINITY;
    assert!(Order::of_twist(&twist).unwrap_err().contains("no velocity"));
    assert!(Order::of_words(" \n").unwrap_err().contains("is empty"));
    assert!(
        Order::of_words(&"a".repeat(4001))
            .unwrap_err()
            .contains("4001 bytes")
    );
}

#[test]
fn words_are_acted_out() {
    let order = Order::of_words(" a person waves ").unwrap();
    let command = Steering::default().take(order, Instant::now(), HERE);
    let wanted = Act::from(Performance::of("a person waves"));
    assert_eq!(command, Some(Command::Act(wanted)));
}

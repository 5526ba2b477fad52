use proptest::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI};

use super::*;
use crate::style::testing::walker_style;

/// A style of the gaits with these names.
fn of(names: &[&str]) -> Style {
    let mut style = walker_style();
    style.gaits.retain(|gait| names.contains(&gait.name.as_str()));
    style
}

fn world(speed: f32, direction: f32) -> Vec3 {
    Vec3::new(speed * direction.sin(), 0.0, speed * direction.cos())
}

#[test]
fn a_velocity_that_a_gait_has_is_unchanged() {
    let style = walker_style();
    for gait in style.gaits.iter().filter(|gait| gait.speed_mps() > 0.0) {
        let velocity = yaw(0.7) * Vec3::new(gait.left_mps, 0.0, gait.forward_mps);
        let near = nearest(&style, None, velocity, 0.7);
        assert!(near.velocity.distance(velocity) < 1e-5, "{}: {near:?}", gait.name);
        assert!((near.facing - 0.7).abs() < 1e-5, "{}", gait.name);
    }
}

#[test]
fn a_visible_difference_to_the_command_is_reported() {
    let style = of(&["idle", "walk", "run", "walk-back"]);
    let reported = |velocity: Vec3, facing: Option<f32>| {
        let near = nearest(&style, None, velocity, facing.unwrap_or(0.0));
        near.instead_of(velocity, facing)
    };
    assert_eq!(reported(Vec3::ZERO, Some(1.0)), None);
    assert_eq!(reported(Vec3::Z, Some(0.0)), None);
    let fast = reported(Vec3::Z * 9.0, Some(0.0)).unwrap();
    assert!(fast.wanted_mps == 9.0 && fast.speed_mps < 5.0, "{fast:?}");
    assert_eq!(fast.facing, None);
    let aside = reported(Vec3::X * 0.5, Some(0.0)).unwrap();
    assert!(
        (aside.facing.unwrap() - (FRAC_PI_2 - FORWARD_ARC)).abs() < 1e-4,
        "{aside:?}"
    );
}

#[test]
fn eight_metres_a_second_sideways_is_a_brisk_walk_that_faces_more_that_way() {
    let style = of(&["idle", "walk", "run", "walk-back"]);
    for side in [1.0, -1.0] {
        let near = nearest(&style, None, Vec3::new(side * 8.0, 0.0, 0.0), 0.0);
        let speed = near.velocity.length();
        assert!((0.4..1.5).contains(&speed), "{speed}");
        assert!(
            near.velocity.normalize().x * side > 0.999,
            "it goes where the command says"
        );
        let off = side * FRAC_PI_2 - near.facing;
        assert!((off.abs() - FORWARD_ARC).abs() < 1e-4, "{}", near.facing);
    }
}

#[test]
fn a_side_gait_keeps_the_heading() {
    let mut style = of(&["idle", "walk"]);
    let mut step = style.gait("walk").unwrap().clone();
    (step.name, step.left_mps, step.forward_mps) = ("step-left".to_owned(), 0.8, 0.0);
    style.gaits.push(step);
    let near = nearest(&style, None, Vec3::new(0.8, 0.0, 0.0), 0.0);
    assert_eq!(near.facing, 0.0);
    assert!((near.velocity.x - 0.8).abs() < 1e-5);
    let other = nearest(&style, None, Vec3::new(-0.8, 0.0, 0.0), 0.0);
    assert!(other.facing < -0.5, "there is none to the other side");
}

#[test]
fn forwards_is_slightly_faster_than_the_fastest_gait() {
    let style = walker_style();
    let speed = |direction, facing| {
        nearest(&style, None, world(9.0, direction), facing)
            .velocity
            .length()
    };
    assert!((speed(0.0, 0.0) - 3.3).abs() < 1e-4);
    assert!((speed(2.0, 2.0) - 3.3).abs() < 1e-4, "for any heading");
    assert!(
        (speed(PI, 0.0) - 0.77).abs() < 1e-4,
        "backwards as fast as the gait for it"
    );
    let walk = style.gaits.iter().position(|gait| gait.name == "walk");
    let near = nearest(&style, walk, world(9.0, 0.0), 0.0);
    assert!(
        (near.velocity.length() - 1.32).abs() < 1e-4,
        "only the named gait counts"
    );
}

#[test]
fn backwards_is_slow_without_a_gait_for_it() {
    let near = nearest(&of(&["idle", "walk", "run"]), None, world(3.0, PI), 0.0);
    let speed = near.velocity.length();
    assert!(speed > 0.4 && speed < 0.9, "{speed}");
    assert_eq!(near.facing, 0.0);
}

#[test]
fn a_style_without_moving_gaits_stands_and_keeps_its_heading() {
    let near = nearest(&of(&["idle"]), None, world(3.0, 1.5), 0.2);
    assert_eq!((near.velocity, near.facing), (Vec3::ZERO, 0.2));
    let near = nearest(&walker_style(), None, world(0.04, 1.5), 0.2);
    assert_eq!((near.velocity, near.facing), (Vec3::ZERO, 0.2));
}

proptest! {
    #[test]
    fn the_result_is_never_faster_and_never_in_another_direction(speed in 0.1f32..20.0, direction in -PI..PI, facing in -PI..PI) {
        let velocity = world(speed, direction);
        let near = nearest(&walker_style(), None, velocity, facing);
        prop_assert!(near.velocity.length() <= speed + 1e-4 && near.velocity.length() > 0.09);
        prop_assert!(near.velocity.length() < 3.31);
        prop_assert!(near.velocity.normalize().dot(velocity.normalize()) > 0.9999);
        prop_assert!(near.facing > -PI - 1e-5 && near.facing <= PI + 1e-5);
    }

    #[test]
    fn the_speed_is_continuous_in_the_direction(direction in -PI..PI) {
        let style = walker_style();
        let speed = |direction| nearest(&style, None, world(9.0, direction), 0.0).velocity.length();
        prop_assert!((speed(direction) - speed(direction + 1e-3)).abs() < 0.02);
    }
}

#[test]
fn a_gait_straight_aside_allows_any_direction_facing_ahead() {
    let mut style = of(&["idle", "walk", "walk-back"]);
    let mut aside = style.gait("walk").unwrap().clone();
    (aside.left_mps, aside.forward_mps) = (0.9, 0.0);
    style.gaits.push(aside);
    for degrees in [50.0f32, 90.0, 130.0] {
        let velocity = world(0.8, degrees.to_radians());
        let left = nearest(&style, None, velocity, 0.0);
        assert_eq!(left.facing, 0.0, "{degrees}");
        let right = nearest(&style, None, velocity * Vec3::new(-1.0, 1.0, 1.0), 0.0);
        assert!(
            degrees > 120.0 || right.facing != 0.0,
            "it has none to the right: {degrees}"
        );
    }
    assert!((nearest(&style, None, Vec3::X * 2.0, 0.0).velocity.x - 0.9 * SPEED_MARGIN).abs() < 1e-5);
}

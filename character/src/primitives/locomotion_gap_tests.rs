//! Poses in the gap of a plan, and the heading of a standing character.

use std::f32::consts::FRAC_PI_2;

use troupe_motion::root::heading_of;

use super::super::*;
use super::{FPS, LAST, STANDS, STOPS, Scene, command, only, poses_at, style, target};
use crate::primitives::recipe::ASIDE_FOLLOWS;

#[test]
fn a_standing_character_has_a_pose_in_the_gap() {
    let style = style();
    let plan = |speed: f32, heading: f32, facing: f32| {
        let scene = Scene::new(&style, Vec3::ZERO, heading, speed, 0.0);
        Locomotion::new(0, heading, FPS, command(&style, 0.0, 0.0, Some(facing))).plan(&scene.at(4))
    };
    let stands = plan(0.0, 0.4, 0.4);
    assert_eq!(poses_at(&stands), STANDS);
    let heading = heading_of(stands.gap_poses[0].rotations[0], Vec3::X);
    assert!((heading - 0.4).abs() < 0.2, "{heading}");
    assert_eq!(poses_at(&plan(0.6, 0.4, 0.4)), STOPS);
    assert_eq!(poses_at(&plan(0.0, 0.4, 0.7)), STOPS);
}

#[test]
fn standing_takes_the_commanded_heading_or_keeps_its_own() {
    let style = style();
    let scene = Scene::standing(&style);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 0.0, None));
    assert!(target(&locomotion.plan(&scene.at(4))).0.heading.abs() < 1e-6);
    locomotion.set_command(30, command(&style, 0.0, 0.0, Some(-1.0)));
    let plan = locomotion.plan(&scene.at(34));
    assert!((plan.r_g2[LAST].heading + 1.0).abs() < 0.01);
    assert!((plan.r_g1.heading + 1.0).abs() < 1e-6);
}

#[test]
fn without_a_turning_gait_a_turn_on_the_spot_takes_steps() {
    let style = only(&["idle", "walk"]);
    let scene = Scene::standing(&style);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, 0.0, 0.0, None));
    locomotion.set_command(30, command(&style, 0.0, 0.0, Some(FRAC_PI_2)));
    let plan = locomotion.plan(&scene.at(34));
    let frames: Vec<usize> = plan.gap_poses.iter().map(|pose| pose.frame).collect();
    assert_eq!(frames, [3 + 12 - 4, 3 + 22 - 4]);
    for pose in &plan.gap_poses {
        let heading = heading_of(pose.rotations[0], Vec3::X);
        assert!(
            (heading - plan.r_g2[pose.frame].heading).abs() < 0.2,
            "turned as far as the spring"
        );
    }
    // Later plans have only the steps that are still to come. Small turns have none, but a pose at
    // their end.
    assert_eq!(locomotion.plan(&scene.at(43)).gap_poses.len(), 1);
    assert_eq!(
        poses_at(&locomotion.plan(&scene.at(52))),
        STANDS,
        "it only stands"
    );
    locomotion.set_command(60, command(&style, 0.0, 0.0, Some(FRAC_PI_2 - 0.3)));
    assert_eq!(poses_at(&locomotion.plan(&scene.at(64))), STOPS);
    // A style with a gait for it needs no steps.
    let turning = only(&["idle", "walk", "turn-left"]);
    let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&turning, 0.0, 0.0, Some(FRAC_PI_2)));
    let plan = locomotion.plan(&scene.at(4));
    assert_eq!(poses_at(&plan), STOPS);
    assert!(
        plan.gaits
            .iter()
            .any(|(name, weight)| name == "turn-left" && *weight > 0.5)
    );
}

#[test]
fn going_aside_has_more_poses_in_the_gap() {
    let style = style();
    let scene = Scene::standing(&style);
    let plan = |x: f32, z: f32| {
        let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, x, z, Some(0.0)));
        let poses = locomotion.plan(&scene.at(4)).gap_poses;
        poses.iter().map(|pose| pose.frame).collect::<Vec<_>>()
    };
    assert_eq!(plan(0.6, 0.6), [9, 15, 21, 27]);
    assert_eq!(plan(0.0, -0.7), [9, 15, 21, 27]);
    assert_eq!(plan(0.1, 1.0), [18]);
}

#[test]
fn a_plan_is_drawn_to_captured_gaits_that_go_aside_or_backwards() {
    let style = style();
    let scene = Scene::standing(&style);
    let drawn = |x: f32, z: f32| {
        let mut locomotion = Locomotion::new(0, 0.0, FPS, command(&style, x, z, Some(0.0)));
        let follow = locomotion.plan(&scene.at(4)).follow;
        follow.map(|follow| follow.weights.iter().copied().fold(0.0, f32::max))
    };
    assert_eq!(drawn(0.6, 0.6), Some(ASIDE_FOLLOWS));
    assert_eq!(drawn(0.0, -0.7), Some(ASIDE_FOLLOWS));
    assert_eq!((drawn(0.1, 1.0), drawn(0.0, 0.0)), (None, None));
}

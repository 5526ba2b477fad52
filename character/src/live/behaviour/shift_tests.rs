//! Ground that changes under a character, with plans that go straight (see [`super::testing`]).

use std::sync::Arc;

use troupe_motion::Vec3;

use super::super::EventKind;
use super::testing::*;
use crate::scene::{Collider, Scene, SceneError, Transform};

/// Puts the scene again, with the ground plane at this height and these colliders.
fn put_again(rig: &Harness, ground: f32, colliders: &[Collider]) {
    rig.scene
        .update(|scene| {
            let mut new = Scene::new(ground)?;
            new.set_colliders(colliders)?;
            scene.become_scene(new);
            Ok::<(), SceneError>(())
        })
        .unwrap();
}

/// A harness on bare ground at height 0 that has walked or stood for a while.
fn on_ground(walks: bool) -> Harness {
    let mut rig = Harness::new();
    put_again(&rig, 0.0, &[]);
    if walks {
        rig.walk(0.0, 1.0);
    }
    rig.run(30);
    rig
}

/// Checks the height of the hips over ground at `height`, and that frames from `from` on made no
/// jump.
fn assert_on(rig: &Harness, from: usize, height: f32, what: &str) {
    assert!(rig.events.is_empty(), "{what}: {:?}", rig.events);
    let last = rig.frames.last().unwrap().root;
    assert!((last.y - 0.9 - height).abs() < 0.05, "{what}: {last}");
    let feet = rig.joints(rig.frames.len() - 1);
    let low = feet[12].y.min(feet[15].y) - height;
    assert!((0.03..0.12).contains(&low), "{what}: feet at {low}");
    let (_, step) = rig.roughness(from);
    assert!(step < 0.16, "{what}: {step} m in a frame");
}

#[test]
fn rising_ground_lifts_a_character() {
    for walks in [false, true] {
        for height in [0.1, 0.2, 0.5, 0.8, 1.5, -0.2] {
            let floor = block(
                "floor",
                [0.0, 0.5 * height - 1.0, 0.0],
                [9.0, 0.5 * height + 1.0, 9.0],
            );
            for (ground, colliders) in [(height, vec![]), (-2.0, vec![floor])] {
                let what = format!("{height} m, walks: {walks}, colliders: {}", colliders.len());
                let mut rig = on_ground(walks);
                put_again(&rig, ground, &colliders);
                rig.run(4);
                let soon = rig.frames.last().unwrap().root.y - 0.9;
                assert!(soon * height.signum() > 0.05, "{what}: at once: {soon}");
                rig.run(60);
                assert_on(&rig, 28, height, &what);
            }
        }
    }
}

#[test]
fn ground_that_rises_far_lifts_a_character_at_once() {
    let mut rig = on_ground(false);
    put_again(&rig, 50.0, &[]);
    rig.run(3);
    assert_on(&rig, rig.frames.len() - 2, 50.0, "50 m");
    // Not onto a wall: there is nothing to stand on within two metres.
    let mut rig = on_ground(true);
    let tower = block("tower", [0.0, 10.0, 0.0], [5.0, 10.0, 5.0]);
    put_again(&rig, 0.0, &[tower]);
    rig.run(30);
    assert_on(&rig, 28, 0.0, "tower");
}

#[test]
fn ground_that_moves_up_and_down_carries_a_character() {
    for rate in [0.003, 0.03, -0.03] {
        let mut rig = on_ground(false);
        for frame in 1..=60 {
            put_again(&rig, rate * frame as f32, &[]);
            rig.tick();
            let off = rig.frames.last().unwrap().root.y - 0.9 - rate * frame as f32;
            assert!(off.abs() < 0.12, "{rate} m a frame: {off}");
        }
        rig.run(20);
        assert_on(&rig, 28, rate * 60.0, "lift");
    }
}

#[test]
fn a_changing_scene_does_not_make_a_wall_a_step() {
    let mut rig = Harness::new();
    put_again(&rig, 0.0, &[block("wall", [0.0, 0.4, 1.5], [2.0, 0.4, 0.3])]);
    let cup = rig.definitions.get("cup").unwrap().definition;
    rig.scene
        .update(|scene| scene.add("cup", "cup", Arc::clone(&cup.body), Transform::default()))
        .unwrap();
    rig.walk(0.0, 1.0);
    for frame in 0..90 {
        rig.move_object("cup", Vec3::new(5.0, 0.0, 0.01 * frame as f32));
        rig.tick();
        let root = rig.frames.last().unwrap().root;
        assert!((root.y - 0.9).abs() < 0.05, "{root}");
    }
    assert!(rig.frames.last().unwrap().root.z > 2.0, "it went through");
}

#[test]
fn a_seated_character_is_lifted_once_it_walks() {
    let mut rig = Harness::new();
    rig.interact("bench", "sit").unwrap();
    rig.until(
        400,
        |kind| matches!(kind, EventKind::Reached { set, .. } if set == "sit"),
    )
    .unwrap();
    rig.run(10);
    let sits = rig.frames.last().unwrap().root;
    let floor = block("floor", [0.0, 0.0, 0.0], [9.0, 0.5, 9.0]);
    rig.scene.update(|scene| scene.set_colliders(&[floor])).unwrap();
    rig.run(30);
    assert!((rig.frames.last().unwrap().root - sits).length() < 0.02);
    rig.walk(0.0, 1.0);
    rig.run(120);
    let last = rig.frames.last().unwrap().root;
    assert!((last.y - 1.4).abs() < 0.05, "{last}");
}

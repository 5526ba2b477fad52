//! Commands that come together or twice, carried objects that disappear, and the order of events.

use troupe_motion::Vec3;

use super::super::{EventKind, FailReason, Intent};
use super::testing::*;
use super::tests::{is_done, with_cup};
use crate::scene::{Scene, State};

/// A harness whose character walks with the cup in its hand.
fn carrying() -> Harness {
    let mut rig = with_cup();
    rig.walk(-1.0, 0.0);
    rig.run(20);
    assert_eq!(rig.words().last(), Some(&"interrupted"));
    rig
}

/// The reason of the newest event, if that is a failure.
fn last_failure(rig: &Harness) -> Option<FailReason> {
    match &rig.events.last()?.kind {
        EventKind::Failed { reason, .. } => Some(*reason),
        _ => None,
    }
}

fn walks(rig: &Harness) -> bool {
    let at = |back: usize| rig.frames[rig.frames.len() - back].root;
    at(1).distance(at(2)) > 0.01
}

#[test]
fn a_walk_does_not_drop_earlier_commands() {
    for drop_first in [true, false] {
        let mut rig = carrying();
        rig.walk(0.0, 0.0);
        rig.run(40);
        assert!(!walks(&rig));
        if drop_first {
            rig.give(Intent::Drop).unwrap();
        }
        rig.walk(0.0, -1.0);
        if !drop_first {
            rig.give(Intent::Drop).unwrap();
        }
        rig.run(30);
        assert_eq!(rig.words().last(), Some(&"released"), "drop first: {drop_first}");
        assert!(walks(&rig), "drop first: {drop_first}");
    }
}

#[test]
fn commands_that_come_together_hold_in_their_order() {
    let mut rig = carrying();
    rig.give(Intent::Drop).unwrap();
    rig.walk(0.0, -1.0);
    rig.interact("sign", "nod").unwrap();
    rig.run(1);
    let words = rig.words();
    assert_eq!(words[words.len() - 2..], ["released", "started"]);
    rig.until(600, is_done)
        .expect("the walk before it does not break it off");
    // Breaking it off at once still begins it first.
    rig.interact("bench", "").unwrap();
    rig.walk(0.0, 1.0);
    rig.run(1);
    let words = rig.words();
    assert_eq!(words[words.len() - 2..], ["started", "interrupted"]);
}

#[test]
fn a_newer_command_replaces_a_waiting_interaction() {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.interact("sign", "nod").unwrap();
    rig.run(1);
    assert_eq!(rig.words(), ["started"]);
    assert_eq!(rig.object("cup").state, State::Free);
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.give(Intent::Cancel).unwrap();
    rig.run(1);
    assert!(rig.words().is_empty(), "{:?}", rig.event_words());
}

#[test]
fn removing_a_carried_object_is_an_event() {
    let mut rig = carrying();
    rig.scene.update(|scene| scene.remove("cup")).unwrap();
    rig.run(20);
    assert_eq!(
        last_failure(&rig),
        Some(FailReason::Removed),
        "{:?}",
        rig.event_words()
    );
    assert!(rig.character.held().is_none() && walks(&rig));
    let failures = rig.words().iter().filter(|&&word| word == "failed").count();
    assert_eq!(failures, 1);
}

/// Putting a scene again frees everything in it.
#[test]
fn putting_a_scene_again_takes_a_carried_object() {
    let mut carried = carrying();
    let mut held = with_cup();
    for rig in [&mut carried, &mut held] {
        let same = room(&rig.definitions);
        let put = |scene: &mut Scene| {
            *scene = same;
            Ok::<_, ()>(())
        };
        rig.scene.update(put).unwrap();
        rig.run(5);
        assert_eq!(
            last_failure(rig),
            Some(FailReason::Removed),
            "{:?}",
            rig.event_words()
        );
        assert!(rig.character.held().is_none());
        assert_eq!(rig.object("cup").state, State::Free);
    }
}

#[test]
fn an_object_carried_out_of_the_world_is_freed() {
    let far = 9_999.4;
    for intent in [Intent::Drop, Intent::Cancel] {
        let near = Harness::new();
        let table = block("table", [far, 0.4, 3.15], [0.6, 0.4, 0.25]);
        near.scene.update(|scene| scene.set_colliders(&[table])).unwrap();
        near.move_object("cup", Vec3::new(far, 0.8, 3.0));
        let mut rig = Harness::in_scene(
            near.scene,
            near.definitions,
            "far",
            Vec3::new(far - 1.0, 0.0, 1.5),
        );
        rig.interact("cup", "quick").unwrap();
        rig.until(400, is_done).expect("it is taken");
        rig.walk(1.0, 0.0);
        rig.run(90);
        assert!(rig.character.held().unwrap().transform.position.x > 10_000.0);
        rig.give(intent).unwrap();
        rig.run(1);
        assert_eq!(rig.words().last(), Some(&"released"), "{:?}", rig.events.last());
        let cup = rig.object("cup");
        assert!(
            cup.state == State::Free && cup.transform.position.x > 9_999.0,
            "{cup:?}"
        );
    }
}

/// A command ends the rest of an interaction at once if locomotion takes over already.
#[test]
fn events_come_in_order() {
    let length = {
        let mut rig = Harness::new();
        rig.interact("sign", "nod").unwrap();
        rig.until(500, is_done).unwrap() as usize
    };
    for stop in length - 10..length + 2 {
        let mut rig = Harness::new();
        rig.interact("sign", "nod").unwrap();
        rig.run(stop);
        let now = rig.character.frame();
        rig.interact("cup", "right").unwrap();
        rig.run(1);
        assert_eq!(rig.words().last(), Some(&"started"));
        let frames: Vec<_> = rig.event_words().into_iter().map(|(frame, _)| frame).collect();
        assert!(frames.is_sorted(), "at {stop}: {:?}", rig.event_words());
        assert!(
            frames.iter().all(|&frame| frame <= now + 1),
            "at {stop}: {:?}",
            rig.event_words()
        );
    }
}

#[test]
fn ending_an_interaction_does_not_end_its_way_out() {
    for between in [0, 1, 3, 10, 20, 30] {
        let mut rig = carrying();
        let known = rig.events.len();
        rig.give(Intent::EndInteraction).unwrap();
        rig.run(between);
        rig.give(Intent::EndInteraction).unwrap();
        rig.run(100);
        let words = &rig.words()[known..];
        assert_eq!(
            words,
            ["entered", "reached", "released", "done"],
            "after {between}"
        );
    }
}

#[test]
fn the_end_of_a_path_is_an_event() {
    let mut rig = with_cup();
    rig.follow(0.0, -2.0, false).unwrap();
    let at = rig.until(300, |kind| matches!(kind, EventKind::Arrived { .. }));
    assert!(at.is_some_and(|frame| (90..200).contains(&frame)), "{at:?}");
    rig.run(60);
    let root = rig.frames.last().unwrap().root.with_y(0.0);
    assert!(root.length() < 0.1 && !walks(&rig), "{root}");
}

#[test]
fn a_command_replaces_a_path() {
    let mut rig = with_cup();
    rig.follow(0.0, -2.0, true).unwrap();
    rig.run(40);
    assert!(walks(&rig));
    // The command to stand. A path counts as standing too, but must end.
    rig.walk(0.0, 0.0);
    rig.run(60);
    assert!(!walks(&rig));
    let far = rig.follow(9.0, 0.0, true);
    assert_eq!(far, Ok(()), "it begins where the character is");
    rig.run(30);
    assert!(walks(&rig));
    rig.give(Intent::Cancel).unwrap();
    rig.run(60);
    assert!(!walks(&rig));
}

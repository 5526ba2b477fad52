//! Commands that come together or twice, objects that go away while they are carried, and the order of what is told.

use super::super::Intent;
use super::testing::*;
use super::tests::{is_done, with_cup};
use crate::scene::State;

/// A rig that goes about with the cup in its hand.
fn carrying() -> Rig {
    let mut rig = with_cup();
    rig.walk(-1.0, 0.0);
    rig.run(20);
    assert_eq!(rig.words().last(), Some(&"interrupted"));
    rig
}

fn walks(rig: &Rig) -> bool {
    let at = |back: usize| rig.frames[rig.frames.len() - back].root;
    at(1).distance(at(2)) > 0.01
}

#[test]
fn a_walk_does_not_swallow_what_was_asked_before_it() {
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
    // One that is broken off at once was begun.
    rig.interact("bench", "").unwrap();
    rig.walk(0.0, 1.0);
    rig.run(1);
    let words = rig.words();
    assert_eq!(words[words.len() - 2..], ["started", "interrupted"]);
}

#[test]
fn what_was_to_be_used_gives_way_to_a_newer_command() {
    let mut rig = Rig::new();
    rig.interact("cup", "right").unwrap();
    rig.interact("sign", "nod").unwrap();
    rig.run(1);
    assert_eq!(rig.words(), ["started"]);
    assert_eq!(rig.object("cup").state, State::Free);
    let mut rig = Rig::new();
    rig.interact("cup", "right").unwrap();
    rig.give(Intent::Cancel).unwrap();
    rig.run(1);
    assert!(rig.words().is_empty(), "{:?}", rig.told());
}

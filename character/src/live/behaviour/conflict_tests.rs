//! Interactions that meet something else: another character, a full hand, an object that moves or
//! disappears, an obstacle, a late or failed plan.

use troupe_motion::Vec3;

use super::super::{
    Activity, Character, Clock, CommandError, EventKind, FailReason, Intent, SUB_FRAMES, Start,
};
use super::testing::*;
use super::tests::{SMOOTH, STEP, is_done, reached, with_cup};
use crate::primitives::LocomotionCommand;
use crate::scene::{Holder, State, Transform};

#[test]
fn one_of_two_characters_gets_a_cup() {
    let mut first = Harness::new();
    let scene = std::sync::Arc::clone(&first.scene);
    let definitions = std::sync::Arc::clone(&first.definitions);
    let mut second = Harness::in_scene(scene, definitions, "b", Vec3::new(1.0, 0.0, 0.0));
    // Both commands are accepted; one character is first.
    first.interact("cup", "right").unwrap();
    second.interact("cup", "right").unwrap();
    first.run(1);
    second.run(1);
    assert_eq!(first.words(), ["started"]);
    assert!(
        matches!(
            &second.events[0].kind,
            EventKind::Failed {
                reason: FailReason::Taken,
                ..
            }
        ),
        "{:?}",
        second.events
    );
    let refused = second.interact("cup", "right").unwrap_err();
    assert_eq!(
        refused.to_string(),
        "object \"cup\" is reserved or held by session \"a\""
    );
    // Once free, the cup may be taken again.
    first.give(Intent::Cancel).unwrap();
    first.run(1);
    second.interact("cup", "right").unwrap();
    second.run(1);
    assert_eq!(second.words().last(), Some(&"started"));
    // It is free, too, once its holder has left.
    second.character.leave();
    assert_eq!(first.object("cup").state, State::Free);
}

#[test]
fn commands_that_cannot_be_carried_out_are_refused() {
    let mut rig = Harness::new();
    let refusal =
        |rig: &mut Harness, instance: &str, variant: &str| rig.interact(instance, variant).unwrap_err();
    assert!(matches!(
        refusal(&mut rig, "chair", ""),
        CommandError::UnknownObject { .. }
    ));
    assert!(matches!(
        refusal(&mut rig, "cup", "left"),
        CommandError::UnknownVariant { .. }
    ));
    let wall = block("wall", [0.0, 1.0, 1.5], [2.0, 1.0, 0.1]);
    let table = block("table", [0.0, 0.4, 3.15], [0.6, 0.4, 0.25]);
    rig.scene
        .update(|scene| scene.set_colliders(&[table, wall]))
        .unwrap();
    let blocked = refusal(&mut rig, "cup", "right");
    assert_eq!(
        blocked.to_string(),
        "the way to object \"cup\" is blocked by collider \"wall\""
    );
    // A refused number is free: the next command may have it.
    let again = rig.character.give(1, None, Intent::Cancel);
    assert!(again.is_ok());
    let mut nowhere = Character::new(
        doll_rig(),
        options(),
        Start::Standing(troupe_motion::GlobalRoot::new(Vec3::ZERO, 0.0)),
        LocomotionCommand::standing(&doll_style()),
    );
    let interact = Intent::Interact {
        instance: "cup".into(),
        variant: None,
        approach: None,
    };
    assert_eq!(nowhere.give(1, None, interact), Err(CommandError::NoScene));
    nowhere.give(1, None, Intent::EndInteraction).unwrap();
    nowhere.advance(SUB_FRAMES, Clock::Waits);
}

#[test]
fn a_full_hand_takes_no_other_object() {
    let mut rig = with_cup();
    rig.scene
        .update(|scene| {
            let body = std::sync::Arc::clone(&scene.instance("cup").unwrap().body);
            scene.add(
                "other",
                "cup",
                body,
                Transform::new(Vec3::new(0.3, 0.8, 3.0), Default::default()),
            )
        })
        .unwrap();
    let refused = rig.interact("other", "right").unwrap_err();
    assert_eq!(refused, CommandError::HandFull { id: "cup".into() });
    // Nodding at a sign takes no hand.
    rig.interact("sign", "nod").unwrap();
    rig.until(600, is_done).unwrap();
    assert_eq!(rig.character.held().unwrap().instance, "cup".into());
}

#[test]
fn it_follows_an_object_that_is_moved_on_the_way() {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.run(30);
    rig.move_object("cup", Vec3::new(0.4, 0.8, 3.0));
    let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
    rig.until(300, attached).unwrap();
    let root = rig.frames.last().unwrap().root;
    let far = (root - Vec3::new(0.4, 0.9, 3.0)).with_y(0.0).length();
    assert!(far < 0.6, "{root}");
}

#[test]
fn it_follows_an_object_that_is_moved_before_its_keyframe() {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    let entered = |kind: &EventKind| matches!(kind, EventKind::Entered { .. });
    rig.until(300, entered).unwrap();
    rig.run(5);
    rig.move_object("cup", Vec3::new(0.1, 0.8, 3.0));
    let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
    rig.until(300, attached).unwrap();
    assert_eq!(rig.words()[..4], ["started", "entered", "reached", "attached"]);
    let after = reached(&rig)[0].3;
    assert!(after.joint_m < 1e-3, "{after:?}");
    let hand = rig.joints(rig.frames.len() - 1)[HAND];
    assert!((hand - Vec3::new(0.1, 0.92, 3.0)).length() < 0.12, "{hand}");
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

/// A seat that is pulled away, before or after somebody sits on it, is not followed: the
/// interaction fails, and a seated character stands up.
#[test]
fn a_seat_that_moves_away_is_not_followed() {
    let reached = {
        let mut rig = Harness::new();
        rig.interact("bench", "").unwrap();
        let sits = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "sit");
        rig.until(500, sits).unwrap() as usize
    };
    for (frames, to) in [(reached + 20, 0.1), (reached + 20, 5.0), (reached - 20, 5.0)] {
        let mut rig = Harness::new();
        rig.interact("bench", "").unwrap();
        rig.run(frames);
        let stood = rig.frames.last().unwrap().root;
        rig.move_object("bench", Vec3::new(to, 0.2, -3.0));
        rig.run(90);
        let failed = rig.events.iter().find_map(|event| match event.kind {
            EventKind::Failed { reason, .. } => Some(reason),
            _ => None,
        });
        assert_eq!(
            failed,
            Some(FailReason::Moved),
            "{frames}, {to}: {:?}",
            rig.words()
        );
        let root = rig.frames.last().unwrap().root;
        assert!((root.y - 0.9).abs() < 0.05, "it stands: {root}");
        assert!((root - stood).with_y(0.0).length() < 0.6, "in place: {root}");
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < SMOOTH && step < STEP,
            "{frames}, {to}: {acceleration} m/s², {step} m"
        );
    }
}

/// When a session ends, the object in its hand is put down in place.
#[test]
fn leaving_puts_down_a_carried_object() {
    let mut rig = with_cup();
    rig.walk(-1.2, 0.0);
    rig.run(60);
    let held = rig.character.held().unwrap().transform.position;
    assert!(held.x < -1.0, "it was carried: {held}");
    rig.character.leave();
    let cup = rig.object("cup");
    assert_eq!(cup.state, State::Free);
    let lies = cup.transform.position;
    assert!(
        (lies - held).with_y(0.0).length() < 0.1 && lies.y.abs() < 1e-3,
        "{lies}"
    );
}

#[test]
fn an_object_that_moves_too_late_is_missed() {
    let key = {
        let mut rig = Harness::new();
        rig.interact("cup", "right").unwrap();
        let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
        rig.until(300, attached).unwrap()
    };
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.run(key as usize - 8);
    rig.move_object("cup", Vec3::new(0.1, 0.8, 3.0));
    rig.run(40);
    assert!(
        rig.events.iter().any(|event| matches!(
            event.kind,
            EventKind::Failed {
                reason: FailReason::Moved,
                ..
            }
        )),
        "{:?}",
        rig.events
    );
    assert_eq!(rig.object("cup").state, State::Free);
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

#[test]
fn removing_the_object_ends_an_interaction_at_any_frame() {
    for frames in [5, 60, 110, 140, 170, 200] {
        let mut rig = Harness::new();
        rig.interact("cup", "right").unwrap();
        rig.run(frames);
        rig.scene.update(|scene| scene.remove("cup")).unwrap();
        rig.run(40);
        let failed = rig.events.iter().find_map(|event| match &event.kind {
            EventKind::Failed { reason, .. } => Some(*reason),
            _ => None,
        });
        assert_eq!(failed, Some(FailReason::Removed), "after {frames}");
        assert_eq!(rig.character.activity(), Activity::Locomotion);
        assert!(rig.character.held().is_none());
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < SMOOTH && step < STEP,
            "{acceleration} m/s², {step} m"
        );
    }
}

#[test]
fn an_obstacle_ends_the_approach() {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.run(6);
    let wall = block("wall", [0.0, 1.0, 1.8], [2.0, 1.0, 0.1]);
    rig.scene.update(|scene| scene.set_colliders(&[wall])).unwrap();
    let failed = |kind: &EventKind| {
        matches!(
            kind,
            EventKind::Failed {
                reason: FailReason::Blocked,
                ..
            }
        )
    };
    assert!(rig.until(20, failed).is_some(), "{:?}", rig.events);
    assert_eq!(rig.object("cup").state, State::Free);
}

#[test]
fn failed_plans_are_asked_for_three_times() {
    let mut rig = Harness::new();
    rig.plans = Plans::Never;
    rig.interact("cup", "right").unwrap();
    let failed = |kind: &EventKind| {
        matches!(
            kind,
            EventKind::Failed {
                reason: FailReason::NoPlan,
                ..
            }
        )
    };
    rig.until(300, failed).unwrap();
    let tries = rig
        .requests
        .iter()
        .filter(|request| request.pins.is_some())
        .count();
    assert_eq!(tries, 3);
    rig.run(40);
    assert_eq!(rig.object("cup").state, State::Free);
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

#[test]
fn a_pose_is_held_for_a_late_plan() {
    let run = |plans: Plans| {
        let mut rig = Harness::new();
        rig.clock = Clock::Runs;
        rig.interact("sign", "nod").unwrap();
        let nodded = |kind: &EventKind| matches!(kind, EventKind::Reached { .. });
        rig.until(500, nodded).unwrap();
        rig.plans = plans;
        rig.until(500, is_done).unwrap();
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < SMOOTH && step < STEP,
            "{acceleration} m/s², {step} m"
        );
        (rig.event_words(), rig.character.stats())
    };
    let (in_time, stats) = run(Plans::AtOnce);
    assert_eq!((stats.late_plans, stats.underruns), (0, 0));
    let (late, stats) = run(Plans::After(12));
    assert!(stats.late_plans > 0 && stats.underruns == 0, "{stats:?}");
    // The next set begins later, and its frames with it.
    let shift = late[3].0 - in_time[3].0;
    assert!(shift >= 8, "{late:?}");
    let length = late[4].0 - late[3].0;
    assert!((15..=20).contains(&length), "left up to 5 frames early: {late:?}");
}

#[test]
fn the_same_seed_gives_the_same_frames() {
    let run = |plans: Plans| {
        let mut rig = Harness::new();
        rig.plans = plans;
        rig.interact("cup", "").unwrap();
        rig.run(300);
        let frames: Vec<_> = rig.frames.iter().map(|f| (f.root, f.rotations.clone())).collect();
        (frames, rig.events.clone())
    };
    let at_once = run(Plans::AtOnce);
    assert!(at_once == run(Plans::AtOnce));
    assert!(at_once == run(Plans::After(2)));
    assert!(at_once == run(Plans::After(40)));
}

#[test]
fn variants_are_chosen_by_seed() {
    let variants = |seed: u64| {
        let mut rig = Harness::new();
        let mut options = options();
        options.seed = seed;
        let world = super::World {
            scene: std::sync::Arc::clone(&rig.scene),
            definitions: std::sync::Arc::clone(&rig.definitions),
            holder: Holder::new("s"),
            scale: 1.0,
        };
        let start = Start::Standing(troupe_motion::GlobalRoot::new(Vec3::ZERO, 0.0));
        let standing = LocomotionCommand::standing(&rig.style);
        rig.character = Character::in_world(
            std::sync::Arc::clone(&rig.rig),
            options,
            start,
            standing,
            Some(world),
        );
        for _ in 0..12 {
            rig.interact("cup", "").unwrap();
            rig.run(1);
            rig.give(Intent::Cancel).unwrap();
            rig.run(1);
        }
        let of = |event: &super::CharacterEvent| match &event.kind {
            EventKind::Started { variant, seed, .. } => Some((variant.clone(), *seed)),
            _ => None,
        };
        rig.events.iter().filter_map(of).collect::<Vec<_>>()
    };
    let one = variants(1);
    assert_eq!(one, variants(1));
    assert_ne!(one, variants(2));
    for name in ["right", "quick"] {
        assert!(
            one.iter().filter(|(variant, _)| variant == name).count() >= 2,
            "{one:?}"
        );
    }
}

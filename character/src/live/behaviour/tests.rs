//! Interactions, with plans that go straight (see [`super::testing`]).

use troupe_motion::Vec3;
use troupe_motion::rotation::angle_between;

use super::super::{Activity, Character, Clock, EventKind, FailReason, Intent, Refusal, SUB_FRAMES, Start};
use super::testing::*;
use crate::primitives::LocomotionCommand;
use crate::primitives::object::KeyframeError;
use crate::scene::{Holder, State, Transform};

/// The most that a joint of a plain walk of these plans is accelerated by, m/s², and what else may
/// come to it.
pub(super) const SMOOTH: f32 = 160.0;
/// The farthest that a joint goes in a frame, metres. Walks of these plans that turn round come to
/// 0.112: they have their full speed at once.
pub(super) const STEP: f32 = 0.12;
/// The same where a way to an object is broken off: plans to keyframes are a little faster in
/// places than walks.
const STEP_BACK: f32 = 0.13;

fn reached(rig: &Harness) -> Vec<(u64, String, KeyframeError, KeyframeError)> {
    let of = |event: &super::CharacterEvent| match &event.kind {
        EventKind::Reached {
            set, before, after, ..
        } => Some((event.frame, set.clone(), *before, *after)),
        _ => None,
    };
    rig.events.iter().filter_map(of).collect()
}

pub(super) fn is_done(kind: &EventKind) -> bool {
    matches!(kind, EventKind::Done { .. })
}

/// A rig that carries the cup, held until ended.
pub(super) fn with_cup() -> Harness {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    let lifted = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "lift");
    rig.until(400, lifted).expect("the cup is lifted");
    rig
}

#[test]
fn a_cup_is_taken_and_put_down() {
    let mut rig = with_cup();
    assert_eq!(
        rig.words(),
        ["started", "entered", "reached", "attached", "entered", "reached"]
    );
    assert_eq!(
        rig.character.activity(),
        Activity::Held {
            instance: "cup".into(),
            set: "lift".into()
        }
    );
    assert_eq!(rig.object("cup").state, State::Held(Holder::new("a")));
    for (_, set, before, after) in reached(&rig) {
        assert!(
            after.root_m < 1e-3 && after.heading < 1e-3 && after.joint_m < 1e-3,
            "{set}: {after:?}"
        );
        assert_eq!(before.joint_m > 0.02, set == "reach", "{set}: {before:?}");
    }
    rig.run(100);
    assert!(
        matches!(rig.character.activity(), Activity::Held { .. }),
        "as long as nobody ends it"
    );
    rig.give(Intent::EndInteraction).unwrap();
    let done = rig.until(100, is_done).unwrap();
    assert_eq!(rig.words()[6..], ["entered", "reached", "released", "done"]);
    assert_eq!(rig.character.activity(), Activity::Locomotion);
    assert!(rig.character.held().is_none());
    let cup = rig.object("cup");
    assert_eq!(cup.state, State::Free);
    assert!(
        (cup.transform.position.y - 0.8).abs() < 1e-3,
        "it stands on the table: {:?}",
        cup.transform
    );
    assert!(done > 0);
    rig.run(30);
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

/// However high the table is, the cup is let go where it comes to stand; what is too far below, it
/// falls.
#[test]
fn the_hand_goes_down_to_the_surface() {
    for (height, follows) in [(0.7, true), (0.8, true), (0.95, true), (0.3, false)] {
        let mut rig = with_cup();
        let table = block("table", [0.0, 0.5 * height, 3.15], [0.6, 0.5 * height, 0.25]);
        let change = |scene: &mut crate::scene::Scene| scene.set_colliders(&[table]);
        rig.scene.update(change).unwrap();
        rig.give(Intent::EndInteraction).unwrap();
        let mut held = None::<super::HeldObject>;
        while rig.object("cup").state != State::Free {
            held = rig.character.held().or(held);
            rig.run(1);
        }
        let lies = rig.object("cup").transform;
        assert!((lies.position.y - height).abs() < 1e-3, "on {height}: {lies:?}");
        let held = held.unwrap();
        let up = held.transform.rotation * Vec3::Y;
        assert_eq!(
            up.y > 0.998,
            follows,
            "on {height}: it stands at once, up is {up}"
        );
        let middle = |at: Transform| at.point(Vec3::Y * 0.06);
        let fell = middle(held.transform).distance(middle(lies));
        assert_eq!(fell < 0.02, follows, "on {height}: it fell by {fell} m");
    }
}

/// Broken off while it is put down, the cup stays in the hand and goes back to how it was held
/// without a jump.
#[test]
fn a_cup_that_is_not_put_down_after_all_stays_in_the_hand() {
    let mut rig = with_cup();
    rig.give(Intent::EndInteraction).unwrap();
    rig.until(
        60,
        |kind| matches!(kind, EventKind::Entered { set, .. } if set == "put-down"),
    )
    .unwrap();
    let shown = |rig: &Harness| {
        let at = rig.character.held().expect("it is held").transform;
        (at.point(Vec3::Y * 0.06), at.rotation)
    };
    let mut before = shown(&rig);
    while (before.1 * Vec3::Y).y < 0.9 {
        rig.run(1);
        before = shown(&rig);
    }
    rig.walk(0.0, -1.2);
    for frame in 0..40 {
        rig.run(1);
        let now = shown(&rig);
        let turned = angle_between(before.1, now.1);
        assert!(
            now.0.distance(before.0) < 0.1 && turned < 0.35,
            "{frame}: {turned}"
        );
        before = now;
    }
}

#[test]
fn a_hard_keyframe_is_met_at_its_frame() {
    let mut rig = with_cup();
    let asked = rig
        .requests
        .iter()
        .find(|request| request.pins.is_some())
        .unwrap();
    let key = asked.pins.as_ref().unwrap().keys[0].clone();
    let frame = reached(&rig)[0].0 as usize;
    let shown = &rig.frames[frame - 1];
    assert_eq!(shown.frame, frame as u64);
    assert!(shown.root.distance(key.root) < 1e-3);
    for (a, b) in shown.rotations.iter().zip(&key.rotations) {
        assert!(angle_between(*a, *b) < 1e-3);
    }
    // The hand is at the cup: 12 cm above its foot, 6 cm before it, from the side that it comes
    // from.
    let hand = rig.joints(frame - 1)[HAND];
    assert!(hand.distance(Vec3::new(0.05, 0.92, 2.94)) < 1e-3, "{hand}");
    rig.run(1);
}

#[test]
fn a_soft_set_is_left_early_and_a_hard_one_held() {
    let mut rig = Harness::new();
    rig.interact("sign", "nod").unwrap();
    rig.until(500, is_done).unwrap();
    let told = rig.told();
    let at = |nth: usize| told[nth].0;
    assert_eq!(
        rig.words(),
        [
            "started", "entered", "reached", "entered", "reached", "entered", "reached", "done"
        ]
    );
    assert_eq!(at(3) - at(2), 6, "held for 6 frames");
    // Its motion is 20 frames long, and left 5 frames before the last.
    assert_eq!((at(4) - at(3), at(5) - at(4)), (15, 0));
    let after = reached(&rig)[1].3;
    assert!(after.joint_m > 1e-3, "it did not come to the keyframe: {after:?}");
    assert_eq!(rig.object("sign").state, State::Free, "anybody may use it");
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

#[test]
fn low_poses_are_made_without_the_networks() {
    let mut rig = Harness::new();
    rig.interact("bench", "").unwrap();
    let sits = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "sit");
    rig.until(500, sits).unwrap();
    let plans = rig
        .requests
        .iter()
        .filter(|request| request.pins.is_some())
        .count();
    assert_eq!(plans, 0, "it stopped where the turn has its keyframe");
    let index = rig.frames.len() - 1;
    let joints = rig.joints(index);
    assert!((rig.frames[index].root.y - 0.45).abs() < 1e-3);
    assert!(joints[12].z > joints[0].z + 0.2, "the feet stay in front");
    assert!((joints[12].y - 0.07).abs() < 0.01);
    rig.give(Intent::EndInteraction).unwrap();
    rig.until(100, is_done).unwrap();
    rig.run(20);
    assert!((rig.frames.last().unwrap().root.y - 0.9).abs() < 0.02);
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{acceleration} m/s², {step} m"
    );
}

#[test]
fn one_who_breaks_off_while_it_sits_stands_up_first() {
    let length = {
        let mut rig = Harness::new();
        rig.interact("bench", "").unwrap();
        let sits = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "sit");
        rig.until(500, sits).unwrap() as usize
    };
    for stop in (length - 45..length + 10).step_by(5) {
        let mut rig = Harness::new();
        rig.interact("bench", "").unwrap();
        rig.run(stop);
        rig.walk(0.0, 1.0);
        rig.run(100);
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < SMOOTH && step < STEP,
            "{stop}: {acceleration} m/s², {step} m"
        );
        let last = rig.frames.last().unwrap().root;
        assert!(
            (last.y - 0.9).abs() < 0.03 && last.z > rig.frames[stop].root.z + 0.8,
            "{stop}: {last}"
        );
    }
    // Another interaction begins when it stands.
    let mut rig = Harness::new();
    rig.interact("bench", "").unwrap();
    rig.run(length + 5);
    rig.interact("cup", "right").unwrap();
    let attached = |kind: &EventKind| matches!(kind, EventKind::Attached { .. });
    rig.until(500, attached).unwrap();
}

#[test]
fn it_can_be_interrupted_at_every_frame() {
    let length = {
        let mut rig = with_cup();
        rig.give(Intent::EndInteraction).unwrap();
        rig.until(100, is_done).unwrap() as usize
    };
    for (nth, clock) in [Clock::Waits, Clock::Runs].into_iter().enumerate() {
        for stop in (nth + 1..length).step_by(2) {
            let mut rig = Harness::new();
            rig.clock = clock;
            rig.interact("cup", "right").unwrap();
            for frame in 0..stop {
                rig.tick();
                if frame == 150 {
                    rig.give(Intent::EndInteraction).unwrap();
                }
            }
            rig.walk(0.8, -0.8);
            rig.run(60);
            let (acceleration, step) = rig.roughness(0);
            assert!(
                acceleration < SMOOTH && step < STEP_BACK,
                "interrupted at {stop}: {acceleration} m/s², {step} m"
            );
            assert_eq!(rig.character.activity(), Activity::Locomotion);
            let cup = rig.object("cup");
            match rig.character.held() {
                Some(held) => {
                    assert_eq!(
                        (&*held.instance, &cup.state),
                        ("cup", &State::Held(Holder::new("a")))
                    );
                }
                None => assert_eq!(cup.state, State::Free, "at {stop}"),
            }
            let last = rig.frames.last().unwrap().root;
            assert!(
                last.z < rig.frames[stop].root.z,
                "it goes where it was told to, at {stop}"
            );
        }
    }
}

#[test]
fn a_held_object_follows_the_hand() {
    let mut rig = with_cup();
    let there = rig.object("cup").transform;
    rig.walk(-1.0, 0.0);
    let mut before: Option<Transform> = None;
    for _ in 0..60 {
        rig.tick();
        let held = rig.character.held().unwrap();
        let hand = rig.joints(rig.frames.len() - 1)[HAND];
        assert!((held.transform.position.distance(hand) - 0.1).abs() < 1e-3);
        if let Some(before) = before {
            assert!(before.position.distance(held.transform.position) < 0.2);
        }
        before = Some(held.transform);
    }
    assert!(before.unwrap().position.x < -0.8, "it was carried");
    assert_eq!(
        rig.object("cup").transform,
        there,
        "in the scene it is where it was taken"
    );
    assert_eq!(rig.words().last(), Some(&"interrupted"));
    // Nothing is under it but the ground, 1.2 m down at most.
    rig.give(Intent::Drop).unwrap();
    rig.run(2);
    assert_eq!(rig.words().last(), Some(&"released"));
    let cup = rig.object("cup");
    assert!(cup.state == State::Free && cup.transform.position.y.abs() < 1e-3);
}

#[test]
fn what_is_carried_is_put_down_by_the_way_out() {
    let mut rig = with_cup();
    rig.walk(-1.0, 0.0);
    rig.run(20);
    rig.walk(0.0, 0.0);
    rig.run(5);
    rig.give(Intent::EndInteraction).unwrap();
    rig.until(200, is_done).unwrap();
    let words = rig.words();
    assert_eq!(
        words[words.len() - 4..],
        ["entered", "reached", "released", "done"]
    );
    assert!(rig.character.held().is_none() && rig.object("cup").state == State::Free);
}

#[test]
fn cancel_stops_and_lets_go() {
    let mut rig = with_cup();
    rig.give(Intent::Cancel).unwrap();
    rig.run(40);
    let words = rig.words();
    assert_eq!(words[words.len() - 2..], ["interrupted", "released"]);
    assert!(rig.character.held().is_none() && rig.object("cup").state == State::Free);
    let (a, b) = (&rig.frames[rig.frames.len() - 10], rig.frames.last().unwrap());
    assert!(a.root.distance(b.root) < 0.02, "it stands");
}

#[test]
fn two_want_one_cup() {
    let mut first = Harness::new();
    let scene = std::sync::Arc::clone(&first.scene);
    let definitions = std::sync::Arc::clone(&first.definitions);
    let mut second = Harness::in_scene(scene, definitions, "b", Vec3::new(1.0, 0.0, 0.0));
    // Both may be told; one is first.
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
    // What is free again may be had.
    first.give(Intent::Cancel).unwrap();
    first.run(1);
    second.interact("cup", "right").unwrap();
    second.run(1);
    assert_eq!(second.words().last(), Some(&"started"));
    // And is free when its holder is gone.
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
        Refusal::UnknownObject { .. }
    ));
    assert!(matches!(
        refusal(&mut rig, "cup", "left"),
        Refusal::UnknownVariant { .. }
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
    assert_eq!(nowhere.give(1, None, interact), Err(Refusal::NoScene));
    nowhere.give(1, None, Intent::EndInteraction).unwrap();
    nowhere.advance(SUB_FRAMES, Clock::Waits);
}

#[test]
fn a_hand_that_is_full_takes_nothing_else() {
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
    assert_eq!(refused, Refusal::HandFull { id: "cup".into() });
    // To nod at a sign takes no hand.
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

/// A seat that is pulled away, before or after somebody sits on it, is not followed: it fails, and
/// who sat stands up.
#[test]
fn a_seat_that_is_moved_away_is_not_gone_along_with() {
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
        assert!((root - stood).with_y(0.0).length() < 0.6, "where it was: {root}");
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < SMOOTH && step < STEP,
            "{frames}, {to}: {acceleration} m/s², {step} m"
        );
    }
}

/// What is in the hand of a session that ends is put down where it is.
#[test]
fn what_is_carried_is_put_down_at_the_end() {
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
fn an_object_that_is_moved_too_late_is_missed() {
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
fn an_object_that_is_taken_out_ends_it_at_any_frame() {
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
fn what_comes_in_the_way_ends_the_approach() {
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
fn plans_that_fail_are_asked_for_again_three_times() {
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
fn a_pose_is_held_for_a_plan_that_is_late() {
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
        (rig.told(), rig.character.stats())
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
fn the_same_seed_gives_the_same_frames_whenever_plans_come() {
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
fn variants_go_by_the_seed() {
    let variants = |seed: u64| {
        let mut rig = Harness::new();
        let mut options = options();
        options.seed = seed;
        let world = super::World {
            scene: std::sync::Arc::clone(&rig.scene),
            definitions: std::sync::Arc::clone(&rig.definitions),
            holder: Holder::new("s"),
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

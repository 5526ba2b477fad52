//! Interactions, with plans that go straight (see [`super::testing`]).

use troupe_motion::Vec3;
use troupe_motion::rotation::angle_between;

use super::super::{Activity, Clock, EventKind, Intent};
use super::testing::*;
use crate::primitives::object::KeyframeError;
use crate::scene::{Holder, State, Transform};

/// Largest acceleration of a joint, m/s²: that of a plain walk with these plans, and some reserve.
pub(super) const SMOOTH: f32 = 160.0;
/// Farthest that a joint moves in a frame, metres. Walks with these plans reach 0.112 when they
/// turn round, because they have their full speed at once.
pub(super) const STEP: f32 = 0.12;
/// The same if the way to an object is broken off: plans to keyframes are a little faster in
/// places.
const STEP_BACK: f32 = 0.13;

pub(super) fn reached(rig: &Harness) -> Vec<(u64, String, KeyframeError, KeyframeError)> {
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

/// A harness whose character carries the cup, held until a command ends it.
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
        "until a command ends it"
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

/// The hand follows the table's height, and lets the cup go where it comes to stand. If the table
/// is too low, the cup falls.
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

/// If putting down is broken off, the cup stays in the hand and goes back to how it was held
/// without a jump.
#[test]
fn a_cup_stays_in_the_hand_if_putting_down_breaks_off() {
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
    // The hand is at the cup: 12 cm above its foot, and 6 cm from it on the character's side.
    let hand = rig.joints(frame - 1)[HAND];
    assert!(hand.distance(Vec3::new(0.05, 0.92, 2.94)) < 1e-3, "{hand}");
    rig.run(1);
}

#[test]
fn a_soft_set_is_left_early_and_a_hard_one_held() {
    let mut rig = Harness::new();
    rig.interact("sign", "nod").unwrap();
    rig.until(500, is_done).unwrap();
    let events = rig.event_words();
    let at = |nth: usize| events[nth].0;
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
fn breaking_off_a_seat_stands_up_first() {
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
                "it goes where the command says, at {stop}"
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
        "in the scene it keeps the place that it was taken from"
    );
    assert_eq!(rig.words().last(), Some(&"interrupted"));
    // Under it is only the ground, at most 1.2 m down.
    rig.give(Intent::Drop).unwrap();
    rig.run(2);
    assert_eq!(rig.words().last(), Some(&"released"));
    let cup = rig.object("cup");
    assert!(cup.state == State::Free && cup.transform.position.y.abs() < 1e-3);
}

#[test]
fn the_way_out_puts_down_a_carried_object() {
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

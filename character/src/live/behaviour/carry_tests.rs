//! Carrying things, with plans that go straight (see [`super::testing`]).

use std::sync::Arc;

use troupe_motion::fk::joint_transform;
use troupe_motion::rotation::{angle_between, yaw};
use troupe_motion::{GlobalRoot, Vec3};

use super::super::{Clock, EventKind, Intent};
use super::testing::*;
use super::tests::{SMOOTH, STEP, is_done, with_cup};
use crate::object::{Definition, Definitions};
use crate::scene::{SceneCell, State, Transform};

/// The joints of the carrying arm.
const ARM: [usize; 3] = [4, 5, HAND];
/// Farthest that the middle of the cup may move in a frame, metres.
const CUP_STEP_M: f32 = 0.12;
/// Most that the cup may turn in a frame, radians.
const CUP_TURN: f32 = 0.35;

/// The hand relative to the root on the ground and its heading, in the newest frame shown.
fn hand(rig: &Harness) -> Transform {
    let (frame, skeleton) = (rig.frames.last().unwrap(), &rig.rig.skeleton);
    let root = GlobalRoot::of_pose(frame.root, frame.rotations[0], skeleton.left_axis);
    let (place, turn) = joint_transform(skeleton, frame.root, &frame.rotations, HAND);
    Transform::new(root.position, yaw(root.heading)).inverse() * Transform::new(place, turn)
}

fn cup(rig: &Harness) -> Transform {
    rig.character.held().expect("it is held").transform
}

/// How far the cup leans, radians.
fn lean(rig: &Harness) -> f32 {
    (cup(rig).rotation * Vec3::Y).angle_between(Vec3::Y)
}

/// Runs some frames, and returns the farthest that the middle of the held cup moves in one, metres.
/// Checks that it turns by at most [`CUP_TURN`] a frame.
fn watch(rig: &mut Harness, frames: usize) -> f32 {
    let held = |rig: &Harness| rig.character.held().map(|held| held.transform);
    let middle = |at: Transform| at.point(Vec3::Y * 0.06);
    let (mut before, mut most) = (held(rig), 0.0_f32);
    for _ in 0..frames {
        rig.tick();
        let now = held(rig);
        if let (Some(before), Some(now)) = (before, now) {
            most = most.max(middle(before).distance(middle(now)));
            let turn = angle_between(before.rotation, now.rotation);
            assert!(turn < CUP_TURN, "{turn} at {}", rig.frames.len());
        }
        before = now;
    }
    most
}

fn is_smooth(rig: &Harness, from: usize, what: &str) {
    let (acceleration, step) = rig.roughness(from);
    assert!(
        acceleration < SMOOTH && step < STEP,
        "{what}: {acceleration} m/s², {step} m"
    );
}

#[test]
fn a_taken_object_keeps_its_orientation() {
    let mut rig = Harness::new();
    rig.interact("cup", "right").unwrap();
    rig.until(300, |kind| matches!(kind, EventKind::Attached { .. }))
        .unwrap();
    assert!(lean(&rig) < 0.01, "it stood on the table");
    let in_hand = |rig: &Harness| {
        let frame = rig.frames.last().unwrap();
        let (_, turn) = joint_transform(&rig.rig.skeleton, frame.root, &frame.rotations, HAND);
        turn.conjugate() * cup(rig).rotation
    };
    let taken = in_hand(&rig);
    for _ in 0..20 {
        rig.run(1);
        assert!(angle_between(taken, in_hand(&rig)) < 2e-3);
    }
}

#[test]
fn a_cup_stays_upright_on_the_way() {
    for (x, z) in [(0.0, -1.2), (1.0, 0.0), (-0.8, -0.8), (0.0, 0.0)] {
        let mut rig = with_cup();
        rig.run(10);
        let (from, held, leaned) = (rig.frames.len(), hand(&rig), lean(&rig));
        rig.walk(x, z);
        for frame in 0..90 {
            let ahead = rig.character.peek(1);
            let far = watch(&mut rig, 1);
            let (now, tilt) = (hand(&rig), (lean(&rig) - leaned).abs().to_degrees());
            let off = now.position.distance(held.position);
            assert!(
                far < CUP_STEP_M && off < 0.03 && tilt < 25.0,
                "{frame}: {far} m, {off} m off, {tilt} degrees"
            );
            assert!(angle_between(now.rotation, held.rotation) < 0.02, "at {frame}");
            let shown = rig.frames.last().unwrap();
            // The newest plan may still put something into the hand.
            if frame > 5 {
                assert_eq!((ahead.roots[0], &ahead.rotations), (shown.root, &shown.rotations));
            }
        }
        is_smooth(&rig, from - 10, "walking off");
    }
}

/// A harness whose cup's definition has `to` instead of `from`.
fn with_cup_of(from: &str, to: &str) -> Harness {
    let rig = doll_rig();
    let known = definitions(&rig);
    assert!(CUP.contains(from));
    let cup = Definition::from_toml(&CUP.replace(from, to), &rig).unwrap();
    let all = ["sign", "bench"].map(|name| (*known.get(name).unwrap().definition).clone());
    let definitions = Arc::new(Definitions::new([cup].into_iter().chain(all)).unwrap());
    let scene = Arc::new(SceneCell::new(room(&definitions)));
    Harness::in_scene(scene, definitions, "a", Vec3::ZERO)
}

/// Plan requests show that plans start from motion without the bent arm.
#[test]
fn only_the_arm_is_bent_and_plans_do_not_see_it() {
    for swings in [false, true] {
        let mut rig = match swings {
            true => with_cup_of("blend_frames = 4", "swings = true"),
            false => Harness::new(),
        };
        rig.interact("cup", "right").unwrap();
        rig.until(
            400,
            |kind| matches!(kind, EventKind::Reached { set, .. } if set == "lift"),
        )
        .unwrap();
        let (from, asked) = (rig.frames.len(), rig.requests.len());
        rig.walk(0.8, -0.8);
        rig.run(90);
        let (mut compared, mut bent) = (0, 0.0_f32);
        for request in &rig.requests[asked..] {
            let plain = request.shape.context_rotations.chunks(16).last().unwrap();
            let root = request.shape.context_roots[3];
            let Some(shown) = rig.frames[from + 15..].iter().find(|frame| frame.root == root) else {
                continue;
            };
            compared += 1;
            for (joint, (a, b)) in plain.iter().zip(&shown.rotations).enumerate() {
                if ARM.contains(&joint) && !swings {
                    bent = bent.max(angle_between(*a, *b));
                } else {
                    assert_eq!(a, b, "joint {joint}, swings: {swings}");
                }
            }
        }
        assert!(compared >= 5, "{compared} of {:?}", rig.requests.len());
        assert_eq!(bent > 0.5, !swings, "{bent}");
    }
}

#[test]
fn a_carried_object_is_put_down_without_a_jump() {
    let mut rig = with_cup();
    rig.walk(-1.0, 0.0);
    rig.run(12);
    rig.walk(0.0, 0.0);
    rig.run(20);
    rig.give(Intent::EndInteraction).unwrap();
    let far = watch(&mut rig, 120);
    assert!(far < CUP_STEP_M, "{far} m");
    assert_eq!(rig.words().last(), Some(&"done"));
    let reached = rig.events.iter().rev().find_map(|event| match &event.kind {
        EventKind::Reached { after, .. } => Some(after.joint_m),
        _ => None,
    });
    assert!(reached.unwrap() < 1e-3, "the hand meets the keyframe");
    is_smooth(&rig, 0, "put down");
    // The arm is as it was before it carried anything.
    let (first, last) = (&rig.frames[0], rig.frames.last().unwrap());
    for joint in ARM {
        assert!(angle_between(first.rotations[joint], last.rotations[joint]) < 0.02);
    }
}

/// Even if the hand is slow, the cup turns in it only at the end of the motion.
#[test]
fn a_slow_hand_turns_an_object_only_as_it_arrives() {
    let mut rig = with_cup_of("name = \"put-down\"", "name = \"put-down\"\nframes = 40");
    rig.interact("cup", "right").unwrap();
    let lifted = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "lift");
    rig.until(400, lifted).expect("the cup is lifted");
    rig.give(Intent::EndInteraction).unwrap();
    let far = watch(&mut rig, 80);
    assert!(far < CUP_STEP_M, "{far} m");
    let events = rig.event_words();
    let (entered, done) = (events[events.len() - 4], events[events.len() - 1]);
    assert_eq!((entered.1, done.1), ("entered", "done"));
    assert!(done.0 - entered.0 >= 40);
}

/// A walk may begin in any frame of lifting or putting down. The cup then keeps the hand's place,
/// or the one in which it was carried before.
#[test]
fn a_walk_may_begin_at_any_frame() {
    for clock in [Clock::Waits, Clock::Runs] {
        for wait in (0..60).step_by(3) {
            let mut rig = Harness::new();
            rig.clock = clock;
            rig.interact("cup", "right").unwrap();
            rig.until(300, |kind| matches!(kind, EventKind::Attached { .. }))
                .unwrap();
            if wait >= 30 {
                rig.until(
                    60,
                    |kind| matches!(kind, EventKind::Reached { set, .. } if set == "lift"),
                );
                rig.walk(-0.8, 0.0);
                rig.run(10);
                rig.walk(0.0, 0.0);
                rig.run(5);
                rig.give(Intent::EndInteraction).unwrap();
                rig.until(
                    100,
                    |kind| matches!(kind, EventKind::Entered { set, .. } if set == "put-down"),
                )
                .unwrap();
            }
            let from = rig.frames.len().saturating_sub(30);
            let mut far = watch(&mut rig, wait % 30);
            rig.walk(0.8, -0.8);
            far = far.max(watch(&mut rig, 60));
            assert!(far < CUP_STEP_M, "{wait}: {far} m");
            is_smooth(&rig, from, &format!("walking off after {wait}"));
        }
    }
}

#[test]
fn an_arm_that_lets_go_swings_again() {
    for intent in [Intent::Drop, Intent::Cancel] {
        let mut rig = with_cup();
        rig.walk(-1.0, 0.0);
        rig.run(40);
        let from = rig.frames.len() - 1;
        let carried = hand(&rig);
        rig.give(intent).unwrap();
        rig.run(2);
        assert!(rig.character.held().is_none() && rig.object("cup").state == State::Free);
        assert!(
            hand(&rig).position.distance(carried.position) < 0.1,
            "not at once"
        );
        rig.run(10);
        assert!(hand(&rig).position.distance(carried.position) > 0.2);
        rig.run(30);
        is_smooth(&rig, from - 2, "let go");
    }
}

/// An interaction with another object has the arm to itself. After it, the cup is carried as
/// before.
#[test]
fn a_cup_is_carried_again_after_another_interaction() {
    let mut rig = with_cup();
    rig.walk(1.0, 0.0);
    rig.run(30);
    let carried = hand(&rig);
    rig.interact("sign", "nod").unwrap();
    let entered = |kind: &EventKind| matches!(kind, EventKind::Entered { .. });
    while !rig.events.iter().skip(7).any(|event| entered(&event.kind)) {
        let far = watch(&mut rig, 1);
        assert!(far < CUP_STEP_M && hand(&rig).position.distance(carried.position) < 0.03);
        assert!(rig.frames.len() < 900, "{:?}", rig.events);
    }
    rig.run(20);
    assert!(hand(&rig).position.distance(carried.position) > 0.2);
    rig.until(300, is_done).unwrap();
    let far = watch(&mut rig, 30);
    let now = hand(&rig);
    assert!(far < CUP_STEP_M && now.position.distance(carried.position) < 0.03);
    assert!(angle_between(now.rotation, carried.rotation) < 0.02);
    is_smooth(&rig, 0, "a nod with a cup");
}

#[test]
fn frames_do_not_depend_on_when_plans_arrive() {
    let run = |plans: Plans, variant: &str| {
        let mut rig = Harness::new();
        rig.plans = plans;
        rig.interact("cup", variant).unwrap();
        for (frames, (x, z)) in [(150, (0.0, -1.0)), (40, (0.7, 0.7)), (60, (0.0, 0.0))] {
            rig.run(frames);
            rig.walk(x, z);
        }
        rig.run(20);
        rig.give(Intent::EndInteraction).unwrap();
        rig.run(20);
        rig.walk(1.0, 0.0);
        rig.run(60);
        let frames: Vec<_> = rig.frames.iter().map(|f| (f.root, f.rotations.clone())).collect();
        (frames, rig.events.clone())
    };
    for variant in ["right", "quick"] {
        let at_once = run(Plans::AtOnce, variant);
        for plans in [Plans::AtOnce, Plans::After(2), Plans::After(4), Plans::After(40)] {
            assert!(at_once == run(plans, variant), "{variant}, {plans:?}");
        }
    }
}

/// A harness on a platform of 1.4 m that ends half a metre behind the character, with table and
/// cup.
fn on_platform() -> Harness {
    let rig = Harness::new();
    let table = block("table", [0.0, 1.8, 3.15], [0.6, 0.4, 0.25]);
    let platform = block("platform", [0.0, 0.7, 1.75], [2.0, 0.7, 2.25]);
    let change = |scene: &mut crate::scene::Scene| scene.set_colliders(&[table, platform]);
    rig.scene.update(change).unwrap();
    rig.move_object("cup", Vec3::new(0.0, 2.2, 3.0));
    let (scene, definitions) = (Arc::clone(&rig.scene), Arc::clone(&rig.definitions));
    Harness::in_scene(scene, definitions, "a", Vec3::new(0.0, 1.4, 0.0))
}

#[test]
fn a_falling_character_uses_both_arms_and_then_carries_again() {
    let mut rig = on_platform();
    rig.interact("cup", "right").unwrap();
    rig.until(
        400,
        |kind| matches!(kind, EventKind::Reached { set, .. } if set == "lift"),
    )
    .expect("the cup is lifted");
    rig.walk(0.0, -1.2);
    rig.run(20);
    let (from, carried) = (rig.frames.len(), hand(&rig));
    let fell = |kind: &EventKind| matches!(kind, EventKind::Fell { .. });
    let fell = rig.until(200, fell).expect("it falls") as usize;
    let (ordinary, _) = rig.roughness(from - 10);
    rig.run(8);
    let (acceleration, _) = rig.roughness(fell - 3);
    assert!(
        acceleration < ordinary + 9.81 + 10.0,
        "{acceleration} m/s²; a walk has {ordinary}"
    );
    rig.run(8);
    assert!(hand(&rig).position.distance(carried.position) > 0.1);
    rig.until(100, |kind| matches!(kind, EventKind::Landed { .. }))
        .expect("it lands");
    rig.run(60);
    let now = hand(&rig);
    assert!(now.position.distance(carried.position) < 0.03, "{now:?}");
    assert!(angle_between(now.rotation, carried.rotation) < 0.02);
}

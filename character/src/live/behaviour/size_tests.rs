//! Characters of other sizes in one scene, with plans that go straight (see [`super::testing`]).
//! Lengths are in metres of the scene if nothing else is said.

use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::{Quat, Vec3};

use super::super::{Activity, CharacterEvent, EventKind, FailReason, Intent};
use super::testing::*;
use crate::object::{Definition, Definitions};
use crate::scene::{Collider, Holder, Scene, SceneCell, State, Transform};

const SIZES: [f32; 4] = [0.5, 0.8, 1.0, 2.0];
const HIPS_M: f32 = 0.9;
const G_MPS2: f32 = 9.81;

/// A character of this size at `place`, in a scene with these colliders and objects, each with its
/// place.
fn character((place, scale): (Vec3, f32), colliders: &[Collider], all: Vec<Definition>, at: Vec3) -> Harness {
    let mut scene = Scene::new(0.0).unwrap();
    scene.set_colliders(colliders).unwrap();
    for object in &all {
        let there = Transform::new(at, Quat::IDENTITY);
        scene
            .add(&object.name, &object.name, Arc::clone(&object.body), there)
            .unwrap();
    }
    let definitions = Arc::new(Definitions::new(all).unwrap());
    Harness::of_size(Arc::new(SceneCell::new(scene)), definitions, "a", (place, scale))
}

fn known(name: &str) -> Definition {
    (*definitions(&doll_rig()).get(name).unwrap().definition).clone()
}

/// Joints in a frame.
fn joints(rig: &Harness, scale: f32, frame: usize) -> Vec<Vec3> {
    rig.joints(frame).into_iter().map(|place| place * scale).collect()
}

fn last(rig: &Harness, scale: f32) -> Vec<Vec3> {
    joints(rig, scale, rig.frames.len() - 1)
}

fn is_done(event: &EventKind) -> bool {
    matches!(event, EventKind::Done { .. })
}

/// A bench whose keyframe is a whole pose: hips on the seat, thighs level, feet flat on the ground.
fn chair(seat_m: f32) -> Definition {
    let mut bench = known("bench");
    let mut pose = vec![Quat::IDENTITY; doll().joint_count()];
    for leg in [10, 13] {
        pose[leg] = Quat::from_rotation_x(-FRAC_PI_2);
        pose[leg + 1] = Quat::from_rotation_x(FRAC_PI_2);
    }
    let key = &mut bench.sets[1].keyframes[0];
    (key.height_m, key.rotations) = (Some(seat_m), Some(pose));
    bench
}

/// Sits down on `seat` at (0, 0, -2), and holds that.
fn seated(seat: Definition, scale: f32) -> Harness {
    let mut rig = character((Vec3::ZERO, scale), &[], vec![seat], Vec3::new(0.0, 0.2, -2.0));
    rig.interact("bench", "sit").unwrap();
    let sits = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "sit");
    assert!(rig.until(600, sits).is_some(), "{scale}: {:?}", rig.events);
    rig.run(2);
    assert!(matches!(rig.character.activity(), Activity::Held { .. }));
    let mut reached = Vec::new();
    rig.character.reaches(&mut reached);
    assert!(reached.contains(&0), "{scale}: the hips are held: {reached:?}");
    rig
}

#[test]
fn hips_of_any_size_come_onto_the_seat() {
    for scale in SIZES {
        let mut rig = seated(known("bench"), scale);
        let shown = last(&rig, scale);
        assert!(
            shown[0].distance(Vec3::new(0.0, 0.45, -2.05)) < 0.01,
            "{scale}: {}",
            shown[0]
        );
        for foot in [12, 15] {
            assert!(
                (shown[foot].y - 0.07 * scale).abs() < 0.01 * scale,
                "{scale}: {}",
                shown[foot]
            );
        }
        rig.give(Intent::EndInteraction).unwrap();
        assert!(rig.until(200, is_done).is_some(), "{scale}: {:?}", rig.events);
        rig.run(30);
        let hips = last(&rig, scale)[0];
        assert!((hips.y - HIPS_M * scale).abs() < 0.02 * scale, "{scale}: {hips}");
    }
}

#[test]
fn legs_suit_the_height_of_the_seat() {
    let seat_m = 0.51;
    for scale in SIZES {
        let mut rig = seated(chair(seat_m), scale);
        let shown = last(&rig, scale);
        assert!(
            shown[0].distance(Vec3::new(0.0, seat_m, -2.05)) < 0.01,
            "{scale}: {}",
            shown[0]
        );
        for [hip, knee, foot] in [[10, 11, 12], [13, 14, 15]].map(|leg| leg.map(|joint| shown[joint])) {
            // A short character's feet dangle in front of a high seat; others stand on the ground.
            let want = match scale < 0.6 {
                true => hip.y - 0.42 * scale,
                false => 0.07 * scale,
            };
            assert!((foot.y - want).abs() < 0.01 * scale, "{scale}: foot at {foot}");
            assert!(
                (foot.z - hip.z - 0.44 * scale).abs() < 0.02 * scale,
                "{scale}: foot at {foot}"
            );
            let straight = hip.lerp(foot, 0.5);
            assert!(
                knee.z > straight.z + 0.05 * scale && knee.y > straight.y,
                "{scale}: knee at {knee}"
            );
        }
        rig.give(Intent::EndInteraction).unwrap();
        assert!(rig.until(200, is_done).is_some(), "{scale}: {:?}", rig.events);
        let (acceleration, step) = rig.roughness(1);
        assert!(
            acceleration < if scale < 0.6 { 150.0 } else { 90.0 } && step < 0.2,
            "{scale}: {acceleration}, {step}"
        );
    }
}

#[test]
fn a_step_is_what_legs_of_that_size_take_in_their_stride() {
    for (scale, height, goes_up) in [
        (0.5_f32, 0.14, true),
        (0.5, 0.2, false),
        (1.0, 0.14, true),
        (1.0, 0.4, false),
        (2.0, 0.14, true),
        (2.0, 0.4, true),
        (2.0, 0.7, false),
    ] {
        let kerb = block("kerb", [0.0, 0.5 * height, 5.0], [4.0, 0.5 * height, 4.0]);
        let mut rig = character((Vec3::ZERO, scale), &[kerb], Vec::new(), Vec3::ZERO);
        rig.walk(0.0, 1.2);
        rig.run(90);
        assert!(rig.events.is_empty(), "{scale}, {height} m: {:?}", rig.events);
        let hips = last(&rig, scale)[0];
        let want = HIPS_M * scale + if goes_up { height } else { 0.0 };
        let lift = rig.character.lift().root_m * scale;
        let lifted = want - HIPS_M * scale;
        assert!(
            (lift - lifted).abs() < 0.04 * scale,
            "{scale}, {height} m: {lift}"
        );
        assert!(
            hips.z > 1.4 && (hips.y - want).abs() < 0.04 * scale,
            "{scale}, {height} m: {hips}"
        );
    }
}

#[test]
fn every_size_falls_at_the_same_rate() {
    for scale in SIZES {
        for height in [1.0_f32, 2.0, 5.0] {
            let platform = block("platform", [0.0, 0.5 * height, -3.5], [4.0, 0.5 * height, 4.0]);
            let place = Vec3::new(0.0, height, 0.0);
            let mut rig = character((place, scale), &[platform], Vec::new(), Vec3::ZERO);
            rig.walk(0.0, 1.2);
            let fell = |kind: &EventKind| matches!(kind, EventKind::Fell { .. });
            let fell = rig.until(120, fell).unwrap();
            let landed = |kind: &EventKind| matches!(kind, EventKind::Landed { .. });
            let landed = rig.until(120, landed).unwrap();
            let Some(&CharacterEvent {
                kind: EventKind::Landed { height_m, speed_mps },
                ..
            }) = rig.events.last()
            else {
                panic!("{:?}", rig.events);
            };
            assert!((height_m * scale - height).abs() < 1e-3, "{scale}: {height_m}");
            let seconds = (2.0 * height / G_MPS2).sqrt();
            let took = (landed - fell) as f32;
            // Legs give way a little before they count as on the ground.
            let give_m = 0.04 * 0.86 * scale;
            let late = took - 30.0 * (2.0 * (height + give_m) / G_MPS2).sqrt();
            assert!(
                (-0.01..1.01).contains(&late),
                "{scale}, {height} m: {took} frames"
            );
            let off = speed_mps * scale - G_MPS2 * seconds;
            assert!(
                off.abs() < 0.6 * scale.max(1.0),
                "{scale}, {height} m: {speed_mps}"
            );
            // In the air the hips fall as any thing does.
            let at = |frame: u64| joints(&rig, scale, frame as usize - 1)[0].y;
            let middle = fell + (landed - fell) / 2;
            let fallen = at(fell) - at(middle);
            let s = (middle - fell) as f32 / 30.0;
            assert!(
                (fallen - 0.5 * G_MPS2 * s * s).abs() < 0.05 * scale.max(1.0),
                "{scale}, {height} m: {fallen} in {s} s"
            );
            rig.run(150);
            for frame in 0..rig.frames.len() {
                let low = [12, 15].map(|foot| rig.joints(frame)[foot].y);
                assert!(
                    low[0].min(low[1]) > 0.03,
                    "{scale}, {height} m: {low:?} in frame {frame}"
                );
            }
            assert!((last(&rig, scale)[0].y - HIPS_M * scale).abs() < 0.04 * scale);
        }
    }
}

/// Takes the cup from a table as high as suits the character, 3 m ahead.
fn with_cup(scale: f32) -> Harness {
    let mut reached = Vec::new();
    let top = 0.8 * scale;
    let table = block(
        "table",
        [0.0, 0.5 * top, 3.0 + 0.2 * scale],
        [1.0, 0.5 * top, 0.25 * scale],
    );
    let mut cup = known("cup");
    cup.release.max_drop_m = 5.0;
    let key = &mut cup.sets[0].keyframes[0];
    key.place_m = key.place_m.map(|place| place.map(|along| along * scale));
    let mut rig = character((Vec3::ZERO, scale), &[table], vec![cup], Vec3::new(0.0, top, 3.0));
    rig.interact("cup", "right").unwrap();
    for _ in 0..600 {
        rig.character.reaches(&mut reached);
        rig.tick();
        if rig.words().contains(&"attached") {
            break;
        }
    }
    assert_eq!(reached, [HAND], "{scale}: {:?}", rig.events);
    // The hand is at the place beside the cup that the definition gives: 12 cm up, 6 cm ahead.
    let hand = last(&rig, scale)[HAND];
    let want = Vec3::new(0.05, top + 0.12, 3.0 - 0.06);
    assert!(
        hand.distance(want) < 0.03 * scale.max(1.0),
        "{scale}: {hand}, not {want}"
    );
    let lifted = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "lift");
    assert!(rig.until(200, lifted).is_some(), "{scale}: {:?}", rig.events);
    rig.character.reaches(&mut reached);
    assert!(reached.is_empty(), "it lifts the cup to a place on its own body");
    rig
}

/// Where the cup was put down: in the scene, and by the event.
fn put_down(rig: &Harness, scale: f32) -> Vec3 {
    let cup = rig.object("cup");
    assert_eq!(cup.state, State::Free);
    let released = rig.events.iter().rev().find_map(|event| match &event.kind {
        EventKind::Released { transform, .. } => Some(*transform),
        _ => None,
    });
    let at = released.unwrap().position * scale;
    assert!(at.distance(cup.transform.position) < 1e-4, "{scale}: {at}");
    cup.transform.position
}

#[test]
fn a_cup_is_carried_and_put_down_where_the_hand_is() {
    for scale in SIZES {
        let mut rig = with_cup(scale);
        let held = rig.character.held().unwrap();
        assert_eq!(held.joint, HAND);
        let (cup, hand) = (held.transform.position * scale, last(&rig, scale)[HAND]);
        assert!(
            (cup.distance(hand) - 0.1).abs() < 1e-3,
            "{scale}: {cup} in {hand}"
        );
        rig.give(Intent::EndInteraction).unwrap();
        assert!(rig.until(200, is_done).is_some(), "{scale}: {:?}", rig.events);
        let placed = put_down(&rig, scale);
        assert!(
            (placed.y - 0.8 * scale).abs() < 1e-3,
            "{scale}: on the table, not at {placed}"
        );
        assert!((placed.z - 3.0).abs() < 0.3 * scale, "{scale}: {placed}");

        let mut rig = with_cup(scale);
        rig.walk(1.2, 0.0);
        rig.run(120);
        let held = rig.character.held().unwrap().transform.position * scale;
        rig.give(Intent::Drop).unwrap();
        rig.run(2);
        let placed = put_down(&rig, scale);
        assert!(placed.y.abs() < 1e-3, "{scale}: on the ground, not at {placed}");
        assert!(
            (placed - held).with_y(0.0).length() < 0.1 * scale,
            "{scale}: {placed} under {held}"
        );
    }
}

#[test]
fn what_is_out_of_reach_is_said_in_metres_of_the_scene() {
    let table = block("table", [0.0, 0.4, 3.15], [0.6, 0.4, 0.25]);
    let at = Vec3::new(0.0, 0.8, 3.0);
    let mut rig = character((Vec3::ZERO, 0.3), &[table], vec![known("cup")], at);
    rig.interact("cup", "right").unwrap();
    let failed = |kind: &EventKind| matches!(kind, EventKind::Failed { .. });
    assert!(rig.until(900, failed).is_some(), "{:?}", rig.events);
    let Some(EventKind::Failed { reason, message, .. }) = rig.events.last().map(|event| &event.kind) else {
        panic!("{:?}", rig.events);
    };
    assert_eq!(*reason, FailReason::OutOfReach);
    let short: f32 = message
        .split(" m ")
        .next()
        .unwrap()
        .rsplit(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    // Its shoulders are at 0.42 m, its arms 0.16 m long.
    assert!((0.2..0.6).contains(&short), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever happens, a character of any size has finite frames, and leaves nothing behind.
    #[test]
    fn any_size_goes_on(events in prop::collection::vec(event(), 1..30), scale in 0.3_f32..3.0) {
        let Harness { scene, definitions, .. } = Harness::new();
        let mut rig = Harness::of_size(scene, definitions, "a", (Vec3::ZERO, scale));
        for event in &events {
            carry_out(&mut rig, event);
        }
        rig.plans = Plans::AtOnce;
        rig.run(30);
        let unit = |turns: &[Quat]| turns.iter().all(|turn| turn.is_normalized());
        let sound = rig.frames.iter().all(|frame| frame.root.is_finite() && unit(&frame.rotations));
        prop_assert!(sound);
        rig.character.leave();
        prop_assert_eq!(rig.scene.snapshot().of_holder(&Holder::new("a")).count(), 0);
    }
}

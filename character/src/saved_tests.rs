use proptest::prelude::*;
use troupe_motion::rotation::angle_between;
use troupe_motion::{Quat, Vec3};

use super::*;
use crate::live::behaviour::testing::{Event, Harness, Plans, carry_out, doll_style, event};
use crate::live::{CROSSFADE_FRAMES, EventKind, Intent, LastSeen, RejoinError};
use crate::scene::Holder;

#[derive(Debug)]
struct Calm;

impl Styles for Calm {
    fn find(&self, name: &str) -> Option<Arc<Style>> {
        (name == "calm").then(doll_style)
    }
}

fn around(rig: &Harness) -> Surroundings {
    Surroundings {
        rig: rig.rig.clone(),
        styles: Arc::new(Calm),
        skills: rig.skills.clone(),
        world: Some(World {
            scene: rig.scene.clone(),
            definitions: rig.definitions.clone(),
            holder: Holder::new("a"),
            scale: rig.scale,
        }),
    }
}

/// Saves and restores the harness's character.
fn through_bytes(rig: &mut Harness) {
    let mut bytes = Vec::new();
    save(&rig.character, &mut bytes);
    rig.character = restore(&bytes, &around(rig)).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// On a clock that waits, a plan may be in flight at the end. A restored character asks for it
    /// again.
    #[test]
    fn a_restored_character_goes_on_unchanged(
        events in prop::collection::vec(event(), 1..30),
        every in 1usize..5,
    ) {
        let [mut one, mut other] = [Harness::new(), Harness::new()];
        for (nth, event) in events.iter().enumerate() {
            if matches!(event, Event::Plans(_)) {
                continue;
            }
            carry_out(&mut one, event);
            carry_out(&mut other, event);
            if nth % every == 0 && !other.awaits_plan() && !other.character.performs() {
                through_bytes(&mut other);
            }
            prop_assert_eq!(one.frames.len(), other.frames.len());
            let (a, b) = (one.frames.last(), other.frames.last());
            prop_assert_eq!(a.map(|frame| (frame.root, &frame.rotations)), b.map(|frame| (frame.root, &frame.rotations)));
        }
        prop_assert_eq!(one.events, other.events);
    }

    #[test]
    fn a_restored_character_makes_no_jump(
        events in prop::collection::vec(event(), 1..30),
        runs: bool,
    ) {
        let mut rig = Harness::new();
        rig.clock = if runs { crate::live::Clock::Runs } else { crate::live::Clock::Waits };
        for event in &events {
            carry_out(&mut rig, event);
            let before = rig.frames.len();
            rig.forget_plan();
            through_bytes(&mut rig);
            rig.run(2);
            let (_, step) = rig.roughness(before.saturating_sub(2));
            prop_assert!(step < 0.5, "{step} m in a frame");
        }
        rig.plans = Plans::AtOnce;
        rig.run(60);
    }

    #[test]
    fn damaged_bytes_are_refused(cut in 0usize..4000, flip in 0usize..4000) {
        let mut rig = Harness::new();
        rig.interact("bench", "").unwrap();
        rig.run(50);
        let mut bytes = Vec::new();
        save(&rig.character, &mut bytes);
        let around = around(&rig);
        prop_assert!(restore(&bytes[..cut.min(bytes.len() - 1)], &around).is_err());
        let mut flipped = bytes.clone();
        let at = flip % bytes.len();
        flipped[at] ^= 1 << (flip % 8);
        prop_assert!(restore(&flipped, &around).is_err());
        // Without the checksum it may be read or not, but nothing panics.
        let _ = read(&flipped[HEAD_BYTES..], &around);
    }
}

#[test]
fn a_restored_character_of_another_size_goes_on_unchanged() {
    let [mut one, mut other] = [(); 2].map(|()| {
        let Harness {
            scene, definitions, ..
        } = Harness::new();
        Harness::of_size(scene, definitions, "a", (Vec3::ZERO, 0.8))
    });
    for rig in [&mut one, &mut other] {
        rig.interact("bench", "").unwrap();
        rig.run(40);
    }
    through_bytes(&mut other);
    for rig in [&mut one, &mut other] {
        rig.run(160);
    }
    let shown = |rig: &Harness| {
        rig.frames
            .last()
            .map(|frame| (frame.root, frame.rotations.clone()))
    };
    assert_eq!(shown(&one), shown(&other));
    assert!((one.frames[199].root.y * 0.8 - 0.45).abs() < 0.01, "it sits");
}

#[test]
fn what_a_saved_character_names_must_exist() {
    let mut rig = Harness::new();
    rig.interact("bench", "").unwrap();
    rig.run(5);
    let mut bytes = vec![7; 3];
    save(&rig.character, &mut bytes);
    let bytes = &bytes[3..];
    let text = |around: &Surroundings| restore(bytes, around).unwrap_err().to_string();
    let mut nowhere = around(&rig);
    nowhere.world = None;
    assert!(
        text(&nowhere).starts_with("it does not fit"),
        "{}",
        text(&nowhere)
    );
    assert!(restore(bytes, &around(&rig)).is_ok());
    let mut old = bytes.to_vec();
    old[0] = 9;
    let error = restore(&old, &around(&rig)).unwrap_err().to_string();
    assert_eq!(error, "it was saved in format 9; allowed: format 6");
}

#[test]
fn a_restored_character_goes_on_from_what_its_client_saw() {
    for lost in [6, 8, 10, 14] {
        goes_on_from_what_was_seen(lost);
    }
}

/// The client has seen `lost` frames more than were saved.
fn goes_on_from_what_was_seen(lost: u64) {
    let mut rig = Harness::new();
    rig.walk(0.0, 1.2);
    rig.run(40);
    let mut bytes = Vec::new();
    save(&rig.character, &mut bytes);
    // A command is lost, after the client has seen its effect.
    rig.walk(1.2, 0.0);
    rig.run(lost as usize);
    let last = rig.frames.last().unwrap().clone();
    let seen = LastSeen {
        frame: last.frame,
        pose: Some((last.root, last.rotations.clone())),
    };
    rig.forget_plan();
    rig.character = restore(&bytes, &around(&rig)).unwrap();
    assert_eq!(rig.character.frame() + lost, last.frame);
    rig.character.rejoin(&seen).unwrap();
    assert_eq!(rig.character.frame(), last.frame);
    let from = rig.frames.len() - 4;
    rig.run(CROSSFADE_FRAMES + 2);
    assert_eq!(rig.frames[from + 4].frame, last.frame + 1);
    let (acceleration, step) = rig.roughness(from);
    // A pose has no velocities. At the seam they change by as much as the lost command had changed
    // them.
    assert!(
        acceleration < 100.0 && step < 0.1,
        "{lost} frames: {acceleration} m/s\u{b2}, {step} m"
    );
    // A client that has seen less does not move the character back.
    let frame = rig.character.frame();
    rig.character.rejoin(&seen).unwrap();
    assert_eq!(rig.character.frame(), frame);
    let far = |frame, root| LastSeen {
        frame,
        pose: Some((root, vec![Quat::IDENTITY; 16])),
    };
    let error = rig.character.rejoin(&far(frame + 91, Vec3::ZERO)).unwrap_err();
    assert_eq!(
        error,
        RejoinError::Frame {
            seen: frame + 91,
            frame
        }
    );
    let error = rig.character.rejoin(&far(frame + 2, Vec3::X * 30.0)).unwrap_err();
    assert!(matches!(error, RejoinError::Place { metres } if metres > 5.0));
}

#[test]
fn a_seen_pose_is_shown_exactly() {
    let mut rig = Harness::new();
    rig.run(20);
    let frame = rig.frames.last().unwrap().clone();
    let mut rotations = frame.rotations.clone();
    rotations[4] = (Quat::from_rotation_x(0.4) * rotations[4]).normalize();
    let root = frame.root + Vec3::new(0.1, 0.02, -0.2);
    let seen = LastSeen {
        frame: frame.frame + 3,
        pose: Some((root, rotations.clone())),
    };
    rig.character.rejoin(&seen).unwrap();
    let mut out = Default::default();
    rig.character.sample(&mut out);
    assert!(out.root.abs_diff_eq(root, 1e-4), "{} {root}", out.root);
    let worst = out
        .rotations
        .iter()
        .zip(&rotations)
        .map(|(a, b)| angle_between(*a, *b));
    let worst = worst.fold(0.0, f32::max);
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn a_restored_character_without_a_scene_still_lies_and_gets_up() {
    let mut rig = Harness::nowhere();
    rig.skill("lie", "").unwrap();
    rig.run(80);
    let lies = rig.character.activity();
    let nowhere = Surroundings {
        world: None,
        ..around(&rig)
    };
    let mut bytes = Vec::new();
    save(&rig.character, &mut bytes);
    rig.character = restore(&bytes, &nowhere).unwrap();
    rig.run(30);
    assert_eq!(rig.character.activity(), lies);
    rig.give(Intent::EndInteraction).unwrap();
    let done = |kind: &EventKind| matches!(kind, EventKind::Done { .. });
    assert!(rig.until(100, done).is_some(), "it gets up");
    let without = Surroundings {
        skills: Arc::default(),
        ..nowhere
    };
    let error = restore(&bytes, &without).unwrap_err().to_string();
    assert!(error.starts_with("it does not fit"), "{error}");
}

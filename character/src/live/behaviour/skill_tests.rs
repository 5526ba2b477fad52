//! Skills, with plans that go straight (see [`super::testing`]).

use troupe_motion::Vec3;

use super::super::{Activity, EventKind, Intent, PlanCause, Refusal};
use super::testing::*;
use super::tests::is_done;

fn is_held(kind: &EventKind) -> bool {
    matches!(kind, EventKind::Reached { set, .. } if set == "lie")
}

/// A harness whose character lies.
fn lying(mut rig: Harness) -> Harness {
    rig.skill("lie", "").unwrap();
    rig.until(200, is_held).expect("it lies down");
    rig
}

fn height(rig: &Harness) -> f32 {
    rig.frames.last().unwrap().root.y
}

#[test]
fn a_skill_is_done_where_the_character_stands_in_a_scene_or_none() {
    for rig in [Harness::new(), Harness::nowhere()] {
        let mut rig = lying(rig);
        assert_eq!(
            rig.words(),
            ["started", "entered", "reached", "entered", "reached"]
        );
        let EventKind::Started {
            instance,
            definition,
            variant,
            approach,
            ..
        } = &rig.events[0].kind
        else {
            panic!("{:?}", rig.events[0]);
        };
        assert_eq!(
            (&**instance, definition.as_str(), variant.as_str()),
            ("lie", "lie", "down")
        );
        assert_eq!(*approach, None);
        assert!((height(&rig) - 0.4).abs() < 1e-3, "{}", height(&rig));
        let lies = Activity::Held {
            instance: "lie".into(),
            set: "lie".into(),
        };
        rig.run(100);
        assert_eq!(rig.character.activity(), lies, "until a command ends it");
        // Each keyframe counts from where the one before it left the character.
        let root = rig.frames.last().unwrap().root;
        assert!((root.z - 0.3).abs() < 0.02 && root.x.abs() < 0.02, "{root}");
        rig.give(Intent::EndInteraction).unwrap();
        rig.until(100, is_done).expect("it gets up");
        assert_eq!(rig.words()[5..], ["entered", "reached", "done"]);
        assert!((height(&rig) - 0.9).abs() < 0.02, "{}", height(&rig));
        assert_eq!(rig.character.activity(), Activity::Locomotion);
    }
}

#[test]
fn the_networks_make_a_skill_at_any_hip_height() {
    let rig = lying(Harness::nowhere());
    let made = rig
        .requests
        .iter()
        .filter(|request| request.cause == PlanCause::Object);
    assert_eq!(made.count(), 2);
}

#[test]
fn a_lying_character_gets_up_before_it_walks() {
    for turn in 0..3 {
        let mut rig = lying(Harness::nowhere());
        match turn {
            0 => rig.walk(0.0, 1.2),
            1 => rig.follow(0.0, 3.0, false).unwrap(),
            _ => rig.give(Intent::Cancel).unwrap(),
        }
        let before = rig.frames.len();
        rig.until(100, is_done).expect("it gets up");
        assert_eq!(
            rig.words()[5..],
            ["entered", "reached", "done"],
            "nothing is broken off"
        );
        let step = |rig: &Harness, frame: usize| rig.frames[frame].root.distance(rig.frames[frame - 1].root);
        let low = (before..rig.frames.len()).filter(|&frame| rig.frames[frame].root.y < 0.6);
        assert!(low.clone().count() > 5 && low.clone().all(|frame| step(&rig, frame) < 0.05));
        rig.run(60);
        let walks = step(&rig, rig.frames.len() - 1) > 0.02;
        assert_eq!(walks, turn < 2, "command {turn}");
    }
}

#[test]
fn a_jump_is_not_broken_off_in_the_air() {
    let mut rig = Harness::new();
    rig.skill("spring", "").unwrap();
    rig.until(60, |kind| matches!(kind, EventKind::Entered { .. }))
        .unwrap();
    rig.run(6);
    rig.walk(0.0, 1.2);
    rig.until(100, is_done).expect("it lands");
    let top = rig.frames.iter().map(|frame| frame.root.y).fold(0.0, f32::max);
    assert!(top > 1.1, "it went up to {top} m");
    rig.run(40);
    let n = rig.frames.len();
    assert!(
        rig.frames[n - 1].root.distance(rig.frames[n - 2].root) > 0.02,
        "it walks then"
    );
}

#[test]
fn a_skill_waits_for_the_one_before() {
    let mut rig = lying(Harness::nowhere());
    rig.skill("spring", "").unwrap();
    rig.until(100, is_done).expect("it gets up");
    rig.until(100, is_done).expect("it springs");
    let started: Vec<_> = rig
        .words()
        .into_iter()
        .filter(|word| *word == "started")
        .collect();
    assert_eq!(started.len(), 2);
}

#[test]
fn a_walking_character_stops_for_a_skill() {
    let mut rig = Harness::nowhere();
    rig.walk(0.0, 1.2);
    rig.run(60);
    let rig = lying(rig);
    let entered = rig
        .events
        .iter()
        .find(|event| matches!(event.kind, EventKind::Entered { .. }))
        .unwrap();
    let at = entered.frame as usize;
    let speed = rig.frames[at].root.distance(rig.frames[at - 1].root) * 30.0;
    assert!(speed < 0.4, "{speed} m/s");
}

#[test]
fn unknown_skills_and_variants_are_refused() {
    let mut rig = Harness::nowhere();
    let unknown = rig.skill("fly", "").unwrap_err();
    assert_eq!(unknown.to_string(), "pack dolls has no skill \"fly\"");
    assert!(matches!(unknown, Refusal::UnknownSkill { there_are, .. } if there_are == ["lie", "spring"]));
    let unknown = rig.skill("lie", "sideways").unwrap_err();
    assert!(
        matches!(unknown, Refusal::UnknownSkillVariant { there_are, .. } if there_are == ["down", "squat"])
    );
    assert!(rig.skill("lie", "squat").is_ok());
    rig.until(100, is_done).expect("by its name it is done");
    assert_eq!(rig.words(), ["started", "entered", "reached", "done"]);
}

#[test]
fn a_skill_and_an_object_may_have_the_same_name() {
    let rig = Harness::new();
    let body = std::sync::Arc::clone(&rig.definitions.get("cup").unwrap().definition.body);
    let there = crate::scene::Transform::new(Vec3::X * 5.0, Default::default());
    rig.scene
        .update(|scene| scene.add("lie", "cup", body, there))
        .unwrap();
    let mut rig = lying(rig);
    rig.scene.update(|scene| scene.remove("lie")).unwrap();
    rig.run(5);
    assert!(matches!(rig.character.activity(), Activity::Held { .. }));
}

//! Steps and falls, with plans that go straight (see [`super::testing`]).

use std::sync::Arc;

use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::super::{Activity, Character, Clock, EventKind, PerformanceEnd, Start, Strain, World};
use super::footing::{Support, stands_on};
use super::testing::*;
use crate::primitives::LocomotionCommand;
use crate::scene::{Holder, ScaledScene, Scene, SceneError, State, Surface, Transform};

#[test]
fn an_empty_scene_on_flat_ground_changes_no_bit() {
    let script = |rig: &mut Harness| {
        for (x, z) in [(0.0, 1.2), (1.0, 0.3), (0.0, 0.0), (-0.5, -0.9)] {
            rig.walk(x, z);
            rig.run(25);
        }
        let frames: Vec<_> = rig
            .frames
            .iter()
            .map(|f| (f.frame, f.root, f.rotations.clone(), f.contacts))
            .collect();
        (frames, rig.character.view(), rig.character.peek(20).roots)
    };
    for clock in [Clock::Waits, Clock::Runs] {
        let mut with = Harness::new();
        with.clock = clock;
        let bare = Scene::new(0.0).unwrap();
        with.scene
            .update(|scene| {
                *scene = bare;
                Ok::<(), ()>(())
            })
            .unwrap();
        let mut without = Harness::new();
        without.clock = clock;
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        let standing = LocomotionCommand::standing(&without.style);
        without.character = Character::new(doll_rig(), options(), start, standing);
        assert!(script(&mut with) == script(&mut without));
    }
}

/// A harness on a platform of this height that ends half a metre ahead; lower ground is at 0.
fn on_platform(height: f32) -> Harness {
    let rig = Harness::new();
    let platform = block("platform", [0.0, 0.5 * height, -1.5], [2.0, 0.5 * height, 2.0]);
    rig.scene
        .update(|scene| {
            *scene = Scene::new(0.0)?;
            scene.set_colliders(&[platform])
        })
        .unwrap();
    let scene = Arc::clone(&rig.scene);
    let definitions = Arc::clone(&rig.definitions);
    Harness::in_scene(scene, definitions, "a", Vec3::new(0.0, height, 0.0))
}

#[test]
fn falls_end_when_the_projectile_lands() {
    for height in [0.5_f32, 1.0, 2.0] {
        for clock in [Clock::Waits, Clock::Runs] {
            let mut rig = on_platform(height);
            rig.clock = clock;
            rig.run(1);
            assert!((rig.frames[0].root.y - 0.9 - height).abs() < 1e-4);
            rig.walk(0.0, 1.2);
            let fell = rig
                .until(120, |kind| matches!(kind, EventKind::Fell { .. }))
                .unwrap();
            assert_eq!(rig.character.activity(), Activity::Falling);
            let landed = rig
                .until(120, |kind| matches!(kind, EventKind::Landed { .. }))
                .unwrap();
            let EventKind::Landed { height_m, speed_mps } = rig.events.last().unwrap().kind else {
                panic!("{:?}", rig.events);
            };
            assert!((height_m - height).abs() < 1e-3);
            let seconds = (2.0 * height / 9.81).sqrt();
            let want = fell as f32 + seconds * 30.0;
            assert!(
                (landed as f32 - want).abs() <= 1.0,
                "{height} m: {landed}, not {want}"
            );
            assert!((speed_mps - 9.81 * seconds).abs() < 0.6, "{speed_mps}");
            // Feet come to the ground and not below it, and the character walks on.
            rig.run(120);
            for index in 0..rig.frames.len() {
                let low = rig.joints(index)[12].y.min(rig.joints(index)[15].y);
                assert!(low > 0.03, "foot at {low} in frame {index}");
            }
            let (a, b) = (&rig.frames[rig.frames.len() - 30], rig.frames.last().unwrap());
            assert!(b.root.z - a.root.z > 0.8, "the command holds after it");
            assert!((b.root.y - 0.9).abs() < 0.03, "{}", b.root);
            let (_, step) = rig.roughness(0);
            assert!(step < 9.81 * seconds / 30.0 + 0.15, "{step}");
        }
    }
}

#[test]
fn a_character_with_its_feet_on_the_edge_does_not_fall() {
    // The edge comes nearer and then lies behind the root: by 0.1 m, which the feet still span, and
    // by 0.2 m.
    for (edge, falls) in [(-0.1, false), (-0.2, true)] {
        let mut rig = on_platform(1.0);
        rig.run(20);
        let platform = block("platform", [0.0, 0.5, edge - 2.0], [2.0, 0.5, 2.0]);
        rig.scene
            .update(|scene| scene.set_colliders(&[platform]))
            .unwrap();
        rig.run(60);
        assert_eq!(
            rig.words().contains(&"fell"),
            falls,
            "{edge} m: {:?}",
            rig.words()
        );
        let height = rig.frames.last().unwrap().root.y;
        assert_eq!(height > 1.8, !falls, "{edge} m: {height}");
    }
}

#[test]
fn a_character_does_not_fall_into_a_narrow_gap() {
    for (gap, falls) in [(0.1, false), (0.24, false), (0.6, true)] {
        let mut rig = on_platform(1.0);
        let before = block("before", [0.0, 0.5, -1.5], [2.0, 0.5, 2.0]);
        let behind = block("behind", [0.0, 0.5, 0.5 + gap + 2.0], [2.0, 0.5, 2.0]);
        rig.scene
            .update(|scene| scene.set_colliders(&[before, behind]))
            .unwrap();
        rig.walk(0.0, 0.8);
        rig.run(80);
        assert_eq!(rig.words().contains(&"fell"), falls, "{gap} m: {:?}", rig.words());
        if falls {
            continue;
        }
        for frame in &rig.frames {
            assert!((frame.root.y - 1.9).abs() < 0.05, "{gap} m: {}", frame.root);
        }
        assert!(rig.frames.last().unwrap().root.z > 1.2, "it is across");
    }
}

#[test]
fn a_fall_fades_in_like_a_plan() {
    for (height, speed) in [(0.5, 1.2), (1.0, 0.6), (2.0, 1.2)] {
        let mut rig = on_platform(height);
        rig.walk(0.0, speed);
        while rig.frames.last().is_none_or(|frame| frame.root.z < 0.45) {
            rig.tick();
        }
        rig.walk(speed, 0.3);
        let fell = rig
            .until(120, |kind| matches!(kind, EventKind::Fell { .. }))
            .unwrap() as usize;
        let (ordinary, _) = rig.roughness(0);
        rig.run(8);
        let (acceleration, _) = rig.roughness(fell - 3);
        // Gravity adds to it, and legs that are drawn up.
        assert!(
            acceleration < ordinary + 9.81 + 10.0,
            "{height} m: {acceleration} m/s² ; plans have {ordinary}"
        );
    }
}

#[test]
fn a_command_during_a_fall_holds_after_it() {
    let mut rig = on_platform(2.0);
    rig.walk(0.0, 1.2);
    rig.until(120, |kind| matches!(kind, EventKind::Fell { .. }))
        .unwrap();
    rig.walk(-1.2, 0.0);
    let landed = rig
        .until(60, |kind| matches!(kind, EventKind::Landed { .. }))
        .unwrap() as usize;
    let x = rig.frames[landed - 1].root.x;
    assert!(x.abs() < 0.02, "not before");
    rig.run(90);
    assert!(rig.frames.last().unwrap().root.x < -0.8);
}

#[test]
fn a_landed_character_moves_on_before_it_is_upright() {
    // Frames from the landing to 0.3 m/s over the ground, and to the end of the activity.
    let times = |moves: bool| {
        let mut rig = on_platform(2.0);
        rig.walk(0.0, 1.2);
        rig.until(120, |kind| matches!(kind, EventKind::Fell { .. }))
            .unwrap();
        if !moves {
            rig.walk(0.0, 0.0);
        }
        rig.until(60, |kind| matches!(kind, EventKind::Landed { .. }))
            .unwrap();
        let landed = rig.frames.len();
        while rig.character.activity() == Activity::Falling {
            rig.tick();
        }
        let over = rig.frames.len() - landed;
        rig.run(45);
        let (acceleration, _) = rig.roughness(landed + 12);
        assert!(acceleration < 60.0, "moves: {moves}: {acceleration} m/s²");
        let last = rig.frames.last().unwrap().root;
        assert!((last.y - 0.9).abs() < 0.03, "upright in the end: {last}");
        over
    };
    let (moves, stands) = (times(true), times(false));
    assert!(moves + 8 <= stands, "{moves} frames, {stands} to stand");
    assert!(moves >= 8, "not before the hips are up: {moves}");
}

#[test]
fn a_character_falls_if_its_ground_is_taken_away() {
    let mut rig = on_platform(1.0);
    rig.run(40);
    rig.scene.update(|scene| scene.set_colliders(&[])).unwrap();
    rig.run(90);
    assert_eq!(rig.words(), ["fell", "landed"]);
    let root = rig.frames.last().unwrap().root;
    assert!((root - Vec3::new(0.0, 0.9, 0.0)).length() < 0.03, "{root}");
}

#[test]
fn a_fall_fails_an_approach() {
    let mut rig = on_platform(1.0);
    let cup = rig.definitions.get("cup").unwrap().definition;
    rig.scene
        .update(|scene| {
            let at = Transform::new(Vec3::new(0.0, 0.3, 4.0), Quat::IDENTITY);
            scene.add("cup", "cup", Arc::clone(&cup.body), at)
        })
        .unwrap();
    rig.interact("cup", "right").unwrap();
    rig.until(150, |kind| matches!(kind, EventKind::Landed { .. }))
        .unwrap();
    assert_eq!(rig.words(), ["started", "failed", "fell", "landed"]);
    assert_eq!(rig.object("cup").state, State::Free);
}

/// A harness that has walked for three seconds at 1 m/s over a step up or down, 1 m ahead.
fn over_step(height: f32) -> Harness {
    let rig = Harness::new();
    let (ground, top) = (height.min(0.0), height.max(0.0));
    let upper = block(
        "upper",
        [0.0, 0.5 * (ground + top), if height > 0.0 { 3.0 } else { -1.0 }],
        [2.0, 0.5 * (top - ground), 2.0],
    );
    rig.scene
        .update(|scene| {
            *scene = Scene::new(ground)?;
            scene.set_colliders(&[upper])
        })
        .unwrap();
    let scene = Arc::clone(&rig.scene);
    let definitions = Arc::clone(&rig.definitions);
    let mut rig = Harness::in_scene(scene, definitions, "a", Vec3::ZERO);
    rig.walk(0.0, 1.0);
    rig.run(90);
    rig
}

#[test]
fn steps_are_taken_in_stride() {
    for height in [0.15_f32, 0.3, -0.15, -0.3] {
        let rig = over_step(height);
        assert!(rig.events.is_empty(), "{height} m: {:?}", rig.events);
        let last = rig.frames.last().unwrap().root;
        assert!(
            last.z > 1.5 && (last.y - 0.9 - height).abs() < 0.05,
            "{height} m: {last}"
        );
        let (_, step) = rig.roughness(0);
        assert!(step < 0.2, "{height} m: {step}");
    }
}

#[test]
fn more_than_a_step_is_a_wall_or_a_fall() {
    let rig = over_step(0.35);
    assert!(rig.events.is_empty(), "{:?}", rig.events);
    let high = rig.frames.iter().map(|frame| frame.root.y).fold(0.0, f32::max);
    assert!(high < 0.92, "not stepped onto: {high}");
    assert_eq!(over_step(-0.35).words(), ["fell", "landed"]);
}

#[test]
fn a_wall_is_not_stepped_onto() {
    let mut rig = Harness::new();
    let wall = block("wall", [0.0, 1.0, 1.5], [2.0, 1.0, 0.2]);
    rig.scene
        .update(|scene| {
            *scene = Scene::new(0.0)?;
            scene.set_colliders(&[wall])
        })
        .unwrap();
    rig.walk(0.0, 1.0);
    rig.run(90);
    assert!(rig.events.is_empty());
    for frame in &rig.frames {
        assert!((frame.root.y - 0.9).abs() < 0.05, "{}", frame.root);
    }
    let hit = rig
        .scene
        .snapshot()
        .support(Vec3::new(0.0, 3.0, 1.5), 5.0, None)
        .unwrap();
    assert_eq!(hit.surface, Surface::Collider("wall".into()));
}

/// A harness on a platform of 3 m that ends half a metre ahead, and a higher block this far beyond
/// its edge.
fn before_a_wall(gap: f32) -> Harness {
    let rig = on_platform(3.0);
    let platform = block("platform", [0.0, 1.5, -1.5], [2.0, 1.5, 2.0]);
    let wall = block("wall", [0.0, 3.0, 0.5 + gap + 2.0], [2.0, 3.0, 2.0]);
    rig.scene
        .update(|scene| scene.set_colliders(&[platform, wall]))
        .unwrap();
    rig
}

#[test]
fn a_fall_against_a_wall_ends_in_front_of_it() {
    for gap in [0.4, 0.7, 1.5] {
        for speed in [1.2, 3.0] {
            let mut rig = before_a_wall(gap);
            rig.walk(0.0, speed);
            let fell = rig
                .until(120, |kind| matches!(kind, EventKind::Fell { .. }))
                .unwrap() as usize;
            rig.walk(0.0, 0.0);
            rig.run(90);
            // `bounded` events do not matter here: the command is faster than the style.
            let mut words = rig.words();
            words.retain(|word| *word != "bounded");
            assert_eq!(words, ["fell", "landed"], "{gap} m, {speed} m/s");
            let EventKind::Landed { height_m, speed_mps } = rig.events.last().unwrap().kind else {
                panic!("{:?}", rig.events);
            };
            assert!((height_m - 3.0).abs() < 1e-3, "{height_m} m");
            let impact = (2.0 * 9.81 * 3.0_f32).sqrt();
            assert!((speed_mps - impact).abs() < 0.6, "{speed_mps} m/s");
            let far = rig.frames.iter().map(|frame| frame.root.z).fold(0.0, f32::max);
            assert!(far < 0.5 + gap - 0.2, "{gap} m, {speed} m/s: hips at {far}");
            let last = rig.frames.last().unwrap().root;
            assert!((last.y - 0.9).abs() < 0.03, "{last}");
            // The wall brakes the character, so the landing is harder.
            let (acceleration, step) = rig.roughness(fell - 3);
            assert!(step < impact / 30.0 + 0.15, "{step}");
            assert!(acceleration < 150.0, "{gap} m, {speed} m/s: {acceleration} m/s²");
        }
    }
}

#[test]
fn a_fall_ends_on_a_slope() {
    let rig = Harness::new();
    let platform = block("platform", [0.0, 0.5, -1.5], [2.0, 0.5, 2.0]);
    let mut slope = block("slope", [0.0, -0.5, 2.0], [2.0, 0.5, 4.0]);
    slope.transform.rotation = Quat::from_rotation_x(0.3);
    rig.scene
        .update(|scene| {
            *scene = Scene::new(-5.0)?;
            scene.set_colliders(&[platform, slope])
        })
        .unwrap();
    let (scene, definitions) = (Arc::clone(&rig.scene), Arc::clone(&rig.definitions));
    let mut rig = Harness::in_scene(scene, definitions, "a", Vec3::Y);
    rig.walk(0.0, 2.0);
    rig.until(120, |kind| matches!(kind, EventKind::Fell { .. }))
        .unwrap();
    rig.walk(0.0, 0.0);
    rig.run(90);
    let root = rig.frames.last().unwrap().root;
    let below = rig.scene.snapshot().support(root, 5.0, None).unwrap();
    assert_eq!(below.surface, Surface::Collider("slope".into()));
    assert!(
        (root.y - 0.9 - below.point.y).abs() < 0.15,
        "{root} over {below:?}"
    );
}

#[test]
fn slow_networks_do_not_start_from_a_seat() {
    // Late plans: when the next one takes over, the character is sitting down.
    let sitting_down = || {
        let mut rig = Harness::new();
        rig.clock = Clock::Runs;
        rig.plans = Plans::After(10);
        rig.character.under_load(Strain {
            expected_frames: 10,
            lead_frames: 10,
            stretch: 0.0,
        });
        rig.interact("bench", "sit").unwrap();
        rig
    };
    let sits = |kind: &EventKind| matches!(kind, EventKind::Reached { set, .. } if set == "sit");
    let length = sitting_down().until(900, sits).unwrap() as usize;
    for stop in length - 40..length + 5 {
        let mut rig = sitting_down();
        rig.run(stop);
        let asked = rig.requests.len();
        rig.walk(0.0, 1.0);
        rig.run(90);
        for request in &rig.requests[asked..] {
            let low = request.shape.context_roots[3].y;
            assert!(
                low >= troupe_motion::stance::LOW_HIPS_M,
                "stopped at {stop} of {length}: hips at {low}"
            );
        }
        let last = rig.frames.last().unwrap().root;
        assert!((last.y - 0.9).abs() < 0.03, "{stop}: {last}");
    }
}

#[test]
fn a_bottomless_pit_starts_no_fall() {
    // Falls last 20 s at most.
    for (deep, falls) in [(1900.0, true), (2500.0, false)] {
        let rig = on_platform(1.0);
        rig.scene
            .update(|scene| {
                scene.become_scene(Scene::new(-deep)?);
                Ok::<(), SceneError>(())
            })
            .unwrap();
        let below = stands_on(&ScaledScene::new(rig.scene.snapshot(), 1.0), Vec3::ZERO, 1.0);
        let want = Support::Below(falls.then_some(-deep));
        assert_eq!(below, want);
        let mut rig = rig;
        rig.run(5);
        assert_eq!(rig.words().contains(&"fell"), falls, "{deep} m");
        assert_eq!(rig.frames.last().unwrap().root.y > 1.8, !falls, "{deep} m");
    }
}

#[test]
fn a_character_that_starts_inside_something_stands_on_its_feet() {
    let tower = block("tower", [0.0, 5.0, 0.0], [5.0, 5.0, 5.0]);
    let rig = Harness::new();
    rig.scene.update(|scene| scene.set_colliders(&[tower])).unwrap();
    let standing = LocomotionCommand::standing(&rig.style);
    let pose = &standing.style.idle().rotations;
    let start = Start::Context {
        roots: [Vec3::new(0.0, 0.9, 0.0); 4],
        rotations: pose.repeat(4),
    };
    let world = World {
        scene: Arc::clone(&rig.scene),
        definitions: Arc::clone(&rig.definitions),
        holder: Holder::new("b"),
        scale: 1.0,
    };
    let mut character = Character::in_world(doll_rig(), options(), start, standing, Some(world));
    assert!((character.view().root.position.y - 0.9).abs() < 1e-5);
    let request = character.take_request().unwrap();
    let hips = request.shape.context_roots[3].y;
    assert!((hips - 0.9).abs() < 1e-5, "the networks see hips at {hips}");
}

#[test]
fn a_fall_ends_a_performance() {
    for clock in [Clock::Waits, Clock::Runs] {
        let mut rig = on_platform(1.0);
        rig.clock = clock;
        rig.perform("walk ahead");
        rig.run(150);
        assert_eq!(rig.words(), ["performing", "performed", "fell", "landed"]);
        let end = rig.events.iter().find_map(|event| match &event.kind {
            EventKind::Performed { end, .. } => Some(end.clone()),
            _ => None,
        });
        assert_eq!(end, Some(PerformanceEnd::Interrupted));
        assert_eq!(rig.character.activity(), Activity::Locomotion);
    }
}

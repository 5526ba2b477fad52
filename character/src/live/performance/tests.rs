//! Performances of a doll whose frames go straight ahead (see [`crate::live::behaviour::testing`]).

use std::sync::Arc;

use proptest::prelude::*;
use troupe_motion::fk::joint_transform;
use troupe_motion::model::Motion;
use troupe_motion::rotation::six_d;
use troupe_motion::{Quat, Vec3};

use super::*;
use crate::live::behaviour::testing::*;
use crate::live::{Activity, CharacterEvent, Clock, EventKind, FrameOut, Intent, SUB_FRAMES};
use crate::testing::{rig_of, toy_rig};

fn walking() -> Harness {
    let mut rig = Harness::new();
    rig.walk(0.0, 1.2);
    rig.run(40);
    rig
}

fn ends(rig: &Harness) -> Vec<PerformanceEnd> {
    let end = |event: &CharacterEvent| match &event.kind {
        EventKind::Performed { end, .. } => Some(end.clone()),
        _ => None,
    };
    rig.events.iter().filter_map(end).collect()
}

fn speed(rig: &Harness) -> f32 {
    rig.character.view().speed_mps
}

fn began(kind: &EventKind) -> bool {
    matches!(kind, EventKind::Performing { .. })
}

fn ended(kind: &EventKind) -> bool {
    matches!(kind, EventKind::Performed { .. })
}

#[test]
fn a_performance_takes_over_and_locomotion_resumes_after_it() {
    for clock in [Clock::Waits, Clock::Runs] {
        let mut rig = walking();
        rig.clock = clock;
        rig.perform("go slowly");
        let from = rig.character.frame();
        let start = rig.until(20, began).unwrap();
        assert!((from + 4..=from + 6).contains(&start), "{start}, asked at {from}");
        assert_eq!(
            rig.character.activity(),
            Activity::Performing {
                text: "go slowly".into()
            }
        );
        rig.run(30);
        // At the speed of the frames: 0.02 m each.
        assert!((speed(&rig) - 0.6).abs() < 0.02, "{} m/s", speed(&rig));
        let end = rig.until(120, ended).unwrap();
        assert_eq!(
            end - start,
            90 - 8,
            "locomotion takes over within the last frames"
        );
        assert_eq!(ends(&rig), [PerformanceEnd::Done]);
        assert_eq!(rig.character.activity(), Activity::Locomotion);
        rig.run(40);
        assert!(speed(&rig) > 1.0, "it walks on, at {} m/s", speed(&rig));
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < 100.0 && step < 0.12,
            "{acceleration} m/s², {step} m"
        );
        let request = &rig.words_requests[0];
        assert_eq!(
            (request.number, request.past.len(), request.splice_in_frames),
            (2, 16, 4)
        );
        let last = request.past[15].global_root.unwrap();
        assert!(
            last[0].abs() < 1e-5 && last[2].abs() < 1e-5 && last[3] > 0.9999,
            "{last:?}"
        );
    }
}

#[test]
fn on_a_running_clock_a_performance_begins_when_its_frames_will_last() {
    let mut rig = walking();
    rig.clock = Clock::Runs;
    rig.words_come = Words {
        frames: 200,
        part: 16,
        first: 20,
        every: 10,
        fails_after: None,
    };
    rig.perform("go slowly");
    rig.run(20);
    assert!(!rig.words().contains(&"performing") && speed(&rig) > 1.0);
    let start = rig.until(100, began).unwrap();
    // The first part would have been used up before the next arrived.
    assert!(start > 40 + 30, "{start}");
    rig.until(300, ended).unwrap();
    assert_eq!(ends(&rig), [PerformanceEnd::Done]);
    assert_eq!(rig.character.stats().underruns, 0);
    let (acceleration, step) = rig.roughness(0);
    assert!(
        acceleration < 100.0 && step < 0.12,
        "{acceleration} m/s², {step} m"
    );
}

#[test]
fn a_late_performance_gives_way_to_locomotion_in_time() {
    let mut rig = walking();
    rig.clock = Clock::Runs;
    rig.words_come = Words {
        frames: 200,
        part: 64,
        first: 0,
        every: 500,
        fails_after: None,
    };
    rig.perform("go slowly");
    let start = rig.until(20, began).unwrap();
    let end = rig.until(100, ended).unwrap();
    assert_eq!((end - start, ends(&rig)), (64 - 12, vec![PerformanceEnd::Late]));
    rig.run(60);
    assert_eq!(rig.character.stats().underruns, 0);
    assert!(speed(&rig) > 1.0, "{} m/s", speed(&rig));
    assert!(
        !rig.character.wants_words(2),
        "frames that arrive now are of no use"
    );
    rig.character.words_arrived(2, WordsPart::default(), true);
    // A performance does not wait forever.
    rig.words_come.first = 10_000;
    rig.perform("go slowly");
    let asked = rig.character.frame();
    assert_eq!(rig.until(400, ended).map(|end| end - asked), Some(301));
    assert_eq!(rig.character.stats().underruns, 0);
}

#[test]
fn every_command_that_moves_the_character_ends_a_performance() {
    let standing =
        |rig: &Harness| Intent::Locomote(crate::primitives::LocomotionCommand::standing(&rig.style));
    for way in 0..4 {
        let mut rig = walking();
        rig.perform("go slowly");
        rig.until(20, began).unwrap();
        rig.run(20);
        match way {
            0 => rig.give(standing(&rig)).unwrap(),
            1 => rig.give(Intent::Cancel).unwrap(),
            2 => rig.interact("sign", "").unwrap(),
            _ => rig.perform("go again"),
        }
        rig.run(2);
        assert_eq!(ends(&rig), [PerformanceEnd::Interrupted], "way {way}");
        rig.run(60);
        match way {
            0 | 1 => assert!(speed(&rig) < 0.1, "{} m/s", speed(&rig)),
            2 => assert_ne!(rig.character.activity(), Activity::Locomotion),
            _ => assert_eq!(
                rig.character.activity(),
                Activity::Performing {
                    text: "go again".into()
                }
            ),
        }
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < 150.0 && step < 0.15,
            "way {way}: {acceleration} m/s², {step} m"
        );
    }
}

#[test]
fn dropping_and_ending_leave_a_performance_alone() {
    let mut rig = walking();
    rig.perform("go slowly");
    rig.until(20, began).unwrap();
    rig.give(Intent::Drop).unwrap();
    rig.give(Intent::EndInteraction).unwrap();
    rig.until(120, ended).unwrap();
    assert_eq!(ends(&rig), [PerformanceEnd::Done]);
}

#[test]
fn a_seated_character_stands_up_before_it_performs() {
    let mut rig = Harness::new();
    rig.interact("bench", "").unwrap();
    rig.until(
        400,
        |kind| matches!(kind, EventKind::Entered { set, .. } if set == "sit"),
    );
    rig.run(80);
    assert!(rig.character.view().root.position.y < 0.6);
    rig.perform("go slowly");
    rig.until(120, began).unwrap();
    let place = rig.frames.last().unwrap().root;
    assert!(place.y > 0.75, "{place}");
    assert!(rig.words().contains(&"interrupted"), "{:?}", rig.words());
    rig.until(120, ended).unwrap();
    assert_eq!(ends(&rig), [PerformanceEnd::Done]);
}

#[test]
fn a_failed_performance_is_an_event_and_its_frames_are_shown() {
    let failed = PerformanceEnd::Failed("the test says so".to_owned());
    for (fails_after, begins) in [(0, false), (2, true)] {
        for clock in [Clock::Waits, Clock::Runs] {
            let mut rig = walking();
            rig.clock = clock;
            rig.words_come.fails_after = Some(fails_after);
            rig.perform("go slowly");
            let end = rig.until(120, ended).unwrap();
            assert_eq!(rig.words().contains(&"performing"), begins);
            assert_eq!(ends(&rig), std::slice::from_ref(&failed));
            assert!(!begins || end > 40 + 50, "{end}");
            rig.run(40);
            assert!(speed(&rig) > 1.0);
            assert_eq!(rig.character.stats().underruns, 0);
        }
    }
}

#[test]
fn a_character_on_a_path_stands_after_its_performance() {
    let mut rig = Harness::new();
    rig.follow(0.0, 8.0, false).unwrap();
    rig.run(60);
    rig.perform("go slowly");
    rig.until(200, ended).unwrap();
    rig.run(60);
    assert_eq!(ends(&rig), [PerformanceEnd::Done]);
    assert!(speed(&rig) < 0.1, "{} m/s", speed(&rig));
}

#[test]
fn a_performance_has_a_longest_length() {
    let mut rig = walking();
    rig.words_come.frames = usize::MAX;
    rig.perform("go on");
    let start = rig.until(20, began).unwrap();
    let end = rig.until(1000, ended).unwrap();
    assert_eq!(end - start, u64::from(MAX_PERFORMANCE_FRAMES) - 8);
    let buffered = rig.character.view().buffered_frames;
    assert!(buffered <= 64, "{buffered} frames");
}

#[test]
fn the_buffer_stays_short_however_many_frames_arrive() {
    let mut rig = walking();
    rig.clock = Clock::Runs;
    rig.words_come = Words {
        frames: 900,
        part: 300,
        ..Words::default()
    };
    rig.perform("go on");
    rig.until(20, began).unwrap();
    for _ in 0..200 {
        rig.tick();
        let buffered = rig.character.view().buffered_frames;
        assert!((12..=60).contains(&buffered), "{buffered} frames");
    }
}

#[test]
fn a_performance_depends_on_seed_and_command_number() {
    let seeds = |commands: usize| {
        let mut rig = Harness::new();
        for _ in 0..commands {
            rig.perform("go slowly");
            rig.run(3);
        }
        rig.run(5);
        let seeds = rig.words_requests.iter();
        seeds
            .map(|request| (request.number, request.seed))
            .collect::<Vec<_>>()
    };
    let three = seeds(3);
    assert_eq!(three.len(), 3);
    assert!(three[0].1 != three[1].1 && three[1].1 != three[2].1);
    assert_eq!(seeds(1), three[..1]);
}

#[test]
fn restoring_a_character_ends_its_performance() {
    for run in [1, 30] {
        let mut rig = walking();
        rig.clock = Clock::Runs;
        rig.words_come.first = if run == 1 { 100 } else { 0 };
        rig.perform("go slowly");
        rig.run(run);
        let frame = rig.character.frame();
        assert!(rig.character.performs());
        rig.character.wake().unwrap();
        rig.run(60);
        assert_eq!(ends(&rig), [PerformanceEnd::Restarted]);
        assert_eq!(rig.events.last().unwrap().frame, frame);
        assert!(speed(&rig) > 1.0, "{} m/s", speed(&rig));
        assert_eq!(rig.character.activity(), Activity::Locomotion);
        let (acceleration, step) = rig.roughness(0);
        assert!(
            acceleration < 150.0 && step < 0.15,
            "{acceleration} m/s², {step} m"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Parts of any size may arrive at any time.
    #[test]
    fn a_waiting_clock_does_not_depend_on_when_parts_arrive(
        frames in 1usize..120,
        ways in prop::collection::vec((1usize..70, 0u32..30, 0u32..30), 2),
        at in 0usize..50,
        rate_hz in prop::sample::select(vec![30, 50, 60]),
        command in prop::option::of(0usize..90),
    ) {
        let shown: Vec<(Vec<FrameOut>, Vec<CharacterEvent>)> = ways.iter().map(|&(part, first, every)| {
            let mut rig = Harness::new();
            rig.sub_frames = SUB_FRAMES * 30 / rate_hz;
            rig.words_come = Words { frames, part, first, every, fails_after: None };
            rig.walk(0.3, 0.9);
            rig.run(at);
            rig.perform("go slowly");
            let command = command.unwrap_or(90);
            rig.run(command);
            rig.walk(-0.5, 0.2);
            rig.run(200 - command);
            (rig.frames, rig.events)
        }).collect();
        prop_assert_eq!(&shown[0].1, &shown[1].1);
        for (a, b) in shown[0].0.iter().zip(&shown[1].0) {
            prop_assert_eq!((a.frame, a.root, &a.rotations, a.contacts), (b.frame, b.root, &b.rotations, b.contacts));
        }
    }
}

#[test]
fn only_packs_of_the_same_joints_are_read() {
    let own = Arc::new(toy_rig());
    let words = Arc::new(toy_rig());
    let mut reader = PartReader::new(&words, &own).unwrap();
    let motion = Motion {
        root: [0.0, 0.8, 0.5, 1.0, 0.0].repeat(2),
        rotations: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0].repeat(4),
        contacts: vec![1.0, 0.0],
        ..Motion::default()
    };
    let part = reader.read(&motion).unwrap();
    assert_eq!(
        (part.frames(), part.rotations.as_slice()),
        (2, &[Quat::IDENTITY; 4][..])
    );
    assert_eq!(part.contacts, [1, 0]);
    let broken = Motion {
        root: vec![f32::NAN; 10],
        ..motion
    };
    assert!(reader.read(&broken).is_err());
    let other = PartReader::new(&doll_rig(), &own).map(drop);
    assert_eq!(other, Err(OtherSkeleton::Joints));
    let mut faster = toy_rig();
    faster.fps = 60.0;
    assert_eq!(
        PartReader::new(&words, &Arc::new(faster)).map(drop),
        Err(OtherSkeleton::Rate)
    );
    // Contacts of joints that the character does not have are dropped.
    let mut skeleton = (*own.skeleton).clone();
    skeleton.contacts = None;
    let mut bare = PartReader::new(&words, &Arc::new(rig_of("bare", skeleton))).unwrap();
    let motion = Motion {
        root: [0.0, 0.8, 0.5, 1.0, 0.0].to_vec(),
        rotations: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0].repeat(2),
        contacts: vec![1.0],
        ..Motion::default()
    };
    assert_eq!(bare.read(&motion).unwrap().contacts, [0]);
}

/// Feet that slide a little under a standing character, in parts of every size.
#[test]
fn feet_that_stand_are_held_across_parts() {
    let rig = doll_rig();
    let idle = doll_style().idle().rotations.clone();
    let world = |pose: &[Quat]| {
        let of = |joint| joint_transform(&rig.skeleton, Vec3::ZERO, pose, joint).1;
        (0..pose.len())
            .flat_map(|joint| six_d(of(joint)))
            .collect::<Vec<f32>>()
    };
    let swayed = |frame: usize| 0.012 * (frame as f32 * 0.15).sin();
    let motion = |frames: std::ops::Range<usize>| Motion {
        root: frames
            .clone()
            .flat_map(|frame| [swayed(frame), 0.9, 0.0, 1.0, 0.0])
            .collect(),
        rotations: world(&idle).repeat(frames.len()),
        contacts: vec![1.0; 2 * frames.len()],
        ..Motion::default()
    };
    let places = |parts: &[WordsPart]| -> Vec<Vec3> {
        let joints = idle.len();
        let of = |part: &WordsPart| {
            let poses = part.rotations.chunks_exact(joints);
            let foot = |(root, pose): (&Vec3, &[Quat])| joint_transform(&rig.skeleton, *root, pose, 12).0;
            part.roots.iter().zip(poses).map(foot).collect::<Vec<_>>()
        };
        parts.iter().flat_map(of).collect()
    };
    let mut reader = PartReader::new(&rig, &rig).unwrap();
    let parts: Vec<WordsPart> = [0..16, 16..48, 48..49, 49..80]
        .into_iter()
        .map(|frames| reader.read(&motion(frames)).unwrap())
        .collect();
    let held = places(&parts);
    assert_eq!(held.len(), 80);
    let slides = held
        .windows(2)
        .map(|two| two[0].distance(two[1]))
        .fold(0.0, f32::max);
    assert!(slides < 2e-4, "{slides} m a frame");
    // In the model's own frames they slide by up to 1.8 mm a frame.
    let made = places(&[PartReader::new(&rig, &rig)
        .unwrap()
        .read(&Motion {
            contacts: vec![0.0; 160],
            ..motion(0..80)
        })
        .unwrap()]);
    let slid = made
        .windows(2)
        .map(|two| two[0].distance(two[1]))
        .fold(0.0, f32::max);
    assert!(slid > 1.5e-3, "{slid} m a frame");
}

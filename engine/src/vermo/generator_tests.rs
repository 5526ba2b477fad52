use std::collections::BTreeMap;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::model::{
    AgentTask, Audio, DescribeTask, KeyTensors, Motion, Output, PromptTask, SamplingTask, Sound, Task,
    Telling,
};

use super::toy::{pack, toy};
use super::*;
use crate::generator::{Generator, JobId, Progress};

pub(super) fn vermo(max_jobs: usize) -> VerMo {
    let pack = pack();
    VerMo::new(&pack, Box::new(toy(&pack)), max_jobs).unwrap()
}

pub(super) fn id(request: u64) -> JobId {
    JobId {
        request,
        character: 0,
    }
}

/// The outputs of a job: its parts, and how it ended.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Given {
    parts: Vec<Output>,
    pub(super) failed: Option<String>,
    is_done: bool,
}

impl Given {
    /// All parts joined.
    fn whole(&self) -> Output {
        let mut parts = self.parts.iter().cloned();
        let mut whole = parts.next().unwrap();
        parts.for_each(|part| whole.append(part));
        whole
    }

    pub(super) fn motion(&self) -> Motion {
        assert!(self.is_done, "{:?}", self.failed);
        self.whole().into_motion().unwrap()
    }
}

pub(super) fn run(
    vermo: &mut VerMo,
    mut between: impl FnMut(&mut VerMo, usize) -> bool,
) -> BTreeMap<u64, Given> {
    let mut given: BTreeMap<u64, Given> = BTreeMap::new();
    for step in 0.. {
        if !between(vermo, step) && vermo.is_idle() {
            break;
        }
        vermo
            .step(&mut |id, progress| {
                let given = given.entry(id.request).or_default();
                assert!(!given.is_done && given.failed.is_none(), "the job has ended");
                match progress {
                    Progress::Part(part) => given.parts.push(part),
                    Progress::Done(part) => {
                        given.parts.push(part);
                        given.is_done = true;
                    }
                    Progress::Failed(error) => given.failed = Some(error.to_string()),
                }
            })
            .unwrap();
    }
    given
}

fn alone(task: impl Into<Task>) -> Given {
    let mut vermo = vermo(1);
    vermo.admit(id(0), task.into());
    run(&mut vermo, |_, _| false).remove(&0).unwrap()
}

pub(super) fn prompt(text: &str, frames: Option<usize>) -> PromptTask {
    PromptTask {
        text: text.to_owned(),
        frames,
        seed: 3,
        in_parts: true,
        ..PromptTask::default()
    }
}

/// Frames of a walk on a curve that begins at `x`.
pub(super) fn keys(codes: &[u32], x: f32) -> Vec<KeyTensors> {
    let mut frames = toy(&pack()).decoded(codes);
    frames.root.chunks_exact_mut(5).for_each(|root| root[0] += x);
    frames.keys(2).collect()
}

/// The longest distance between neighbouring frames on the ground, metres.
fn longest_step(motion: &Motion) -> f32 {
    let roots: Vec<&[f32]> = motion.root.chunks_exact(5).collect();
    let steps = roots
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][2] - pair[0][2]));
    steps.fold(0.0, f32::max)
}

#[test]
fn a_text_becomes_the_requested_number_of_frames_in_parts() {
    let given = alone(prompt("Walk!", Some(62)));
    let motion = given.motion();
    assert_eq!((motion.frames(), motion.contacts.len()), (62, 62));
    let lengths: Vec<usize> = given
        .parts
        .iter()
        .map(|part| part.clone().into_motion().unwrap().frames())
        .collect();
    assert_eq!(lengths, [16, 32, 14]);
    assert!(longest_step(&motion) < 0.09);
    // Decoded at once, the frames are the same except for rounding: windows of the toy do not
    // depend on each other.
    let whole = alone(PromptTask {
        in_parts: false,
        ..prompt("walk", Some(62))
    });
    assert_eq!(whole.parts.len(), 1);
    for (a, b) in whole.motion().root.iter().zip(&motion.root) {
        assert!((a - b).abs() < 1e-4);
    }
    assert!((8..=64).contains(&alone(prompt("walk", None)).motion().frames()));
    let other = alone(prompt("wave", Some(62)));
    assert_ne!(other.motion(), motion);
}

#[test]
fn a_motion_longer_than_a_reply_continues_without_a_jump() {
    let given = alone(prompt("walk", Some(150)));
    let motion = given.motion();
    assert_eq!(motion.frames(), 150);
    assert!(longest_step(&motion) < 0.09, "{}", longest_step(&motion));
    let shortest = alone(prompt("walk", Some(65)));
    assert_eq!(
        shortest.motion().frames(),
        65,
        "the second reply has the fewest tokens or more"
    );
}

#[test]
fn a_motion_continues_from_its_context() {
    let context = keys(&[4, 4, 4, 4, 4], 2.0);
    let last = context.last().unwrap().global_root.unwrap();
    let with_past = PromptTask {
        context: context.clone(),
        ..prompt("walk", Some(24))
    };
    let motion = alone(with_past.clone()).motion();
    let step = (motion.root[0] - last[0]).hypot(motion.root[2] - last[2]);
    assert!(step < 0.1, "{step} m from the last frame");
    // Another past gives another motion. A prompt may have no words.
    let other = PromptTask {
        context: keys(&[1, 1, 1, 1], 2.0),
        text: String::new(),
        ..with_past
    };
    assert_ne!(alone(other).motion().root[..5], motion.root[..5]);
}

#[test]
fn a_gap_is_filled_up_to_the_frames_behind_it() {
    let mut targets = keys(&[2, 2], 0.0);
    for key in &mut targets {
        let root = key.global_root.as_mut().unwrap();
        (root[0], root[2]) = (root[0] + 0.3, root[2] + 2.0);
    }
    let task = PromptTask {
        context: keys(&[4, 4, 4, 4], 0.0),
        targets: targets.clone(),
        ..prompt("", Some(32))
    };
    let given = alone(task.clone());
    let motion = given.motion();
    assert_eq!((given.parts.len(), motion.frames()), (1, 32));
    let (last, target) = (&motion.root[31 * 5..], targets[0].global_root.unwrap());
    assert!((last[0] - target[0]).hypot(last[2] - target[2]) < 0.15);
    let flow = alone(PromptTask {
        flow_steps: 3,
        ..task
    })
    .motion();
    assert_eq!(flow.frames(), 32);
}

#[test]
fn the_flow_decoder_takes_its_steps_and_gives_all_frames_at_once() {
    let task = PromptTask {
        flow_steps: 3,
        ..prompt("walk", Some(20))
    };
    let given = alone(task.clone());
    assert_eq!(given.parts.len(), 1);
    let motion = given.motion();
    assert!(
        motion
            .root
            .chunks_exact(5)
            .all(|root| (root[1] - 1.0).abs() < 1e-5),
        "the state has reached its end"
    );
    let mut vermo = vermo(4);
    for request in 0..3 {
        vermo.admit(id(request), task.clone().into());
    }
    for (_, given) in run(&mut vermo, |_, _| false) {
        assert_eq!(given.motion(), motion);
    }
}

#[test]
fn several_characters_have_a_motion_each() {
    let task = PromptTask {
        others: vec![
            AgentTask {
                text: "wave".to_owned(),
                ..AgentTask::default()
            };
            2
        ],
        ..prompt("walk", Some(24))
    };
    let given = alone(task.clone());
    let Output::Motions(motions) = given.whole() else {
        panic!("{given:?}");
    };
    assert_eq!(
        motions.iter().map(Motion::frames).collect::<Vec<_>>(),
        [24, 24, 24]
    );
    let starts: Vec<f32> = motions.iter().map(|motion| motion.root[0]).collect();
    assert_eq!(starts, [0.0, 1.0, 2.0]);
    let longer = alone(PromptTask {
        frames: Some(90),
        ..task
    });
    let Output::Motions(motions) = longer.whole() else {
        panic!("{longer:?}");
    };
    assert_eq!(
        motions.iter().map(Motion::frames).collect::<Vec<_>>(),
        [90, 90, 90]
    );
    assert!(motions.iter().all(|motion| longest_step(motion) < 0.09));
}

#[test]
fn a_motion_is_described_in_words_and_audio() {
    let task = DescribeTask {
        frames: keys(&[1, 2, 3], 0.0),
        ..DescribeTask::default()
    };
    let given = alone(Task::Describe(task.clone()));
    let Output::Text(text) = given.whole() else {
        panic!("{given:?}");
    };
    assert!(given.is_done && !text.is_empty());
    assert!(given.parts.len() > 2, "words are given one by one");
    let given = alone(Task::Describe(DescribeTask {
        into: Telling::Audio(Sound::Music),
        ..task
    }));
    let Output::Audio(codes) = given.whole() else {
        panic!("{given:?}");
    };
    assert!(!codes.is_empty() && codes.iter().all(|&code| code < 5));
}

#[test]
fn a_dance_follows_audio() {
    let task = PromptTask {
        audio: Some(Audio {
            sound: Sound::Music,
            codes: vec![0, 4, 2],
        }),
        ..prompt("", Some(16))
    };
    assert_eq!(alone(task).motion().frames(), 16);
}

/// A task of one of many kinds, chosen by the seed.
fn any_task(seed: u64) -> Task {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sampling = SamplingTask {
        temperature: rng.random_bool(0.5).then_some(0.0),
        top_k: rng.random_bool(0.5).then_some(4),
        top_p: rng.random_bool(0.5).then_some(0.9),
        repetition: rng.random_bool(0.5).then_some(1.2),
    };
    let codes: Vec<u32> = (0..rng.random_range(4..9))
        .map(|_| rng.random_range(0..9))
        .collect();
    if rng.random_bool(0.3) {
        return Task::Describe(DescribeTask {
            frames: keys(&codes, 0.0),
            seed,
            sampling,
            ..DescribeTask::default()
        });
    }
    let context = if rng.random_bool(0.5) {
        keys(&codes, 1.0)
    } else {
        Vec::new()
    };
    Task::Prompt(PromptTask {
        text: ["walk", "wave", "walk and wave"][rng.random_range(0..3)].to_owned(),
        context,
        frames: rng.random_bool(0.7).then(|| rng.random_range(5..100)),
        seed,
        sampling,
        in_parts: rng.random_bool(0.7),
        flow_steps: if rng.random_bool(0.2) { 2 } else { 0 },
        ..PromptTask::default()
    })
}

#[test]
fn jobs_that_join_and_leave_have_the_same_results_as_alone() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for mix in 0..10 {
        let mut vermo = vermo(64);
        let joining: BTreeMap<u64, usize> = (0..rng.random_range(2..40))
            .map(|_| (rng.random_range(0..80), rng.random_range(0..9)))
            .collect();
        let given = run(&mut vermo, |vermo, step| {
            for (&seed, _) in joining.iter().filter(|(_, joins)| **joins == step) {
                vermo.admit(id(seed), any_task(seed));
            }
            step < 9
        });
        assert_eq!(given.len(), joining.len());
        for (seed, given) in given {
            assert_eq!(given, alone(any_task(seed)), "mix {mix}, task {seed}");
        }
    }
}

#[test]
fn a_full_generator_says_so_and_cancelling_makes_room() {
    let mut vermo = vermo(40);
    assert_eq!(vermo.free(), 40);
    for request in 0..40 {
        vermo.admit(id(request), prompt("walk", Some(40)).into());
    }
    assert_eq!(vermo.free(), 0);
    let report = vermo.step(&mut |_, _| {}).unwrap();
    assert_eq!((report.jobs, report.rows), (40, 32), "eight wait for a slot");
    for request in 0..10 {
        vermo.cancel(id(request));
    }
    assert_eq!(vermo.free(), 10);
    let given = run(&mut vermo, |_, _| false);
    let wanted = alone(prompt("walk", Some(40)));
    assert_eq!(given.len(), 30);
    assert!(given.values().all(|given| *given == wanted));
    assert_eq!(vermo.free(), 40);
    vermo.admit(id(1), prompt("walk", None).into());
    vermo.step(&mut |_, _| {}).unwrap();
    vermo.clear();
    assert!(vermo.is_idle());
    assert_eq!(vermo.step(&mut |_, _| {}).unwrap().jobs, 0);
}

#[test]
fn a_trial_leaves_no_jobs_behind() {
    let mut vermo = vermo(40);
    vermo.warm_up().unwrap();
    assert_eq!(vermo.trial().unwrap().rows, 8);
    assert!(vermo.is_idle());
}

//! Tests of VerMo with ONNX Runtime: logits, tokens and frames equal the reference's, and have the
//! same bits alone and in a batch. They need the library (`make runtime`).
//!
//! The test of 200 random mixes takes minutes:
//! `cargo test -p troupe-engine --test vermo -- --ignored --nocapture`

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use troupe_engine::EngineKind;
use troupe_engine::families::vermo::{
    Frames, Kind, LanguageAnswer, LanguageCall, Networks, OnnxVerMo, Prompt, Rules, Said, Sampling,
    Sequences, Shape, VerMo, Vocabulary, lexicon, table,
};
use troupe_engine::generator::{Generator, JobId, Progress};
use troupe_engine::gpu::GpuShare;
use troupe_engine::onnx::{Growth, Runtime, SessionOptions};
use troupe_engine::pack::{MessageTask, Pack};
use troupe_motion::model::{
    AgentTask, Audio, DescribeTask, KeyTensors, Motion, Output, PromptTask, SamplingTask, Sound, Task,
    Telling,
};

/// The id of the token that ends a reply.
const EOS: u32 = 2;
/// The last step before which a job may join.
const LATEST: usize = 12;

#[derive(Deserialize)]
struct Reference {
    messages: Vec<Written>,
    encoder: Encoded,
    decoder: Decoded,
}

#[derive(Deserialize)]
struct Written {
    task: MessageTask,
    text: String,
    length: Option<usize>,
    agents: usize,
    prompt: Vec<u32>,
    #[serde(default)]
    logits: Vec<f32>,
    reply: Vec<u32>,
    max_tokens: usize,
}

#[derive(Deserialize)]
struct Encoded {
    pose: Vec<Vec<Vec<f32>>>,
    root: Vec<Vec<Vec<f32>>>,
    tokens: Vec<Vec<u32>>,
}

#[derive(Deserialize)]
struct Decoded {
    tokens: Vec<Vec<u32>>,
    pose: Vec<Vec<Vec<f32>>>,
    root: Vec<Vec<Vec<f32>>>,
}

fn tiny() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vermo")
}

fn reference() -> Reference {
    serde_json::from_str(&std::fs::read_to_string(tiny().join("reference.json")).unwrap()).unwrap()
}

fn networks(pack: &Pack, threads: usize) -> OnnxVerMo {
    let options = SessionOptions {
        engine: EngineKind::Cpu,
        threads,
        spin: false,
        fixed_shapes: false,
        growth: Growth::None,
        gpu: GpuShare::default(),
    };
    OnnxVerMo::load(&Runtime::new(None).unwrap(), pack, options).unwrap()
}

fn vocabulary(pack: &Pack) -> Vocabulary {
    Vocabulary::new(table(pack).unwrap(), pack.rig.dims.max_tokens)
}

fn assert_near(found: &[f32], wanted: &[f32], most: f32) {
    assert_eq!(found.len(), wanted.len());
    for (n, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= most, "number {n}: {a} is not {b}");
    }
}

fn id(request: u64) -> JobId {
    JobId {
        request,
        character: 0,
    }
}

#[test]
fn a_prompt_has_the_logits_of_the_reference() {
    let pack = Pack::load(&tiny()).unwrap();
    let mut networks = networks(&pack, 1);
    let shape = Shape::new(table(&pack).unwrap());
    let lexicon = lexicon(&pack).unwrap();
    let mut compared = 0;
    for message in &reference().messages {
        // The prompt has the text pieces that the tokenizer library makes.
        let first = vocabulary(&pack).range(Kind::Text).start;
        for text in message.text.split(" / ").filter(|text| !text.is_empty()) {
            let pieces: Vec<u32> = lexicon
                .pieces(text)
                .unwrap()
                .iter()
                .map(|id| first + id)
                .collect();
            let is_there = message
                .prompt
                .windows(pieces.len())
                .any(|window| window == pieces);
            assert!(is_there, "{text:?} is {pieces:?}, not in {:?}", message.prompt);
        }
        let tokens: Vec<i64> = message.prompt.iter().map(|&token| token.into()).collect();
        let call = LanguageCall {
            sequences: 1,
            columns: tokens.len(),
            cached: 1,
            tokens: &tokens,
            count: &[tokens.len() as i64],
            start: &[0],
            cache: &vec![0.0; shape.numbers(1)],
        };
        let mut answer = LanguageAnswer {
            logits: vec![0.0; vocabulary(&pack).len()],
            columns: vec![0.0; shape.numbers(tokens.len())],
        };
        networks.language(&call, &mut answer).unwrap();
        if !message.logits.is_empty() {
            assert_near(&answer.logits, &message.logits, 1e-4);
            compared += 1;
        }
    }
    assert_eq!(compared, 2);
}

#[test]
fn replies_equal_those_of_the_reference() {
    let pack = Pack::load(&tiny()).unwrap();
    let mut networks = networks(&pack, 1);
    let shape = Shape::new(table(&pack).unwrap());
    let messages = reference().messages;
    let mut sequences = Sequences::new(shape, vocabulary(&pack), 4);
    for (index, message) in messages.iter().enumerate() {
        let (kind, least) = match message.task {
            MessageTask::MotionToText => (Kind::Text, 1),
            MessageTask::DanceToMusic | MessageTask::GestureToSpeech => (Kind::Audio, 1),
            _ => (Kind::Motion, pack.rig.dims.min_tokens),
        };
        let prompt = Prompt {
            tokens: message.prompt.clone(),
            guides: Vec::new(),
            rules: Rules {
                kind,
                agents: message.agents,
                least: message.length.unwrap_or(least),
                most: message.length.unwrap_or(message.max_tokens),
            },
            sampling: Sampling {
                temperature: 0.0,
                top_k: 0,
                top_p: 1.0,
                repetition: 1.0,
            },
            seed: 0,
            drawn: 0,
        };
        sequences.admit(id(index as u64), prompt);
    }
    let mut replies = vec![Vec::new(); messages.len()];
    while !sequences.is_empty() {
        sequences
            .step(&mut networks, &mut |id, said| {
                replies[id.request as usize].push(match said {
                    Said::Token(token) => token,
                    Said::End => EOS,
                    Said::Failed => panic!("failed"),
                })
            })
            .unwrap();
    }
    for (mut reply, message) in replies.into_iter().zip(&messages) {
        // The reference cuts text and audio off.
        reply.truncate(message.reply.len());
        assert_eq!(reply, message.reply, "{}", message.task);
    }
}

#[test]
fn frames_are_encoded_and_decoded_as_in_the_reference() {
    let pack = Pack::load(&tiny()).unwrap();
    let mut networks = networks(&pack, 1);
    let Reference { encoder, decoder, .. } = reference();
    for (clip, tokens) in encoder.tokens.iter().enumerate() {
        let frames = Frames {
            pose: encoder.pose[clip].concat(),
            root: encoder.root[clip].concat(),
        };
        assert_eq!(networks.encode(&frames).unwrap(), *tokens);
    }
    for (clip, tokens) in decoder.tokens.iter().enumerate() {
        let frames = networks.decode(&[tokens]).unwrap().remove(0);
        assert_near(&frames.pose, &decoder.pose[clip].concat(), 1e-4);
        assert_near(&frames.root, &decoder.root[clip].concat(), 1e-4);
    }
}

/// All outputs of a job, joined.
type Given = Result<Output, String>;

/// Takes steps until all jobs are done. `between` may admit jobs before each step.
fn run(vermo: &mut VerMo, mut between: impl FnMut(&mut VerMo, usize)) -> BTreeMap<u64, Given> {
    let mut given: BTreeMap<u64, Given> = BTreeMap::new();
    for step in 0.. {
        between(vermo, step);
        if vermo.is_idle() && step >= LATEST {
            break;
        }
        vermo
            .step(&mut |id, progress| match progress {
                Progress::Part(more) | Progress::Done(more) => match given.get_mut(&id.request) {
                    Some(Ok(whole)) => whole.append(more),
                    _ => _ = given.insert(id.request, Ok(more)),
                },
                Progress::Failed(error) => _ = given.insert(id.request, Err(error.to_string())),
            })
            .unwrap();
    }
    given
}

/// Frames of random tokens.
fn keys(networks: &mut OnnxVerMo, tokens: usize, rng: &mut ChaCha8Rng) -> Vec<KeyTensors> {
    let codes: Vec<u32> = (0..tokens).map(|_| rng.random_range(0..4375)).collect();
    let frames = networks.decode(&[&codes]).unwrap().remove(0);
    let width = frames.pose.len() / frames.len();
    let poses = frames.pose.chunks_exact(width);
    let roots = frames.root.as_chunks::<5>().0;
    poses
        .zip(roots)
        .map(|(pose, &root)| KeyTensors {
            local_root: None,
            global_root: Some(root),
            pose: Some(pose.into()),
        })
        .collect()
}

/// A task of one of all kinds, chosen by the seed.
fn any_task(networks: &mut OnnxVerMo, seed: u64) -> Task {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sampling = SamplingTask {
        temperature: rng.random_bool(0.3).then_some(0.0),
        top_k: rng.random_bool(0.5).then_some(40),
        top_p: rng.random_bool(0.3).then_some(0.8),
        repetition: None,
    };
    let tokens = rng.random_range(4..12);
    if rng.random_bool(0.25) {
        return Task::Describe(DescribeTask {
            frames: keys(networks, tokens, &mut rng),
            into: [Telling::Words, Telling::Audio(Sound::Music)][rng.random_range(0..2)],
            seed,
            sampling,
            ..DescribeTask::default()
        });
    }
    let plain = PromptTask {
        text: [
            "an old person walks",
            "Somebody waves the left hand!",
            "quasi tired kicks",
        ][rng.random_range(0..3)]
        .to_owned(),
        frames: rng.random_bool(0.7).then(|| rng.random_range(8..100)),
        seed,
        sampling,
        in_parts: rng.random_bool(0.7),
        flow_steps: if rng.random_bool(0.1) { 2 } else { 0 },
        ..PromptTask::default()
    };
    Task::Prompt(match rng.random_range(0..5) {
        0 => PromptTask {
            context: keys(networks, tokens, &mut rng),
            ..plain
        },
        1 => PromptTask {
            context: keys(networks, 4, &mut rng),
            targets: keys(networks, 4, &mut rng),
            frames: Some(4 * tokens),
            ..plain
        },
        2 => PromptTask {
            others: vec![AgentTask {
                text: "a person runs".to_owned(),
                ..AgentTask::default()
            }],
            frames: plain.frames.map(|frames| frames.min(60)),
            ..plain
        },
        3 => PromptTask {
            text: String::new(),
            audio: Some(Audio {
                sound: Sound::Speech,
                codes: (0..tokens as u32).collect(),
            }),
            ..plain
        },
        _ => plain,
    })
}

/// Compares mixes of tasks that join at random steps with the same tasks alone.
fn compare_mixes(threads: usize, tasks: u64, mixes: usize) -> usize {
    let pack = Pack::load(&tiny()).unwrap();
    let mut maker = networks(&pack, 1);
    let tasks: Vec<Task> = (0..tasks).map(|seed| any_task(&mut maker, seed)).collect();
    let mut vermo = VerMo::new(&pack, Box::new(networks(&pack, threads)), 64).unwrap();
    let alone: Vec<Given> = (tasks.iter().enumerate())
        .map(|(index, task)| {
            let mut given = run(&mut vermo, |vermo, step| {
                if step == 0 {
                    vermo.admit(id(index as u64), task.clone());
                }
            });
            given.remove(&(index as u64)).unwrap()
        })
        .collect();
    for (index, given) in alone.iter().enumerate() {
        assert!(given.is_ok(), "task {index}: {given:?}");
    }
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut differ = 0;
    for mix in 0..mixes {
        let mut joining = BTreeMap::new();
        for _ in 0..rng.random_range(2..=40) {
            joining.insert(rng.random_range(0..tasks.len()), rng.random_range(0..LATEST));
        }
        let given = run(&mut vermo, |vermo, step| {
            for (&task, _) in joining.iter().filter(|(_, joins)| **joins == step) {
                vermo.admit(id(task as u64), tasks[task].clone());
            }
        });
        assert_eq!(given.len(), joining.len());
        let different = given
            .iter()
            .filter(|(index, given)| **given != alone[**index as usize]);
        let different = different.count();
        if different > 0 {
            println!("mix {mix}: {different} of {} differ", given.len());
        }
        differ += different;
    }
    differ
}

#[test]
fn tasks_have_the_same_bits_alone_and_in_any_mixture() {
    assert_eq!(compare_mixes(1, 24, 8), 0);
}

#[test]
#[ignore = "takes minutes"]
fn any_mixture_gets_the_same_bits_alone_with_one_thread_and_two() {
    for threads in [1, 2] {
        let differ = compare_mixes(threads, 80, 200);
        println!("{threads} threads: {differ} answers of 200 mixes differ from those alone");
        assert_eq!(differ, 0);
    }
}

#[test]
fn a_long_motion_continues_without_a_jump_and_its_parts_make_the_whole() {
    let pack = Pack::load(&tiny()).unwrap();
    let mut vermo = VerMo::new(&pack, Box::new(networks(&pack, 1)), 4).unwrap();
    vermo.warm_up().unwrap();
    assert_eq!(vermo.trial().unwrap().rows, 4);
    let task = PromptTask {
        text: "walk".to_owned(),
        frames: Some(300),
        seed: 1,
        in_parts: true,
        ..PromptTask::default()
    };
    let given = run(&mut vermo, |vermo, step| {
        if step == 0 {
            vermo.admit(id(0), task.clone().into());
        }
    });
    let Ok(Output::Motion(motion)) = &given[&0] else {
        panic!("{given:?}");
    };
    assert_eq!(motion.frames(), 300);
    assert_eq!(motion.contacts.len(), 300 * pack.rig.dims.contacts);
    // With random weights, motion jerks between all frames; seams must not be worse.
    let steps = steps(motion);
    let seams = [15, 47, 79, 111, 255, 271];
    let longest = |is_wanted: &dyn Fn(&usize) -> bool| {
        let frames = (0..steps.len()).filter(is_wanted);
        frames.map(|at| steps[at]).fold(0.0, f32::max)
    };
    let (at_seams, elsewhere) = (
        longest(&|at| seams.contains(at)),
        longest(&|at| !seams.contains(at)),
    );
    assert!(
        at_seams <= elsewhere,
        "{at_seams} m at seams, {elsewhere} m elsewhere"
    );
}

/// Distances between neighbouring frames of the root on the ground, metres.
fn steps(motion: &Motion) -> Vec<f32> {
    let roots: Vec<&[f32]> = motion.root.chunks_exact(5).collect();
    let steps = roots
        .windows(2)
        .map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][2] - pair[0][2]));
    steps.collect()
}

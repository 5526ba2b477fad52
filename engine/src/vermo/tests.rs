//! Tests of vocabulary, messages, replies, choices, and seams.

use troupe_motion::Vec3;
use troupe_motion::root::wrap_angle;

use super::motion::{Frames, Stitcher, first_body};
use super::reply::{Allowed, Reply, Rules};
use super::sampler::{Logits, Sampler, Sampling};
use super::toy::{pack, toy};
use super::vocabulary::{AGENT_SEP, BOS, CONDITION, EOS, GAP, INSTRUCTION, REPLY};
use super::*;
use crate::pack::MessageTask;

const ALL: Sampling = Sampling {
    temperature: 1.0,
    top_k: 0,
    top_p: 1.0,
    repetition: 1.0,
};

fn vocabulary() -> Vocabulary {
    toy(&pack()).vocabulary
}

#[test]
fn the_ids_of_all_kinds_are_consecutive() {
    let vocabulary = vocabulary();
    assert_eq!(Vocabulary::task(MessageTask::TextToMotion), 8);
    assert_eq!(Vocabulary::task(MessageTask::GestureToSpeech), 17);
    assert_eq!((vocabulary.length(1), vocabulary.length(16)), (18, 33));
    assert_eq!(vocabulary.range(Kind::Text), 34..71);
    assert_eq!(vocabulary.range(Kind::Motion), 71..80);
    assert_eq!(vocabulary.range(Kind::Audio), 80..85);
    assert_eq!(vocabulary.len(), 85);
    assert_eq!(vocabulary.code(Kind::Motion, 79), Some(8));
    assert_eq!(vocabulary.code(Kind::Motion, 80), None);
}

#[test]
fn messages_have_the_tokens_of_the_documentation() {
    let (text, motion, audio) = (34, 71, 80);
    let vocabulary = vocabulary();
    let message = |task, captions: &[&[u32]], condition, length| {
        let captions = captions.iter().map(|caption| caption.to_vec()).collect();
        Message {
            task,
            captions,
            condition,
            length,
        }
        .tokens(&vocabulary)
    };
    assert_eq!(
        message(MessageTask::TextToMotion, &[&[3, 4]], Condition::None, Some(5)),
        [BOS, 8, INSTRUCTION, text + 3, text + 4, 22, REPLY]
    );
    assert_eq!(
        message(
            MessageTask::MotionToText,
            &[],
            Condition::Motion(vec![vec![1, 2], vec![3]]),
            None
        ),
        [
            BOS,
            9,
            CONDITION,
            motion + 1,
            motion + 2,
            AGENT_SEP,
            motion + 3,
            REPLY
        ]
    );
    assert_eq!(
        message(
            MessageTask::Inbetween,
            &[&[0], &[1]],
            Condition::Gap(vec![[vec![1], vec![2]]]),
            None
        ),
        [
            BOS,
            11,
            INSTRUCTION,
            text,
            AGENT_SEP,
            text + 1,
            CONDITION,
            motion + 1,
            GAP,
            motion + 2,
            REPLY
        ]
    );
    assert_eq!(
        message(MessageTask::MusicToDance, &[], Condition::Audio(vec![4]), None),
        [BOS, 14, CONDITION, audio + 4, REPLY]
    );
    assert_eq!(
        message(MessageTask::Unconditional, &[], Condition::None, None),
        [BOS, 13, REPLY]
    );
}

#[test]
fn a_reply_has_codes_of_its_own_kind_and_ends_in_time() {
    let vocabulary = vocabulary();
    let rules = |kind, agents, least, most| Rules {
        kind,
        agents,
        least,
        most,
    };
    let codes = |kind| vocabulary.range(kind);
    let mut reply = Reply::new(rules(Kind::Motion, 2, 1, 2), &vocabulary);
    let allowed = |codes, mark| Allowed { codes, mark };
    assert_eq!(reply.allowed(), allowed(codes(Kind::Motion), None));
    assert!(!reply.push(75));
    assert_eq!(reply.allowed(), allowed(codes(Kind::Motion), Some(AGENT_SEP)));
    assert!(!reply.push(75));
    assert_eq!(reply.allowed(), allowed(0..0, Some(AGENT_SEP)));
    assert!(!reply.must_end());
    reply.push(AGENT_SEP);
    reply.push(76);
    assert_eq!(reply.allowed(), allowed(codes(Kind::Motion), Some(EOS)));
    reply.push(76);
    assert!(reply.must_end());
    assert!(reply.push(EOS));
    for kind in [Kind::Text, Kind::Audio] {
        let reply = Reply::new(rules(kind, 1, 0, 9), &vocabulary);
        assert_eq!(reply.allowed(), allowed(codes(kind), Some(EOS)));
    }
    let ids: Vec<u32> = allowed(71..73, Some(EOS)).ids().collect();
    assert_eq!(ids, [EOS, 71, 72]);
}

fn choose(logits: &[f32], reply: &[u32], sampling: Sampling, index: u64) -> Option<u32> {
    let allowed = Allowed {
        codes: 3..8,
        mark: Some(EOS),
    };
    let logits = Logits {
        own: logits,
        guides: &[],
    };
    Sampler::default().choose(logits, &allowed, reply, &sampling, (7, index))
}

#[test]
fn the_likeliest_token_is_the_first_of_equals_among_those_allowed() {
    let greedy = Sampling {
        temperature: 0.0,
        ..ALL
    };
    let logits = [9.0, 9.0, 1.0, 1.0, 3.0, 3.0, 2.0, -1.0, 9.0];
    assert_eq!(choose(&logits, &[], greedy, 0), Some(4));
    // Positive logits are divided and negative ones multiplied, for codes among the last eight
    // tokens only.
    let penalty = Sampling {
        repetition: 2.0,
        ..greedy
    };
    assert_eq!(choose(&logits, &[4], penalty, 0), Some(5));
    assert_eq!(choose(&logits, &[4, 5], penalty, 0), Some(6));
    assert_eq!(choose(&logits, &[4, 5, 6, 3, 3, 3, 3, 3, 3], penalty, 0), Some(4));
    let negative = [0.0, 0.0, -9.0, -1.5, -1.0, -9.0, -9.0, -9.0];
    assert_eq!(choose(&negative, &[4], penalty, 0), Some(3));
    let ends = [0.0, 0.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    assert_eq!(
        choose(&ends, &[EOS], penalty, 0),
        Some(EOS),
        "special tokens have no penalty"
    );
    assert_eq!(choose(&[0.0; 6], &[], greedy, 0), None, "fewer logits than ids");
    let mut broken = logits;
    broken[8] = f32::NAN;
    assert_eq!(
        choose(&broken, &[], greedy, 0),
        Some(4),
        "masked logits are not read"
    );
    broken[7] = f32::NAN;
    assert_eq!(choose(&broken, &[], greedy, 0), None);
}

/// The share of each id from 0 to 7 in `draws` draws.
fn shares(logits: &[f32], sampling: Sampling, draws: u64) -> Vec<f64> {
    let mut counts = vec![0.0; 8];
    for index in 0..draws {
        counts[choose(logits, &[], sampling, index).unwrap() as usize] += 1.0 / draws as f64;
    }
    counts
}

#[test]
fn draws_have_the_probabilities_of_the_logits() {
    let weights = [0.0, 0.0, 0.1, 0.4, 0.2, 0.15, 0.1, 0.05_f32];
    let logits: Vec<f32> = weights.iter().map(|weight| weight.ln()).collect();
    let logits: Vec<f32> = logits
        .iter()
        .map(|logit| if logit.is_finite() { *logit } else { 50.0 })
        .collect();
    let near = |found: Vec<f64>, wanted: [f32; 8]| {
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(
                (found - f64::from(wanted)).abs() < 0.02,
                "{found} is not {wanted}"
            );
        }
    };
    near(shares(&logits, ALL, 4000), weights);
    let two = Sampling { top_k: 2, ..ALL };
    near(
        shares(&logits, two, 4000),
        [0.0, 0.0, 0.0, 0.667, 0.333, 0.0, 0.0, 0.0],
    );
    let most = Sampling { top_p: 0.7, ..ALL };
    near(
        shares(&logits, most, 4000),
        [0.0, 0.0, 0.0, 0.533, 0.267, 0.2, 0.0, 0.0],
    );
    let both = Sampling {
        top_k: 2,
        top_p: 0.6,
        ..ALL
    };
    near(
        shares(&logits, both, 4000),
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    );
    let cold = Sampling {
        temperature: 0.05,
        ..ALL
    };
    assert!(shares(&logits, cold, 400)[3] > 0.99);
}

#[test]
fn draws_depend_on_seed_and_index() {
    let logits = [0.0; 8];
    let row = |from: u64| -> Vec<_> {
        (from..from + 20)
            .map(|index| choose(&logits, &[], ALL, index))
            .collect()
    };
    assert_eq!(row(0), row(0));
    assert_eq!(row(0)[5..], row(5)[..15]);
    assert_ne!(row(0), row(1));
}

fn stitcher(past: &Frames, start: Vec3) -> Stitcher {
    Stitcher::new(&pack().rig, past, start, 16)
}

fn decoded(codes: &[u32]) -> Frames {
    toy(&pack()).decoded(codes)
}

fn root(motion: &[f32], frame: usize) -> [f32; 5] {
    std::array::from_fn(|n| motion[frame * 5 + n])
}

fn assert_close(found: &[f32], wanted: &[f32], most: f32) {
    assert_eq!(found.len(), wanted.len());
    for (n, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= most, "number {n}: {a} is not {b}");
    }
}

#[test]
fn windows_become_the_motion_of_all_tokens() {
    let codes = [1, 2, 5, 0, 3, 8, 4, 4, 2, 1];
    let mut whole = stitcher(&Frames::default(), Vec3::ZERO);
    let whole = whole.join(&decoded(&codes), 0, 40, None);
    let mut parts = stitcher(&Frames::default(), Vec3::ZERO);
    let mut motion = parts.join(&decoded(&codes[..6]), 0, 16, None);
    // The first frames of a window are in place already: the toy's frames do not depend on the
    // tokens before.
    motion.append(parts.join(&decoded(&codes[2..9]), 8, 20, None));
    motion.append(parts.join(&decoded(&codes[5..]), 8, 20, None));
    assert_eq!(motion.frames(), 40);
    assert_close(&motion.root, &whole.root, 1e-5);
    assert_close(&motion.rotations, &whole.rotations, 1e-5);
    assert_eq!(motion.contacts, whole.contacts);
    assert!(motion.contacts.contains(&1.0) && motion.contacts.contains(&0.0));
}

#[test]
fn a_motion_continues_from_the_last_frame_of_its_past() {
    // The past may end anywhere. Here it is higher than the decoder's frames, and the body is
    // turned against its root.
    let mut past = decoded(&[3, 3]);
    for (index, root) in past.root.chunks_exact_mut(5).enumerate() {
        root[0] += 2.0;
        root[1] = 1.1 + 0.001 * index as f32;
    }
    let mut stitcher = stitcher(&past, Vec3::ZERO);
    let window = decoded(&[5, 5, 4, 4, 4, 4]);
    let motion = stitcher.join(&window, 8, 24, None);
    let (last, first) = (root(&past.root, 7), root(&motion.root, 0));
    let step = (first[0] - last[0]).hypot(first[2] - last[2]);
    assert!((step - 0.04).abs() < 1e-4, "a step of {step} m");
    assert!((first[1] - last[1]).abs() < 0.02, "{} m up", first[1] - last[1]);
    let heading = |root: [f32; 5]| root[4].atan2(root[3]);
    assert!((wrap_angle(heading(first) - heading(last)) - 0.04).abs() < 1e-3);
    // The difference has vanished behind the seam.
    assert!((root(&motion.root, 15)[1] - 0.9).abs() < 1e-6);
    for pair in motion.root.chunks_exact(5).collect::<Vec<_>>().windows(2) {
        assert!((pair[0][1] - pair[1][1]).abs() < 0.06, "a jump in height");
    }
    // The next message contains the frames that were given out.
    let given = stitcher.past();
    assert_eq!(given.len(), 16);
    assert_close(&given.root, &motion.root, 1e-6);
}

#[test]
fn a_gap_ends_where_the_frames_behind_it_begin() {
    let past = decoded(&[2, 2]);
    let mut stitcher = stitcher(&past, Vec3::ZERO);
    let mut behind = decoded(&[1]);
    behind.root[..5].copy_from_slice(&[0.5, 1.0, 1.0, 0.6, 0.8]);
    let target = first_body(&behind, 2).unwrap();
    let window = decoded(&[2, 2, 3, 3, 3, 3, 1]);
    let motion = stitcher.join(&window, 8, 24, Some(&target));
    assert_eq!(motion.frames(), 16);
    let last = root(&motion.root, 15);
    assert!((last[0] - 0.5).hypot(last[2] - 1.0) < 0.1, "{last:?}");
    let (before, first) = (root(&past.root, 7), root(&motion.root, 0));
    assert!((first[0] - before[0]).hypot(first[2] - before[2]) < 0.06);
}

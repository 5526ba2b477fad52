use std::collections::BTreeMap;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::toy::{Calls, Toy, pack, toy};
use super::*;
use crate::generator::JobId;
use crate::pack::MessageTask;

const GREEDY: Sampling = Sampling {
    temperature: 0.0,
    top_k: 0,
    top_p: 1.0,
    repetition: 1.0,
};

fn id(request: u64) -> JobId {
    JobId {
        request,
        character: 0,
    }
}

fn sequences(slots: usize) -> (Sequences, Toy, Calls) {
    let toy = toy(&pack());
    let calls = toy.calls.clone();
    (Sequences::new(toy.shape, toy.vocabulary, slots), toy, calls)
}

/// A prompt of `pieces` text pieces, with a reply of `least` to `most` tokens.
fn prompt(seed: u64, pieces: usize, (least, most): (usize, usize), sampling: Sampling) -> Prompt {
    let vocabulary = toy(&pack()).vocabulary;
    let message = Message {
        task: MessageTask::TextToMotion,
        captions: vec![(0..pieces as u32).map(|n| (n + seed as u32) % 37).collect()],
        condition: Condition::None,
        length: None,
    };
    let rules = Rules {
        kind: Kind::Motion,
        agents: 1,
        least,
        most,
    };
    Prompt {
        tokens: message.tokens(&vocabulary),
        guides: Vec::new(),
        rules,
        sampling,
        seed,
        drawn: 0,
    }
}

/// The prompt with two guides, whose messages are shorter: two text pieces less, and no caption.
fn guided(mut prompt: Prompt, [plain, nothing]: [f32; 2]) -> Prompt {
    let shorter = [&prompt.tokens[..prompt.tokens.len() - 2], &prompt.tokens[..2]];
    prompt.guides = (shorter.into_iter().zip([plain, nothing]))
        .map(|(tokens, weight)| Guide {
            tokens: tokens.to_vec(),
            weight,
        })
        .collect();
    prompt
}

fn any_prompt(seed: u64) -> Prompt {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sampling = Sampling {
        temperature: if rng.random_bool(0.5) { 0.0 } else { 1.5 },
        top_k: rng.random_range(0..6),
        top_p: if rng.random_bool(0.5) { 0.9 } else { 1.0 },
        repetition: if rng.random_bool(0.5) { 1.3 } else { 1.0 },
    };
    let prompt = prompt(
        seed,
        rng.random_range(3..30),
        (1, rng.random_range(1..17)),
        sampling,
    );
    match seed % 3 {
        0 => guided(prompt, [-2.0, -1.0]),
        _ => prompt,
    }
}

/// Takes steps until all sequences have ended. `between` may admit and cancel sequences before each
/// step.
fn run(
    sequences: &mut Sequences,
    toy: &mut Toy,
    mut between: impl FnMut(&mut Sequences, usize) -> bool,
) -> BTreeMap<u64, Vec<Said>> {
    let mut said: BTreeMap<u64, Vec<Said>> = BTreeMap::new();
    for step in 0.. {
        if !between(sequences, step) && sequences.is_empty() {
            break;
        }
        sequences
            .step(toy, &mut |id, more| {
                said.entry(id.request).or_default().push(more)
            })
            .unwrap();
    }
    said
}

fn alone(prompt: &Prompt) -> Vec<Said> {
    let (mut sequences, mut toy, _) = sequences(1);
    sequences.admit(id(0), prompt.clone());
    run(&mut sequences, &mut toy, |_, _| false).remove(&0).unwrap()
}

#[test]
fn a_reply_from_the_cache_equals_one_that_rereads_all_tokens() {
    for seed in 0..8 {
        let whole = prompt(seed, 5 + seed as usize, (6, 9), GREEDY);
        let cached = alone(&whole);
        // Without the cache: reads the message and the reply so far as one prompt, for one token.
        let mut again = Vec::new();
        let mut longer = whole.clone();
        for length in 0.. {
            longer.rules.least = whole.rules.least.saturating_sub(length);
            longer.rules.most = whole.rules.most - length;
            let next = match longer.rules.most {
                0 => Said::End,
                _ => alone(&longer).remove(0),
            };
            again.push(next.clone());
            match next {
                Said::Token(token) => longer.tokens.push(token),
                Said::End => break,
                Said::Failed => panic!("failed"),
            }
        }
        assert_eq!(cached, again);
    }
}

#[test]
fn the_longest_reply_ends_without_a_call_for_its_end() {
    let (mut sequences, mut toy, calls) = sequences(1);
    toy.end = -100.0;
    sequences.admit(id(0), prompt(1, 3, (2, 6), GREEDY));
    let said = run(&mut sequences, &mut toy, |_, _| false).remove(&0).unwrap();
    assert_eq!(said.len(), 7);
    assert_eq!(said[6], Said::End);
    assert!(!said[..6].contains(&Said::End));
    // One prefill, whose step also decodes, then four steps.
    assert_eq!(calls.lock().unwrap().len(), 6);
    assert_eq!(
        calls.lock().unwrap()[0],
        (2, 16, 0),
        "a prefill of one row is padded to two"
    );
    assert_eq!(sequences.room(70), 9);
    assert_eq!(sequences.room(90), 0);
}

#[test]
fn sequences_that_join_and_leave_have_the_same_replies_as_alone() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for mix in 0..15 {
        let (mut sequences, mut toy, calls) = sequences(rng.random_range(1..8));
        let joining: BTreeMap<u64, usize> = (0..rng.random_range(2..14))
            .map(|_| (rng.random_range(0..60), rng.random_range(0..9)))
            .collect();
        let said = run(&mut sequences, &mut toy, |sequences, step| {
            for (&seed, _) in joining.iter().filter(|(_, joins)| **joins == step) {
                sequences.admit(id(seed), any_prompt(seed));
            }
            step < 9
        });
        assert_eq!(said.len(), joining.len());
        for (seed, said) in said {
            assert_eq!(said, alone(&any_prompt(seed)), "mix {mix}, sequence {seed}");
        }
        assert!(
            calls
                .lock()
                .unwrap()
                .iter()
                .all(|(rows, ..)| (2..=8).contains(rows))
        );
    }
}

#[test]
fn a_guided_reply_takes_the_largest_of_the_weighted_logits() {
    let weights = [-2.5, -0.5];
    let prompt = guided(prompt(4, 6, (5, 5), GREEDY), weights);
    let mut written: Vec<u32> = Vec::new();
    for said in alone(&prompt) {
        let Said::Token(token) = said else { break };
        // The logits of each message with the reply so far, read at once.
        let logits: Vec<Vec<f32>> = std::iter::once(&prompt.tokens)
            .chain(prompt.guides.iter().map(|guide| &guide.tokens))
            .map(|message| logits_after(&[&message[..], &written].concat()))
            .collect();
        let [own, plain, nothing] = &logits[..] else {
            panic!("{} messages", logits.len());
        };
        let sum = |id: usize| 4.0 * own[id] - 2.5 * plain[id] - 0.5 * nothing[id];
        let codes = toy(&pack()).vocabulary.range(Kind::Motion);
        let best = codes.map(|id| sum(id as usize)).fold(f32::MIN, f32::max);
        assert!((sum(token as usize) - best).abs() < 1e-3);
        written.push(token);
    }
    assert_eq!(written.len(), 5);
    let unguided = alone(&Prompt {
        guides: Vec::new(),
        ..prompt
    });
    assert_ne!(
        unguided[..5],
        written
            .iter()
            .map(|&token| Said::Token(token))
            .collect::<Vec<_>>()
    );
}

/// The toy's logits after tokens that it reads in one call.
fn logits_after(tokens: &[u32]) -> Vec<f32> {
    let mut toy = toy(&pack());
    let (shape, vocabulary) = (toy.shape, toy.vocabulary);
    let tokens: Vec<i64> = tokens.iter().map(|&token| token.into()).collect();
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
        logits: vec![0.0; vocabulary.len()],
        columns: vec![0.0; shape.numbers(tokens.len())],
    };
    toy.language(&call, &mut answer).unwrap();
    answer.logits
}

#[test]
fn guided_sequences_share_the_rows_of_a_call() {
    let (mut sequences, mut toy, calls) = sequences(7);
    toy.end = -100.0;
    for seed in 1..=3 {
        sequences.admit(id(seed), guided(prompt(seed, 4, (4, 4), GREEDY), [-2.0, -1.0]));
    }
    sequences.admit(id(4), prompt(4, 4, (4, 4), GREEDY));
    let said = run(&mut sequences, &mut toy, |_, _| false);
    assert_eq!(said.len(), 4);
    // Two guided sequences have six rows. The third needs three more, and the last waits behind it.
    let decodes: Vec<usize> = (calls.lock().unwrap().iter())
        .filter(|(_, columns, _)| *columns == 1)
        .map(|(rows, ..)| *rows)
        .collect();
    assert_eq!(decodes, [6, 6, 6, 4, 4, 4]);
    assert_eq!(
        said[&1],
        alone(&guided(prompt(1, 4, (4, 4), GREEDY), [-2.0, -1.0]))
    );
}

#[test]
fn a_sequence_without_a_slot_waits_until_another_ends() {
    let (mut sequences, mut toy, calls) = sequences(2);
    toy.end = -100.0;
    for (seed, most) in [(1, 3), (2, 9), (3, 3), (4, 3)] {
        sequences.admit(id(seed), prompt(seed, 4, (1, most), GREEDY));
    }
    let mut order = Vec::new();
    while !sequences.is_empty() {
        sequences
            .step(&mut toy, &mut |id, said| {
                if said == Said::End {
                    order.push(id.request);
                }
            })
            .unwrap();
    }
    assert_eq!(order, [1, 3, 4, 2]);
    assert!(calls.lock().unwrap().iter().all(|(rows, ..)| *rows == 2));
}

#[test]
fn a_cancelled_sequence_frees_its_slot_and_changes_no_other() {
    let (mut sequences, mut toy, _) = sequences(3);
    for seed in 1..=4 {
        sequences.admit(id(seed), prompt(seed, 4, (8, 12), GREEDY));
    }
    let said = run(&mut sequences, &mut toy, |sequences, step| {
        if step == 2 {
            assert_eq!(sequences.len(), 4);
            sequences.cancel(id(1));
            sequences.cancel(id(9));
            assert_eq!(sequences.len(), 3);
        }
        false
    });
    for seed in 2..=4 {
        assert_eq!(said[&seed], alone(&prompt(seed, 4, (8, 12), GREEDY)));
    }
    assert_eq!(said[&1].len(), 3, "the first of two steps gives two tokens");
}

#[test]
fn logits_that_are_not_finite_end_one_sequence_alone() {
    let good = prompt(5, 4, (8, 8), GREEDY);
    let good_said = alone(&good);
    // A token that occurs in the first reply and not in the second.
    let (bad, bad_said, own) = (6..100)
        .find_map(|seed| {
            let bad = prompt(seed, 4, (8, 8), GREEDY);
            let said = alone(&bad);
            let own = said.iter().position(|said| !good_said.contains(said))?;
            Some((bad, said, own))
        })
        .unwrap();
    let Said::Token(token) = bad_said[own] else {
        panic!("{bad_said:?}");
    };
    let (mut sequences, mut toy, _) = sequences(2);
    toy.broken = Some(token);
    sequences.admit(id(5), good.clone());
    sequences.admit(id(6), bad);
    let said = run(&mut sequences, &mut toy, |_, _| false);
    assert_eq!(said[&6][..=own], bad_said[..=own]);
    assert_eq!(said[&6][own + 1..], [Said::Failed]);
    assert_eq!(said[&5], good_said);
}

#[test]
fn agents_take_turns_in_one_reply() {
    let mut prompt = prompt(7, 4, (2, 3), GREEDY);
    prompt.rules.agents = 3;
    let said = alone(&prompt);
    let parts = said
        .iter()
        .filter(|said| **said == Said::Token(vocabulary::AGENT_SEP));
    assert_eq!(parts.count(), 2);
    let codes = said.len() - 3;
    assert!((6..=9).contains(&codes), "{said:?}");
}

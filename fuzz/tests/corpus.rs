//! Every target on its corpus, on the examples, and on changed copies of both. The changes are the
//! same in every run; TROUPE_FUZZ_RUNS is the number of changed copies for each target.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::path::Path;

use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_fuzz::{TARGETS, mutate};

/// Texts that break most formats if they replace a part of an input.
const PIECES: [&str; 16] = [
    "nan",
    "-inf",
    "1e39",
    "-1",
    "0",
    "4294967296",
    "\"\"",
    "true",
    "null",
    "[]",
    "{}",
    "[",
    "}",
    "\u{0}",
    "é",
    "=",
];

/// The contents of the files that a target starts from.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let examples = match target {
        "manifest" => vec!["models/human/pack.toml", "models/g1/pack.toml"],
        "inbetween" => vec!["examples/request.json"],
        "scene" => vec!["examples/scenes/courtyard.toml"],
        "object" => vec!["examples/objects/cup.toml", "examples/objects/seat.toml"],
        _ => vec![],
    };
    let corpus = std::fs::read_dir(top.join("fuzz/corpus").join(target)).unwrap();
    let mut files: Vec<_> = corpus.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{target} has no corpus");
    files.extend(examples.into_iter().map(|file| top.join(file)));
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// A changed copy: [`mutate`] makes one half of them. The others have a few bytes flipped, cut,
/// repeated, or replaced by one of [`PIECES`] or by a part of another seed.
fn changed(seeds: &[Vec<u8>], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seeds.choose(random).unwrap().clone();
    if random.random_bool(0.5) {
        return mutate(&bytes, random.random());
    }
    for _ in 0..random.random_range(1..5) {
        let from = random.random_range(0..=bytes.len());
        let to = bytes.len().min(from + random.random_range(0..24));
        let part = match random.random_range(0..5) {
            0 => bytes[from..to]
                .iter()
                .map(|byte| byte ^ (1 << random.random_range(0..8)))
                .collect(),
            1 => Vec::new(),
            2 => bytes[from..to].repeat(2),
            3 => PIECES.choose(random).unwrap().as_bytes().to_vec(),
            _ => {
                let other = seeds.choose(random).unwrap();
                let from = random.random_range(0..=other.len());
                other[from..other.len().min(from + 64)].to_vec()
            }
        };
        bytes.splice(from..to, part);
    }
    bytes
}

fn run(name: &str) {
    let (_, target) = TARGETS.iter().find(|target| target.0 == name).unwrap();
    let seeds = seeds(name);
    seeds.iter().for_each(|seed| target(seed));
    let runs = std::env::var("TROUPE_FUZZ_RUNS").map_or(2000, |runs| runs.parse().unwrap());
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for _ in 0..runs {
        let bytes = changed(&seeds, &mut random);
        let result = std::panic::catch_unwind(|| target(&bytes));
        assert!(
            result.is_ok(),
            "{name} panicked on {:?}",
            String::from_utf8_lossy(&bytes)
        );
    }
}

/// A test for each target, so that they run beside each other.
macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            run(stringify!($name));
        })*

        #[test]
        fn every_target_is_run() {
            assert_eq!(TARGETS.map(|target| target.0), [$(stringify!($name)),*]);
        }
    };
}

targets!(bvh calls codec csv describe drive fbx generate glb gltf inbetween manifest npy npz object scene snapshot sonic websocket);

//! The stages on ONNX Runtime.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use troupe_engine::onnx::OnnxStages;
use troupe_engine::pack::{Pack, Stage};
use troupe_engine::{EngineError, EngineKind, Pipeline, Selector, StageTimes, Stages};
use troupe_motion::model::{KeyTensors, KeyframeTask, Motion, RootKey, RootOverride};
use troupe_server::config::Config;

use crate::pack_folder;

fn selector() -> Selector {
    Config::local(Path::new("unused")).unwrap().selector(1).unwrap()
}

/// The stages of `pack` for one worker, on the CPU in f32.
fn load(pack: &Pack) -> Result<OnnxStages, EngineError> {
    selector().load(pack, EngineKind::Cpu)
}

/// A simple repeatable sequence in -1..1.
fn noise(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    }
}

/// A task with any subset of constraints, by its seed.
fn item(pack: &Pack, seed: u64) -> KeyframeTask {
    let dims = &pack.rig.dims;
    let mut next = noise(seed);
    let mut key = |complete: bool, forward: f32| {
        let angle = if complete { 0.0 } else { 3.0 * next() };
        let root = [0.2 * next(), 0.9, forward, angle.cos(), angle.sin()];
        let local = [next(), next(), next(), 0.9];
        let pose: Box<[f32]> = (0..dims.pose()).map(|_| 0.5 * next()).collect();
        KeyTensors {
            local_root: (complete || seed.is_multiple_of(2)).then_some(local),
            global_root: (complete || !seed.is_multiple_of(3)).then_some(root),
            pose: (complete || !seed.is_multiple_of(5)).then_some(pose),
        }
    };
    let context = (0..dims.context_frames)
        .map(|frame| key(true, 0.03 * (frame as f32 - 3.0)))
        .collect();
    let targets = (0..1 + seed as usize % dims.max_targets)
        .map(|target| key(false, 1.0 + 0.03 * target as f32))
        .collect();
    KeyframeTask {
        context,
        targets,
        frames: (seed % 4 == 1).then(|| dims.min_frames() + seed as usize % 40),
        allowed_counts: match seed % 4 {
            1 => {
                let tokens = dims.tokens_for(dims.min_frames() + seed as usize % 40);
                (0..dims.counts())
                    .map(|index| index + dims.min_tokens == tokens)
                    .collect()
            }
            _ => vec![true; dims.counts()],
        },
        seed,
        temperature: [0.0, 0.0, 1.0][seed as usize % 3],
        pose_steps: 1 + u32::from(seed.is_multiple_of(7)) * 3,
        root_guide: None,
        root_override: seed.is_multiple_of(4).then(|| {
            let key = RootKey {
                frame: 9,
                ground: Some([0.3 * next(), 0.5 + 0.2 * next()]),
                height: seed.is_multiple_of(8).then_some(0.85),
                heading: seed.is_multiple_of(8).then_some(next()),
            };
            RootOverride::new([key], dims.context_frames - 1)
        }),
        gap_poses: Vec::new(),
    }
}

/// The largest difference of two motions that must have the same tokens.
fn difference(a: &Motion, b: &Motion) -> f32 {
    let (at, bt) = (a.trace.as_deref().unwrap(), b.trace.as_deref().unwrap());
    assert_eq!(at.num_tokens, bt.num_tokens, "the token count differs");
    assert_eq!(at.tokens, bt.tokens, "a pose token differs");
    let pairs = [
        (&at.count_probs, &bt.count_probs),
        (&at.root_r_g3, &bt.root_r_g3),
        (&a.root, &b.root),
        (&a.rotations, &b.rotations),
        (&a.contacts, &b.contacts),
    ];
    let each = pairs
        .into_iter()
        .flat_map(|(a, b)| a.iter().zip(b))
        .map(|(a, b)| (a - b).abs());
    each.fold(0.0, f32::max)
}

fn run(pipeline: &mut Pipeline, items: &[KeyframeTask]) -> (Vec<Motion>, StageTimes) {
    let (answers, times) = pipeline.run(items).unwrap();
    (answers.into_iter().map(Result::unwrap).collect(), times)
}

/// The engines that run here.
fn engines(selector: &Selector) -> impl Iterator<Item = EngineKind> {
    EngineKind::ALL.into_iter().filter(|&engine| {
        let missing = selector.missing(engine);
        if let Some(missing) = &missing {
            println!("{engine} is not tested here: {missing}");
        }
        missing.is_none()
    })
}

#[test]
fn a_character_is_the_same_in_every_batch_and_on_every_worker() {
    let (pack, selector) = (Pack::load(&pack_folder()).unwrap(), selector());
    let items: Vec<KeyframeTask> = (0..64).map(|seed| item(&pack, seed)).collect();
    for engine in engines(&selector) {
        let worker = || {
            let stages = selector.load(&pack, engine).unwrap();
            assert!(stages.any_length());
            Pipeline::new(pack.rig.dims, Box::new(stages), 64)
        };
        let mut pipeline = worker();
        let (together, times) = run(&mut pipeline, &items);
        assert_eq!((together.len(), times.bucket), (64, 64));
        let lengths: HashSet<usize> = together.iter().map(|motion| motion.frames()).collect();
        assert!(
            lengths.len() > 4,
            "all segments have one of the lengths {lengths:?}"
        );
        for (size, pipeline) in [
            (1, &mut pipeline),
            (8, &mut worker()),
            (3, &mut worker()),
            (20, &mut worker()),
        ] {
            let alone: Vec<Motion> = items
                .chunks(size)
                .take(24 / size + 1)
                .flat_map(|chunk| run(pipeline, chunk).0)
                .collect();
            for (index, (alone, together)) in alone.iter().zip(&together).enumerate() {
                let difference = difference(alone, together);
                assert!(
                    alone == together,
                    "{engine}: character {index} differs by {difference} in a batch of {size}"
                );
            }
        }
    }
}

#[test]
fn a_pack_with_a_fixed_time_axis_serves_the_same() {
    let pack = Pack::load(&pack_folder()).unwrap();
    let fixed = with_fixed_time(&pack);
    let items: Vec<KeyframeTask> = (0..8).map(|seed| item(&pack, seed)).collect();
    let [open, fixed] = [(&pack, true), (&fixed, false)].map(|(pack, any_length)| {
        let stages = load(pack).unwrap();
        assert_eq!(stages.any_length(), any_length);
        run(&mut Pipeline::new(pack.rig.dims, Box::new(stages), 8), &items).0
    });
    for (open, fixed) in open.iter().zip(&fixed) {
        assert!(difference(open, fixed) < 1e-4, "{}", difference(open, fixed));
    }
}

#[test]
fn a_pack_with_a_fixed_time_axis_serves_on_every_engine() {
    let pack = with_fixed_time(&Pack::load(&pack_folder()).unwrap());
    let items: Vec<KeyframeTask> = (0..7).map(|seed| item(&pack, seed)).collect();
    for engine in engines(&selector()) {
        let stages = selector().load(&pack, engine).unwrap();
        let mut pipeline = Pipeline::new(pack.rig.dims, Box::new(stages), 8);
        let together = run(&mut pipeline, &items).0;
        for (item, together) in items.iter().zip(&together) {
            let alone = run(&mut pipeline, std::slice::from_ref(item)).0;
            assert!(alone[0] == *together, "{engine}");
        }
    }
}

#[test]
fn graphs_that_do_not_name_their_axes_are_served_too() {
    let pack = Pack::load(&pack_folder()).unwrap();
    let names = ["batch", "tokens", "4*tokens"];
    let nameless = rewritten(&pack, "nameless-axes", |graph| {
        names.iter().for_each(|name| forget_axis(graph, name));
    });
    let items: Vec<KeyframeTask> = (0..5).map(|seed| item(&pack, seed)).collect();
    for engine in engines(&selector()) {
        let any_batch = |pack: &Pack| {
            let stages = selector().load(pack, engine).unwrap();
            (
                stages.any_batch(),
                Pipeline::new(pack.rig.dims, Box::new(stages), 8),
            )
        };
        let (batch, mut pipeline) = any_batch(&nameless);
        assert_eq!(batch, any_batch(&pack).0, "{engine}");
        let (together, times) = run(&mut pipeline, &items);
        assert_eq!(times.bucket, if batch { 5 } else { 6 }, "{engine}");
        for (item, together) in items.iter().zip(&together) {
            let alone = run(&mut pipeline, std::slice::from_ref(item)).0;
            assert!(alone[0] == *together, "{engine}");
        }
    }
}

/// A copy of `pack` whose graphs fix the time axis at the longest segment, as those of older packs
/// do.
fn with_fixed_time(pack: &Pack) -> Pack {
    rewritten(pack, "fixed-time", |graph| {
        fix_axis(graph, "tokens", pack.rig.dims.max_tokens);
        fix_axis(graph, "4*tokens", pack.rig.dims.max_frames());
    })
}

/// A copy of `pack` with other graphs.
fn rewritten(pack: &Pack, name: &str, change: impl Fn(&mut [u8])) -> Pack {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for stage in Stage::ALL {
        let mut graph = std::fs::read(pack.stage_file(stage)).unwrap();
        change(&mut graph);
        std::fs::write(folder.join(stage.file_name()), graph).unwrap();
    }
    let mut rewritten = pack.clone();
    rewritten.folder = folder;
    rewritten
}

/// Gives every axis called `name` in an ONNX file the length `value`, in as many bytes: field 2 of
/// the message `Dimension` is an axis's name, field 1 its length, as a number that may be written
/// with leading zeros.
fn fix_axis(graph: &mut [u8], name: &str, value: usize) {
    let mut fixed = vec![0x08];
    fixed.extend((0..name.len()).map(|index| (value >> (7 * index)) as u8 | 0x80));
    fixed.push(0);
    for at in places_of_axis(graph, name) {
        graph[at..at + fixed.len()].copy_from_slice(&fixed);
    }
}

/// Takes the name from every axis called `name`: it becomes field 3, what the axis is for.
fn forget_axis(graph: &mut [u8], name: &str) {
    for at in places_of_axis(graph, name) {
        graph[at] = 0x1a;
    }
}

fn places_of_axis(graph: &[u8], name: &str) -> Vec<usize> {
    let named = [&[0x12, name.len() as u8], name.as_bytes()].concat();
    (0..graph.len() - named.len())
        .filter(|&at| graph[at..].starts_with(&named))
        .collect()
}

#[test]
fn warm_up_meets_every_shape_and_changes_nothing() {
    let pack = Pack::load(&pack_folder()).unwrap();
    let stages = load(&pack).unwrap();
    let mut pipeline = Pipeline::new(pack.rig.dims, Box::new(stages), 4);
    let items: Vec<KeyframeTask> = (0..4).map(|seed| item(&pack, seed)).collect();
    let before = run(&mut pipeline, &items).0;
    pipeline.warm_up().unwrap();
    assert!(run(&mut pipeline, &items).0 == before);
}

#[test]
fn what_the_pack_promises_the_stages_must_keep() {
    let mut pack = Pack::load(&pack_folder()).unwrap();
    Arc::make_mut(&mut pack.rig).dims.heads += 1;
    let Err(error) = load(&pack) else {
        panic!("a wrong pack was loaded")
    };
    let text = error.to_string();
    assert!(matches!(error, EngineError::Signature { .. }), "{text}");
    let heads = pack.rig.dims.heads;
    assert!(
        text.starts_with("pose.onnx: the input tokens has the shape"),
        "{text}"
    );
    assert!(
        text.contains(&format!(
            "expected [batch, {}, {heads}]",
            pack.rig.dims.max_tokens
        )),
        "{text}"
    );

    pack.folder = PathBuf::from("nowhere");
    let Err(error) = load(&pack) else {
        panic!("a missing pack was loaded")
    };
    assert!(
        matches!(
            error,
            EngineError::Load {
                file: "root.onnx",
                ..
            }
        ),
        "{error}"
    );
}

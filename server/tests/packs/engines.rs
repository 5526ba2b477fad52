//! Engines beside the reference.

use std::path::Path;

use troupe_engine::accuracy::{Accuracy, Kind, Probe, compare, compare_paths, probe};
use troupe_engine::families::unimogen::{Call, Denoiser, probe_task};
use troupe_engine::generator::{JobId, Progress};
use troupe_engine::pack::Pack;
use troupe_engine::{
    DecoderOutput, EngineChoice, EngineError, EngineKind, PoseOutput, RootInput, RootOutput, Selector,
    Stages, TokenInput,
};
use troupe_motion::model::Output;
use troupe_server::config::Config;

use crate::pack_folder;

fn pack() -> Pack {
    Pack::load(&pack_folder()).unwrap()
}

fn selector() -> Selector {
    Config::local(Path::new("unused")).unwrap().selector(1).unwrap()
}

/// The reference with noise on what its stages give.
struct Noisy {
    inner: Box<dyn Stages>,
    seed: u64,
    /// Metres on r_g3.
    root: f32,
    /// On every logit.
    logits: f32,
    /// On every number of a 6D rotation.
    rotations: f32,
}

impl Noisy {
    fn blur(&mut self, values: &mut [f32], size: f32) {
        if size == 0.0 {
            return;
        }
        for value in values {
            self.seed ^= self.seed << 13;
            self.seed ^= self.seed >> 7;
            self.seed ^= self.seed << 17;
            *value += size * ((self.seed >> 40) as f32 / (1 << 23) as f32 - 1.0);
        }
    }
}

impl Stages for Noisy {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.inner.root(rows, input, output)?;
        self.blur(output.global_root.range_mut(0..rows), self.root);
        Ok(())
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        self.inner.pose(rows, input, output)?;
        self.blur(output.logits.range_mut(0..rows), self.logits);
        Ok(())
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        self.inner.decoder(rows, input, output)?;
        self.blur(output.rotations.range_mut(0..rows), self.rotations);
        Ok(())
    }
}

/// The figures of the reference with that much noise.
fn with_noise(root: f32, logits: f32, rotations: f32) -> Accuracy {
    let (pack, selector) = (pack(), selector());
    let load = || -> Box<dyn Stages> { Box::new(selector.load(&pack, EngineKind::Cpu).unwrap()) };
    let Probe {
        batches,
        mut reference,
    } = probe(&pack, load()).unwrap();
    let mut noisy = Noisy {
        inner: load(),
        seed: 88_172_645_463_325_252,
        root,
        logits,
        rotations,
    };
    compare(&pack, &mut *reference, &mut noisy, &batches).unwrap()
}

/// The figures that are over their bars.
fn over(accuracy: &Accuracy) -> Vec<&'static str> {
    let bars = accuracy.bars();
    bars.iter()
        .filter(|bar| !bar.holds())
        .map(|bar| bar.figure)
        .collect()
}

#[test]
fn the_reference_is_at_no_distance_from_itself() {
    let accuracy = with_noise(0.0, 0.0, 0.0);
    assert_eq!(
        accuracy,
        Accuracy {
            characters: 48,
            ..Accuracy::default()
        }
    );
    assert!(accuracy.passes() && accuracy.failures().is_empty());
}

#[test]
fn a_poor_engine_fails_in_the_figures_of_its_errors() {
    let accuracy = with_noise(0.05, 0.0, 0.0);
    assert_eq!(
        over(&accuracy),
        ["root_mean_m", "root_max_m", "root_max_rad"],
        "{accuracy:?}"
    );
    let accuracy = with_noise(0.0, 1.0, 0.0);
    assert_eq!(
        over(&accuracy),
        ["tokens_differ", "token_loss_nats"],
        "{accuracy:?}"
    );
    let accuracy = with_noise(0.0, 0.0, 0.05);
    assert_eq!(over(&accuracy), ["joint_mean_m", "joint_max_m"], "{accuracy:?}");
    assert!(
        accuracy.failures().contains("at most 0.002 is allowed"),
        "{}",
        accuracy.failures()
    );
}

#[test]
fn an_engine_that_gives_no_numbers_fails() {
    for (root, logits, rotations) in [(f32::NAN, 0.0, 0.0), (0.0, f32::NAN, 0.0), (0.0, 0.0, f32::NAN)] {
        let accuracy = with_noise(root, logits, rotations);
        assert!(!accuracy.passes(), "{accuracy:?}");
    }
}

#[test]
fn bf16_serves_the_pack_where_it_can() {
    let (pack, mut selector) = (pack(), selector());
    let missing = selector.missing(EngineKind::OpenvinoBf16);
    let decision = selector.choose(&pack).unwrap();
    if let Some(missing) = missing {
        println!("bf16 is not tested here: {missing}");
        assert_eq!(decision.engine, EngineKind::Cpu);
        assert!(decision.why.contains(&missing), "{}", decision.why);
        selector.choice = EngineChoice::OpenvinoBf16;
        let error = selector.choose(&pack).unwrap_err();
        assert!(error.to_string().contains(&missing), "{error}");
        return;
    }
    let check = decision.check.unwrap();
    println!("{:?}: {:?}", check.took, check.accuracy);
    assert!(check.passed, "{}", check.accuracy.failures());
    assert_eq!(decision.engine, EngineKind::OpenvinoBf16);
    assert!(
        check.accuracy.joint_mean_m > 0.0,
        "bf16 rounds, so this was not bf16"
    );
}

#[test]
fn a_machine_without_bf16_serves_in_f32() {
    let (pack, mut selector) = (pack(), selector());
    selector
        .machine
        .features
        .retain(|feature| !feature.ends_with("bf16"));
    let decision = selector.choose(&pack).unwrap();
    assert_eq!((decision.engine, decision.check), (EngineKind::Cpu, None));
    assert!(
        decision.why.contains("neither AVX512-BF16 nor AMX"),
        "{}",
        decision.why
    );
}

#[test]
fn a_named_engine_that_is_not_there_is_explained() {
    let (pack, mut selector) = (pack(), selector());
    for (choice, engine) in [
        (EngineChoice::Cuda, EngineKind::Cuda),
        (EngineChoice::Tensorrt, EngineKind::Tensorrt),
    ] {
        if selector.missing(engine).is_none() {
            println!("{engine} is here");
            continue;
        }
        selector.choice = choice;
        let error = selector.choose(&pack).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("the engine {engine} cannot serve")),
            "{error}"
        );
        assert!(error.contains("TROUPE_RUNTIME=gpu make runtime"), "{error}");
    }
}

/// The trained pack of the family UniMoGen.
fn unimogen() -> Pack {
    Pack::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/unimogen")).unwrap()
}

#[test]
fn a_pack_of_many_bodies_is_served_by_the_engine_that_is_near_enough() {
    let (pack, selector) = (unimogen(), selector());
    let decision = selector.choose(&pack).unwrap();
    assert!(decision.batching.any_size);
    if selector.missing(EngineKind::OpenvinoBf16).is_none() {
        let check = decision.check.unwrap();
        println!("{:?}: {:?}", check.took, check.accuracy);
        assert!(check.passed, "{}", check.accuracy.failures());
        assert_eq!(
            (decision.engine, check.accuracy.kind),
            (EngineKind::OpenvinoBf16, Kind::Paths)
        );
        assert!(
            check.accuracy.joint_mean_m > 0.0,
            "bf16 rounds, so this was not bf16"
        );
        assert_eq!(check.accuracy.bars().len(), 6, "it has no tokens");
    }
    let mut generator = selector.generator(&pack, decision.engine, 2).unwrap();
    assert!(generator.is_idle() && generator.trial().is_some());
    let id = JobId {
        request: 1,
        character: 0,
    };
    generator.admit(id, probe_task(&pack, 0, 36).unwrap().into());
    let mut frames = 0;
    while !generator.is_idle() {
        let mut out = |_, progress| match progress {
            Progress::Done(Output::Motion(motion)) => frames += motion.frames(),
            other => panic!("{other:?}"),
        };
        generator.step(&mut out).unwrap();
    }
    assert_eq!(frames, 36);
}

/// Adds a bit to what the network takes for clean.
struct Off(Box<dyn Denoiser>);

impl Denoiser for Off {
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError> {
        self.0.denoise(call, clean)?;
        clean.iter_mut().for_each(|value| *value += 0.1);
        Ok(())
    }
}

#[test]
fn a_poor_engine_fails_on_whole_motions_too() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../engine/tests/unimogen");
    let (pack, selector) = (Pack::load(&folder).unwrap(), selector());
    let load = || -> Box<dyn Denoiser> { Box::new(selector.load_denoiser(&pack, EngineKind::Cpu).unwrap()) };
    let same = compare_paths(&pack, load(), load()).unwrap();
    let nothing = Accuracy {
        kind: Kind::Paths,
        characters: 4,
        ..Accuracy::default()
    };
    assert_eq!(same, nothing);
    let poor = compare_paths(&pack, load(), Box::new(Off(load()))).unwrap();
    let over = over(&poor);
    assert!(
        over.contains(&"root_mean_m") && over.contains(&"joint_mean_m"),
        "{over:?}"
    );
}

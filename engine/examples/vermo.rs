//! How fast a VerMo pack writes: tokens a second alone and in company beside a bare loop over the same graph, continuous beside static
//! batching, and the time to the first frames. All are measured in turns; the median of the rounds counts.
//!
//! `cargo run --release -p troupe-engine --example vermo`

use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use troupe_engine::generator::{Generator as _, JobId, Progress};
use troupe_engine::onnx::{Growth, OnnxVerMo, Runtime, SessionOptions};
use troupe_engine::pack::Pack;
use troupe_engine::vermo::{LanguageAnswer, LanguageCall, Networks as _, Shape, Vocabulary};
use troupe_engine::{EngineError, EngineKind, VerMo};
use troupe_motion::model::{PromptTask, Task};

/// How often everything is measured.
const ROUNDS: usize = 5;
/// Sequences of a crowd.
const CROWD: usize = 32;
/// Requests of the comparison with static batching, and their tokens in turns.
const REQUESTS: usize = 96;
const LENGTHS: [usize; 6] = [4, 60, 12, 30, 8, 20];
/// Columns of the cache that the bare loop has behind it.
const FILLED: i64 = 40;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Measures a VerMo pack.
#[derive(Parser)]
struct Options {
    /// The pack's folder.
    #[arg(long, default_value = "models/vermo")]
    pack: PathBuf,
    /// What the prompts say.
    #[arg(long, default_value = "an elderly man waves with his left hand")]
    text: String,
    /// Threads of the networks.
    #[arg(long, default_value_t = 1)]
    threads: usize,
}

fn main() -> Result<(), Failed> {
    let options = Options::parse();
    let mut bench = Bench::new(&options)?;
    let most = bench.pack.rig.dims.max_tokens;
    let mut found: Vec<(String, Vec<f64>)> = Vec::new();
    for _ in 0..ROUNDS {
        let mut note = |name: &str, figure: f64| match found.iter_mut().find(|(known, _)| known == name) {
            Some((_, figures)) => figures.push(figure),
            None => found.push((name.to_owned(), vec![figure])),
        };
        note("bare loop, 1 sequence (tokens/s)", bench.bare(1)?);
        note("generator, 1 sequence (tokens/s)", bench.written(&[most])?);
        note("bare loop, 32 sequences (tokens/s)", bench.bare(CROWD)?);
        note(
            "generator, 32 sequences (tokens/s)",
            bench.written(&[most; CROWD])?,
        );
        let lengths: Vec<usize> = LENGTHS.iter().copied().cycle().take(REQUESTS).collect();
        note(
            "96 requests of mixed lengths, continuous (tokens/s)",
            bench.written(&lengths)?,
        );
        note(
            "the same, static batches of 32 (tokens/s)",
            bench.in_batches(&lengths)?,
        );
        note("first frames after a prompt (ms)", bench.first_frames()?);
    }
    for (name, figures) in &mut found {
        figures.sort_by(f64::total_cmp);
        let (low, high) = (figures[0], figures[figures.len() - 1]);
        println!(
            "{name}: {:.1} ({low:.1} to {high:.1})",
            figures[figures.len() / 2]
        );
    }
    Ok(())
}

struct Bench {
    pack: Pack,
    networks: OnnxVerMo,
    generator: VerMo,
    text: String,
}

impl Bench {
    fn new(options: &Options) -> Result<Self, Failed> {
        let pack = Pack::load(&options.pack)?;
        let runtime = Runtime::new(None)?;
        let session = || {
            let options = SessionOptions {
                engine: EngineKind::Cpu,
                threads: options.threads,
                spin: false,
                fixed_shapes: false,
                growth: Growth::None,
            };
            OnnxVerMo::load(&runtime, &pack, options)
        };
        let mut generator = VerMo::new(&pack, Box::new(session()?), REQUESTS)?;
        generator.warm_up()?;
        Ok(Self {
            networks: session()?,
            generator,
            text: options.text.clone(),
            pack,
        })
    }

    /// Tokens a second of the decode graph alone, without choosing tokens or keeping their columns.
    fn bare(&mut self, sequences: usize) -> Result<f64, Failed> {
        let table = self.pack.manifest.vermo.as_ref().ok_or("no pack of VerMo")?;
        let shape = Shape::new(table);
        let logits = Vocabulary::new(table, self.pack.rig.dims.max_tokens).len();
        let (tokens, ones, start) = (vec![1; sequences], vec![1; sequences], vec![FILLED; sequences]);
        let cache = vec![0.0; sequences * shape.numbers(table.positions)];
        let call = LanguageCall {
            sequences,
            columns: 1,
            cached: table.positions,
            tokens: &tokens,
            count: &ones,
            start: &start,
            cache: &cache,
        };
        let mut answer = LanguageAnswer {
            logits: vec![0.0; sequences * logits],
            columns: vec![0.0; sequences * shape.numbers(1)],
        };
        self.networks.language(&call, &mut answer)?;
        let steps = self.pack.rig.dims.max_tokens;
        let started = Instant::now();
        for _ in 0..steps {
            self.networks.language(&call, &mut answer)?;
        }
        Ok((steps * sequences) as f64 / started.elapsed().as_secs_f64())
    }

    fn task(&self, tokens: usize, seed: usize) -> Task {
        Task::Prompt(PromptTask {
            text: self.text.clone(),
            frames: Some(tokens * self.pack.rig.dims.frames_per_token),
            seed: seed as u64,
            in_parts: true,
            ..PromptTask::default()
        })
    }

    /// Tokens a second of so many requests of these lengths, which all come at once; prompts are read and frames decoded.
    fn written(&mut self, lengths: &[usize]) -> Result<f64, Failed> {
        let started = Instant::now();
        for (request, &tokens) in lengths.iter().enumerate() {
            let task = self.task(tokens, request);
            self.generator.admit(id(request), task);
        }
        self.finish()?;
        Ok(lengths.iter().sum::<usize>() as f64 / started.elapsed().as_secs_f64())
    }

    /// The same, where a batch begins only when all of the one before are done.
    fn in_batches(&mut self, lengths: &[usize]) -> Result<f64, Failed> {
        let started = Instant::now();
        for batch in lengths.chunks(CROWD) {
            self.written(batch)?;
        }
        Ok(lengths.iter().sum::<usize>() as f64 / started.elapsed().as_secs_f64())
    }

    fn finish(&mut self) -> Result<(), EngineError> {
        let mut failed = None;
        while !self.generator.is_idle() {
            self.generator.step(&mut |_, progress| {
                if let Progress::Failed(error) = progress {
                    failed = Some(error);
                }
            })?;
        }
        failed.map_or(Ok(()), Err)
    }

    /// Milliseconds from a prompt to its first frames.
    fn first_frames(&mut self) -> Result<f64, Failed> {
        let task = self.task(self.pack.rig.dims.max_tokens, 0);
        let started = Instant::now();
        self.generator.admit(id(0), task);
        let mut took = None;
        while took.is_none() && !self.generator.is_idle() {
            self.generator.step(&mut |_, progress| {
                if matches!(progress, Progress::Part(_) | Progress::Done(_)) {
                    took = Some(started.elapsed().as_secs_f64() * 1e3);
                }
            })?;
        }
        self.generator.clear();
        took.ok_or_else(|| "the prompt gave no frames".into())
    }
}

fn id(request: usize) -> JobId {
    JobId {
        request: request as u64,
        character: 0,
    }
}

//! `troupe-eval vermo`: how fast a VerMo pack writes. Measures tokens a second alone and in
//! company, beside a bare loop over the same graph, continuous beside static batching, and the time
//! to the first frames. All figures are measured in turns, and the median of the rounds counts.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context as _;
use clap::Args;
use troupe_engine::EngineError;
use troupe_engine::families::vermo::{
    LanguageAnswer, LanguageCall, Networks as _, OnnxVerMo, Shape, VerMo, Vocabulary, table,
};
use troupe_engine::generator::{Generator as _, JobId, Progress};
use troupe_engine::onnx::{Growth, Runtime, SessionOptions};
use troupe_engine::pack::Pack;
use troupe_motion::model::{PromptTask, Task};

use super::one_thread;
use crate::figures::{mean, ms, percentile};

/// Measurements of each figure.
const ROUNDS: usize = 5;
/// Sequences that are written together.
const CROWD: usize = 32;
/// Requests of the comparison with static batching, and their tokens in turns.
const REQUESTS: usize = 96;
const LENGTHS: [usize; 6] = [4, 60, 12, 30, 8, 20];
/// Columns in the cache of the bare loop.
const FILLED: i64 = 40;

/// Measure how fast a VerMo pack writes.
#[derive(Debug, Args)]
pub(crate) struct Vermo {
    /// Folder of the pack.
    #[arg(long, default_value = "models/vermo")]
    pack: PathBuf,
    /// Text of the prompts.
    #[arg(long, default_value = "an elderly man waves with his left hand")]
    text: String,
    /// Threads of the networks.
    #[arg(long, default_value_t = 1)]
    threads: usize,
}

pub(crate) fn run(options: &Vermo) -> anyhow::Result<()> {
    let mut bench = Bench::new(options)?;
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
        let lengths: Vec<usize> = LENGTHS.iter().copied().cycle().take(REQUESTS).collect();
        let wanted = lengths.iter().sum::<usize>();
        // Every row stays until the longest is done.
        let padded = [most; REQUESTS];
        let all = &padded[..CROWD];
        let runs: [(&str, &[usize], usize, usize); 4] = [
            ("generator, 32 sequences", all, CROWD, CROWD * most),
            (
                "96 requests of mixed lengths, continuous",
                &lengths,
                REQUESTS,
                wanted,
            ),
            (
                "the same, batches of 32, rows leave when they end",
                &lengths,
                CROWD,
                wanted,
            ),
            (
                "the same, batches of 32, rows stay for the longest",
                &padded,
                CROWD,
                wanted,
            ),
        ];
        for (name, lengths, together, wanted) in runs {
            bench.shares.clear();
            bench.ended_ms.clear();
            let took_s = bench.in_batches(lengths, together)?;
            let written = wanted as f64 / took_s;
            note(&format!("{name} (tokens/s)"), written);
            note(
                &format!("{name}: a request is whole after, mean (ms)"),
                bench.whole_ms(),
            );
            for (part, took_ms) in std::mem::take(&mut bench.shares) {
                note(&format!("{name}: time of {part} (%)"), took_ms / took_s / 10.0);
            }
        }
        note("first frames after a prompt (ms)", bench.first_frames()?);
    }
    for (name, figures) in &found {
        let [low, median, high] = [0.0, 0.5, 1.0].map(|share| percentile(figures, share));
        println!("{name}: {median:.1} ({low:.1} to {high:.1})");
    }
    Ok(())
}

struct Bench {
    pack: Pack,
    networks: OnnxVerMo,
    generator: VerMo,
    text: String,
    /// Time of each part of the generator since the list was last cleared, ms.
    shares: Vec<(&'static str, f64)>,
    /// Times at which requests were whole, ms since the first request.
    ended_ms: Vec<f64>,
}

impl Bench {
    fn new(options: &Vermo) -> anyhow::Result<Self> {
        let pack = Pack::load(&options.pack)?;
        let runtime = Runtime::new(None)?;
        let session = || {
            let options = SessionOptions {
                threads: options.threads,
                ..one_thread(Growth::None)
            };
            OnnxVerMo::load(&runtime, &pack, options)
        };
        let mut generator = VerMo::new(&pack, Box::new(session()?), REQUESTS)?;
        generator.warm_up()?;
        Ok(Self {
            networks: session()?,
            generator,
            shares: Vec::new(),
            ended_ms: Vec::new(),
            text: options.text.clone(),
            pack,
        })
    }

    /// Tokens a second of the decode graph alone. No token is chosen, and no column is kept.
    fn bare(&mut self, sequences: usize) -> anyhow::Result<f64> {
        let table = table(&self.pack).context("it is no pack of VerMo")?;
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

    /// Tokens a second of requests of these lengths that come at the same time. The time includes
    /// reading prompts and decoding frames.
    fn written(&mut self, lengths: &[usize]) -> anyhow::Result<f64> {
        let started = Instant::now();
        self.write(lengths, started)?;
        Ok(lengths.iter().sum::<usize>() as f64 / started.elapsed().as_secs_f64())
    }

    /// Seconds for requests of these lengths, in groups of `together`. A group begins once the
    /// group before is done.
    fn in_batches(&mut self, lengths: &[usize], together: usize) -> anyhow::Result<f64> {
        let started = Instant::now();
        for batch in lengths.chunks(together) {
            self.write(batch, started)?;
        }
        Ok(started.elapsed().as_secs_f64())
    }

    fn whole_ms(&self) -> f64 {
        mean(&self.ended_ms)
    }

    /// Has requests of these lengths answered.
    fn write(&mut self, lengths: &[usize], started: Instant) -> Result<(), EngineError> {
        for (request, &tokens) in lengths.iter().enumerate() {
            let task = self.task(tokens, request);
            self.generator.admit(id(request), task);
        }
        let mut failed = None;
        while !self.generator.is_idle() {
            let ended_ms = &mut self.ended_ms;
            let report = self.generator.step(&mut |_, progress| match progress {
                Progress::Failed(error) => failed = Some(error),
                Progress::Done(_) => ended_ms.push(ms(started.elapsed())),
                Progress::Part(_) => {}
            })?;
            let parts = [("assemble", report.assemble), ("scatter", report.scatter)];
            for (name, took) in parts.into_iter().chain(report.networks) {
                let took_ms = ms(took);
                match self.shares.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, sum)) => *sum += took_ms,
                    None => self.shares.push((name, took_ms)),
                }
            }
        }
        failed.map_or(Ok(()), Err)
    }

    /// Milliseconds from a prompt to its first frames.
    fn first_frames(&mut self) -> anyhow::Result<f64> {
        let task = self.task(self.pack.rig.dims.max_tokens, 0);
        let started = Instant::now();
        self.generator.admit(id(0), task);
        let mut took = None;
        while took.is_none() && !self.generator.is_idle() {
            self.generator.step(&mut |_, progress| {
                if matches!(progress, Progress::Part(_) | Progress::Done(_)) {
                    took = Some(ms(started.elapsed()));
                }
            })?;
        }
        self.generator.clear();
        took.context("the prompt gave no frames")
    }
}

fn id(request: usize) -> JobId {
    JobId {
        request: request as u64,
        character: 0,
    }
}

//! How fast a UniMoGen pack is, by engine: accuracy beside f32, one motion alone, batches of many
//! bodies, the same padded to the largest body, and a profile.
//!
//! `cargo run --release -p troupe-engine --example unimogen -- --engine openvino-bf16`

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Parser;
use troupe_engine::accuracy::compare_paths;
use troupe_engine::families::unimogen::{CALL_ROWS, Call, Denoiser, ROW_CHANNELS, UniMoGen, probe_task};
use troupe_engine::generator::{Generator as _, JobId, Progress};
use troupe_engine::machine::available_cores;
use troupe_engine::onnx::{Growth, OnnxDenoiser, Runtime, SessionOptions};
use troupe_engine::pack::Pack;
use troupe_engine::{EngineChoice, EngineError, EngineKind};
use troupe_motion::model::{PathTask, SLOTS};

/// Of the kernel's clock ticks.
const TICKS_PER_S: f64 = 100.0;
/// How often everything is measured, in turns.
const ROUNDS: usize = 3;
/// Characters of calls that are compared, and motions that are made for each.
const PEOPLE: [usize; 4] = [1, 2, 4, 8];
const PEOPLE_RUNS: usize = 16;
/// Rows of calls that are compared.
const CALLS: [usize; 5] = [1, 100, 200, 400, 1600];

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Measures a UniMoGen pack.
#[derive(Parser)]
struct Options {
    /// The pack's folder.
    #[arg(long, default_value = "models/unimogen")]
    pack: PathBuf,
    /// The engine; auto is the CPU in f32.
    #[arg(long, value_enum, default_value = "auto")]
    engine: EngineChoice,
    /// Workers side by side, a thread each; 0 for as many as cores.
    #[arg(long, default_value_t = 0)]
    workers: usize,
}

fn main() -> Result<(), Failed> {
    let options = Options::parse();
    let pack = Pack::load(&options.pack)?;
    let engine = options.engine.named().unwrap_or(EngineKind::Cpu);
    let workers = match options.workers {
        0 => available_cores(),
        workers => workers,
    };
    let bench = Bench {
        runtime: Runtime::new(None)?,
        frames: pack.rig.dims.max_frames(),
        pack,
        engine,
    };
    println!(
        "{} on {engine}, {} frames, the pack's sampler steps; {workers} workers of one thread, {} cores",
        bench.pack.name(),
        bench.frames,
        available_cores()
    );
    if engine != EngineKind::Cpu {
        bench.accuracy()?;
    }
    bench.alone(workers)?;
    for jobs in [8, 32] {
        bench.mixed(jobs, workers)?;
    }
    bench.profile()?;
    bench.people()?;
    bench.call_sizes()
}

struct Bench {
    runtime: Runtime,
    pack: Pack,
    engine: EngineKind,
    frames: usize,
}

impl Bench {
    fn denoiser(&self, threads: usize) -> Result<Box<dyn Denoiser>, EngineError> {
        let options = SessionOptions {
            engine: self.engine,
            threads,
            spin: false,
            fixed_shapes: false,
            growth: Growth::None,
        };
        Ok(Box::new(OnnxDenoiser::load(&self.runtime, &self.pack, options)?))
    }

    fn generator(&self, threads: usize) -> Result<UniMoGen, EngineError> {
        let mut generator = UniMoGen::new(&self.pack, self.denoiser(threads)?, 64)?;
        generator.warm_up(&self.pack)?;
        Ok(generator)
    }

    /// Tasks of all bodies in turns, without guidance.
    fn tasks(&self, count: usize) -> Vec<PathTask> {
        let unguided = |task| PathTask {
            guidance: 1.0,
            ..task
        };
        (0..count)
            .filter_map(|index| probe_task(&self.pack, index, self.frames).map(unguided))
            .collect()
    }

    /// How far the engine is from f32.
    fn accuracy(&self) -> Result<(), Failed> {
        let reference = Self {
            runtime: self.runtime.clone(),
            pack: self.pack.clone(),
            engine: EngineKind::Cpu,
            frames: self.frames,
        };
        let started = Instant::now();
        let accuracy = compare_paths(&self.pack, reference.denoiser(1)?, self.denoiser(1)?)?;
        println!(
            "\naccuracy, {} characters, {:.1} s:",
            accuracy.characters,
            started.elapsed().as_secs_f64()
        );
        for bar in accuracy.bars() {
            println!("  {bar}");
        }
        Ok(())
    }

    /// One motion at a time, of each body.
    fn alone(&self, threads: usize) -> Result<(), Failed> {
        println!("\none motion alone, ms: one thread (and its CPU time), {threads} threads");
        let mut generators = [self.generator(1)?, self.generator(threads)?];
        for task in self.tasks(self.pack.bodies.len()) {
            let took = generators
                .each_mut()
                .map(|generator| best(|| generator.run(std::slice::from_ref(&task)).map(|_| ())));
            let [one, more] = took;
            let cpu = process_cpu_s();
            for _ in 0..ROUNDS {
                generators[0].run(std::slice::from_ref(&task))?;
            }
            let cpu_ms = (process_cpu_s() - cpu) * 1000.0 / ROUNDS as f64;
            println!(
                "  {:8} {:3} joints {:7.1} ({cpu_ms:5.1}) {:7.1}",
                task.body.name,
                task.body.joints(),
                ms(one?),
                ms(more?)
            );
        }
        Ok(())
    }

    /// Many motions of mixed bodies, ragged and padded in turns, on all workers.
    fn mixed(&self, jobs: usize, workers: usize) -> Result<(), Failed> {
        let largest = self
            .pack
            .bodies
            .iter()
            .map(|body| body.row_count())
            .max()
            .unwrap_or(1);
        let tasks = self.tasks(jobs);
        let rows: usize = tasks.iter().map(|task| task.body.row_count()).sum();
        let mut ragged = Vec::new();
        let mut padded = Vec::new();
        for _ in 0..workers {
            ragged.push(self.generator(1)?);
            let denoiser = Padded {
                inner: self.denoiser(1)?,
                rows: largest,
                call: Call::default(),
                clean: Vec::new(),
            };
            // As many characters a call as the ragged one has.
            padded.push(UniMoGen::new(&self.pack, Box::new(denoiser), 64)?);
        }
        let mut speeds = [Vec::new(), Vec::new()];
        let mut cpu_s = [0.0, 0.0];
        for _ in 0..ROUNDS {
            for ((generators, speeds), cpu_s) in [&mut ragged, &mut padded]
                .into_iter()
                .zip(&mut speeds)
                .zip(&mut cpu_s)
            {
                let (started, cpu) = (Instant::now(), process_cpu_s());
                std::thread::scope(|scope| {
                    let running: Vec<_> = (generators.iter_mut())
                        .map(|generator| scope.spawn(|| generator.run(&tasks).map(|_| ())))
                        .collect();
                    running
                        .into_iter()
                        .try_for_each(|run| run.join().unwrap_or(Err(EngineError::Stopped)))
                })?;
                speeds.push((jobs * workers) as f64 / started.elapsed().as_secs_f64());
                *cpu_s += process_cpu_s() - cpu;
            }
        }
        let [ragged, padded] = speeds.map(|speeds| median(&speeds));
        let [ragged_cpu, padded_cpu] = cpu_s.map(|s| (jobs * workers * ROUNDS) as f64 / s);
        println!(
            "\n{jobs} motions a worker, {rows} rows: {ragged:.1} motions/s, {ragged_cpu:.1} a second of CPU time\n  padded to {} rows: \
             {padded:.1} motions/s, {padded_cpu:.1} a second of CPU time",
            largest * jobs
        );
        Ok(())
    }

    /// Where the time of a batch goes.
    fn profile(&self) -> Result<(), Failed> {
        let mut generator = self.generator(1)?;
        let (mut assemble, mut network, mut scatter) = (Duration::ZERO, Duration::ZERO, Duration::ZERO);
        let (mut admit, mut calls) = (Duration::ZERO, 0);
        let tasks = self.tasks(32);
        for (index, task) in tasks.iter().enumerate() {
            let started = Instant::now();
            let id = JobId {
                request: index as u64,
                character: 0,
            };
            generator.admit(id, task.clone().into());
            admit += started.elapsed();
        }
        while !generator.is_idle() {
            let report = generator.step(&mut |_, progress| {
                if let Progress::Failed(error) = progress {
                    println!("failed: {error}");
                }
            })?;
            assemble += report.assemble;
            network += report.inference();
            scatter += report.scatter;
            calls += 1;
        }
        let each = |part: Duration| ms(part) / tasks.len() as f64;
        println!(
            "\nprofile, ms a motion: noise and keyframes {:.2}, assemble {:.2}, network {:.2} ({calls} calls), scatter and decode {:.2}",
            each(admit),
            each(assemble),
            each(network),
            each(scatter)
        );
        Ok(())
    }

    /// What a row costs, by characters of a call: all of the pack's default body.
    fn people(&self) -> Result<(), Failed> {
        let Some(body) = self.pack.body("") else {
            return Ok(());
        };
        println!("\n{}, CPU ms of a row, by characters of a call:", body.name);
        let mut generator = self.generator(1)?.with_call_rows(usize::MAX);
        for count in PEOPLE {
            let mut tasks = self.tasks(count);
            for task in &mut tasks {
                task.body = body.clone();
                task.context.clear();
            }
            generator.run(&tasks)?;
            let cpu = process_cpu_s();
            for _ in 0..PEOPLE_RUNS / count {
                generator.run(&tasks)?;
            }
            let steps = tasks.first().map_or(1, |task| task.steps as usize);
            let rows = PEOPLE_RUNS / count * count * steps * body.row_count();
            println!(
                "  {count:5}: {:.2}",
                (process_cpu_s() - cpu) * 1000.0 / rows as f64
            );
        }
        Ok(())
    }

    /// Small calls and large ones, on one worker.
    fn call_sizes(&self) -> Result<(), Failed> {
        println!(
            "\n32 motions on one worker, motions/s (and a second of CPU time), by rows of a call (the server's calls have {CALL_ROWS}):"
        );
        let tasks = self.tasks(32);
        let mut generators = Vec::new();
        for rows in CALLS {
            generators.push((rows, self.generator(1)?.with_call_rows(rows), Vec::new(), 0.0));
        }
        for _ in 0..ROUNDS {
            for (_, generator, speeds, cpu_s) in &mut generators {
                let (started, cpu) = (Instant::now(), process_cpu_s());
                generator.run(&tasks)?;
                *cpu_s += process_cpu_s() - cpu;
                speeds.push(tasks.len() as f64 / started.elapsed().as_secs_f64());
            }
        }
        for (rows, _, speeds, cpu_s) in &generators {
            let a_cpu_s = (tasks.len() * ROUNDS) as f64 / cpu_s;
            println!("  {rows:5} rows: {:.1} ({a_cpu_s:.1})", median(speeds));
        }
        Ok(())
    }
}

/// Runs each character with as many rows as the largest body has.
struct Padded {
    inner: Box<dyn Denoiser>,
    rows: usize,
    call: Call,
    clean: Vec<f32>,
}

impl Denoiser for Padded {
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError> {
        let row = call.frames * ROW_CHANNELS;
        let mut padded = Call {
            frames: call.frames,
            words: call.words,
            given: call.given.clone(),
            path: call.path.clone(),
            step: call.step.clone(),
            style: call.style.clone(),
            ..std::mem::take(&mut self.call)
        };
        let described = call.description.len() / call.row_count().max(1);
        let count = call.characters() * self.rows;
        padded.x.clear();
        padded.x.resize(count * row, 0.0);
        padded.description.clear();
        padded.description.resize(count * described, 0.0);
        padded.reads.clear();
        padded.reads.resize(count * SLOTS, 0.0);
        padded.owner = (0..count).map(|row| (row / self.rows) as i64).collect();
        // Padding reads itself.
        padded.rows = (0..count).flat_map(|row| [row as i64; SLOTS]).collect();
        for read in padded.reads.chunks_exact_mut(SLOTS) {
            read[0] = 1.0;
        }
        let mut places = Vec::with_capacity(call.row_count());
        let (mut first, mut last) = (0, -1);
        for (from, &owner) in call.owner.iter().enumerate() {
            if owner != last {
                (first, last) = (from, owner);
            }
            let to = owner as usize * self.rows + (from - first);
            places.push(to);
            padded.x[to * row..(to + 1) * row].copy_from_slice(&call.x[from * row..(from + 1) * row]);
            padded.description[to * described..(to + 1) * described]
                .copy_from_slice(&call.description[from * described..(from + 1) * described]);
            for slot in 0..SLOTS {
                let read = call.rows[from * SLOTS + slot] as usize - first + owner as usize * self.rows;
                padded.rows[to * SLOTS + slot] = read as i64;
                padded.reads[to * SLOTS + slot] = call.reads[from * SLOTS + slot];
            }
        }
        self.clean.resize(padded.x.len(), 0.0);
        self.inner.denoise(&padded, &mut self.clean)?;
        for (clean, to) in clean.chunks_exact_mut(row).zip(places) {
            clean.copy_from_slice(&self.clean[to * row..(to + 1) * row]);
        }
        self.call = padded;
        Ok(())
    }
}

/// The shortest of a few runs.
fn best(mut run: impl FnMut() -> Result<(), EngineError>) -> Result<Duration, EngineError> {
    let mut best = Duration::MAX;
    for _ in 0..ROUNDS {
        let started = Instant::now();
        run()?;
        best = best.min(started.elapsed());
    }
    Ok(best)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// CPU time of this process, which says more than the clock where others use the machine.
fn process_cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // utime and stime, after the command's closing parenthesis.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    let ticks: f64 = fields
        .skip(11)
        .take(2)
        .filter_map(|field| field.parse::<f64>().ok())
        .sum();
    ticks / TICKS_PER_S
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

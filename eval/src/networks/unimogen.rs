//! `troupe-eval unimogen`: how fast a UniMoGen pack is. Measures accuracy beside f32, one motion
//! alone, batches of many bodies, the same padded to the largest body, and a profile.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use troupe_engine::accuracy::compare_paths;
use troupe_engine::families::unimogen::{CALL_ROWS, Call, Denoiser, ROW_CHANNELS, UniMoGen, probe_task};
use troupe_engine::generator::{Generator as _, JobId, Progress};
use troupe_engine::machine::available_cores;
use troupe_engine::onnx::{Growth, OnnxDenoiser, Runtime, SessionOptions};
use troupe_engine::pack::Pack;
use troupe_engine::{EngineChoice, EngineError, EngineKind};
use troupe_motion::model::{PathTask, SLOTS};

use super::one_thread;
use crate::figures::{cpu_seconds, ms, percentile};

/// Measurements of each figure, in turns.
const ROUNDS: usize = 3;
/// Characters of the calls that are compared, and motions made with each.
const PEOPLE: [usize; 4] = [1, 2, 4, 8];
const PEOPLE_RUNS: usize = 16;
/// Rows of the calls that are compared.
const CALLS: [usize; 5] = [1, 100, 200, 400, 1600];

/// Measure how fast a UniMoGen pack is, by engine.
#[derive(Debug, Args)]
pub(crate) struct Unimogen {
    /// Folder of the pack.
    #[arg(long, default_value = "models/unimogen")]
    pack: PathBuf,
    /// Engine; auto is the CPU in f32.
    #[arg(long, value_enum, default_value = "auto")]
    engine: EngineChoice,
    /// Workers side by side, of one thread each; 0 for one a core.
    #[arg(long, default_value_t = 0)]
    workers: usize,
}

pub(crate) fn run(options: &Unimogen) -> anyhow::Result<()> {
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
            ..one_thread(Growth::None)
        };
        Ok(Box::new(OnnxDenoiser::load(&self.runtime, &self.pack, options)?))
    }

    fn generator(&self, threads: usize) -> Result<UniMoGen, EngineError> {
        let mut generator = UniMoGen::new(&self.pack, self.denoiser(threads)?, 64)?;
        generator.warm_up(&self.pack)?;
        Ok(generator)
    }

    /// Tasks without guidance, of all bodies in turns.
    fn tasks(&self, count: usize) -> Vec<PathTask> {
        let unguided = |task| PathTask {
            guidance: 1.0,
            ..task
        };
        (0..count)
            .filter_map(|index| probe_task(&self.pack, index, self.frames).map(unguided))
            .collect()
    }

    /// The error of the engine beside f32.
    fn accuracy(&self) -> anyhow::Result<()> {
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
    fn alone(&self, threads: usize) -> anyhow::Result<()> {
        println!("\none motion alone, ms: one thread (and its CPU time), {threads} threads");
        let mut generators = [self.generator(1)?, self.generator(threads)?];
        for task in self.tasks(self.pack.bodies.len()) {
            let took = generators
                .each_mut()
                .map(|generator| best(|| generator.run(std::slice::from_ref(&task)).map(|_| ())));
            let [one, more] = took;
            let cpu = cpu_seconds("self")?;
            for _ in 0..ROUNDS {
                generators[0].run(std::slice::from_ref(&task))?;
            }
            let cpu_ms = (cpu_seconds("self")? - cpu) * 1000.0 / ROUNDS as f64;
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
    fn mixed(&self, jobs: usize, workers: usize) -> anyhow::Result<()> {
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
            // Its calls have as many characters as the ragged ones.
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
                let (started, cpu) = (Instant::now(), cpu_seconds("self")?);
                std::thread::scope(|scope| {
                    let running: Vec<_> = (generators.iter_mut())
                        .map(|generator| scope.spawn(|| generator.run(&tasks).map(|_| ())))
                        .collect();
                    running
                        .into_iter()
                        .try_for_each(|run| run.join().unwrap_or(Err(EngineError::Stopped)))
                })?;
                speeds.push((jobs * workers) as f64 / started.elapsed().as_secs_f64());
                *cpu_s += cpu_seconds("self")? - cpu;
            }
        }
        let [ragged, padded] = speeds.map(|speeds| percentile(&speeds, 0.5));
        let [ragged_cpu, padded_cpu] = cpu_s.map(|s| (jobs * workers * ROUNDS) as f64 / s);
        println!(
            "\n{jobs} motions a worker, {rows} rows: {ragged:.1} motions/s, {ragged_cpu:.1} a second of CPU time\n  padded to {} rows: \
             {padded:.1} motions/s, {padded_cpu:.1} a second of CPU time",
            largest * jobs
        );
        Ok(())
    }

    /// The time of a batch by its parts.
    fn profile(&self) -> anyhow::Result<()> {
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

    /// The cost of a row by characters of a call. All have the pack's default body.
    fn people(&self) -> anyhow::Result<()> {
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
            let cpu = cpu_seconds("self")?;
            for _ in 0..PEOPLE_RUNS / count {
                generator.run(&tasks)?;
            }
            let steps = tasks.first().map_or(1, |task| task.steps as usize);
            let rows = PEOPLE_RUNS / count * count * steps * body.row_count();
            println!(
                "  {count:5}: {:.2}",
                (cpu_seconds("self")? - cpu) * 1000.0 / rows as f64
            );
        }
        Ok(())
    }

    /// The speed of one worker by rows of a call.
    fn call_sizes(&self) -> anyhow::Result<()> {
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
                let (started, cpu) = (Instant::now(), cpu_seconds("self")?);
                generator.run(&tasks)?;
                *cpu_s += cpu_seconds("self")? - cpu;
                speeds.push(tasks.len() as f64 / started.elapsed().as_secs_f64());
            }
        }
        for (rows, _, speeds, cpu_s) in &generators {
            let a_cpu_s = (tasks.len() * ROUNDS) as f64 / cpu_s;
            println!("  {rows:5} rows: {:.1} ({a_cpu_s:.1})", percentile(speeds, 0.5));
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
        // Padding rows read themselves.
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

/// The shortest time of [`ROUNDS`] runs.
fn best(mut run: impl FnMut() -> Result<(), EngineError>) -> Result<Duration, EngineError> {
    let mut best = Duration::MAX;
    for _ in 0..ROUNDS {
        let started = Instant::now();
        run()?;
        best = best.min(started.elapsed());
    }
    Ok(best)
}

//! A pack's networks, loaded and warmed up as the server does it, and how fast they are for a
//! moment.

use std::sync::Barrier;
use std::time::{Duration, Instant};

use serde::Serialize;

use troupe_engine::pack::{Pack, UNIMOGEN, VERMO};
use troupe_engine::unimogen::probe_task;
use troupe_engine::{EngineError, EngineKind, Pipeline, RawLoop, Selector, UniMoGen, VerMo, Workers};
use troupe_motion::model::PathTask;

/// Time for one measurement.
const MOMENT: Duration = Duration::from_millis(200);
/// Batch sizes that are measured, as far as the server makes them.
const BATCHES: [usize; 3] = [1, 8, 32];
/// Frames of a plan of a live session, where the pack makes such.
const USUAL_FRAMES: usize = 36;

/// What was measured of a pack.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Until the networks of all workers were loaded, seconds.
    pub load_s: f64,
    /// From there until all shapes had run on all workers, seconds.
    pub warm_up_s: f64,
    /// Frames of the plans that were made.
    pub frames: usize,
    /// The networks alone, by workers and batch size; of a UniMoGen pack, all steps of the sampler;
    /// of a VerMo pack, whole answers.
    pub speeds: Vec<Speed>,
}

/// The speed of one size.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Speed {
    /// The workers.
    pub workers: Workers,
    /// Characters of a batch.
    pub batch: usize,
    /// Time of one batch, milliseconds.
    pub batch_ms: f64,
    /// Characters a second, over all workers.
    pub plans_per_s: f64,
}

impl Trial {
    /// Loads, warms up and measures.
    pub(super) fn run(
        selector: &Selector,
        pack: &Pack,
        engine: EngineKind,
        max_batch: usize,
    ) -> Result<Self, EngineError> {
        let mut trial = Self {
            load_s: 0.0,
            warm_up_s: 0.0,
            frames: USUAL_FRAMES.clamp(pack.rig.dims.min_frames(), pack.rig.dims.max_frames()),
            speeds: Vec::new(),
        };
        let workers = selector.workers;
        let loading = Instant::now();
        let loaded = on_workers(0..workers.count, |_| {
            Loaded::load(selector, pack, engine, max_batch)
        })?;
        let warming = Instant::now();
        let warm = on_workers(loaded, |loaded| loaded.warm_up(pack))?;
        trial.load_s = (warming - loading).as_secs_f64();
        trial.warm_up_s = warming.elapsed().as_secs_f64();

        let frames = trial.frames;
        let loops = |loaded: Vec<Loaded>| {
            let loops = loaded
                .into_iter()
                .map(|loaded| loaded.into_loop(pack, max_batch, frames));
            loops.collect::<Vec<_>>()
        };
        trial.measure(pack, workers, loops(warm), max_batch)?;
        if workers.count > 1 {
            let one = Workers {
                count: 1,
                threads: workers.count * workers.threads,
            };
            let selector = Selector {
                workers: one,
                ..selector.clone()
            };
            let alone = Loaded::load(&selector, pack, engine, max_batch)?;
            trial.measure(pack, one, loops(vec![alone]), max_batch)?;
        }
        Ok(trial)
    }

    fn measure(
        &mut self,
        pack: &Pack,
        workers: Workers,
        mut loops: Vec<Loop>,
        max_batch: usize,
    ) -> Result<(), EngineError> {
        for batch in BATCHES.into_iter().filter(|&batch| batch <= max_batch) {
            let barrier = Barrier::new(loops.len());
            let runs = on_workers(loops.iter_mut(), |worker| {
                worker.set_batch(pack, batch, self.frames);
                let warm = worker.run();
                // Every worker comes here, whatever became of it.
                barrier.wait();
                warm?;
                let (started, mut runs) = (Instant::now(), 0);
                while started.elapsed() < MOMENT {
                    worker.run()?;
                    runs += 1;
                }
                Ok(f64::from(runs) / started.elapsed().as_secs_f64())
            })?;
            let batches_per_s: f64 = runs.iter().sum();
            self.speeds.push(Speed {
                workers,
                batch,
                batch_ms: 1000.0 * workers.count as f64 / batches_per_s,
                plans_per_s: batches_per_s * batch as f64,
            });
        }
        Ok(())
    }
}

/// The networks of one worker, by family.
enum Loaded {
    Stages(Box<Pipeline>),
    Paths(Box<UniMoGen>),
    Words(Box<VerMo>),
}

impl Loaded {
    fn load(
        selector: &Selector,
        pack: &Pack,
        engine: EngineKind,
        max_batch: usize,
    ) -> Result<Self, EngineError> {
        match pack.manifest.family.as_str() {
            UNIMOGEN => {
                let denoiser = Box::new(selector.load_denoiser(pack, engine)?);
                Ok(Self::Paths(Box::new(UniMoGen::new(pack, denoiser, max_batch)?)))
            }
            VERMO => {
                let networks = Box::new(selector.load_vermo(pack, engine)?);
                Ok(Self::Words(Box::new(VerMo::new(pack, networks, max_batch)?)))
            }
            _ => {
                let stages = Box::new(selector.load(pack, engine)?);
                let pipeline = Pipeline::new(pack.rig.dims, stages, max_batch);
                Ok(Self::Stages(Box::new(pipeline)))
            }
        }
    }

    fn warm_up(mut self, pack: &Pack) -> Result<Self, EngineError> {
        match &mut self {
            Self::Stages(pipeline) => pipeline.warm_up()?,
            Self::Paths(generator) => generator.warm_up(pack)?,
            Self::Words(generator) => generator.warm_up()?,
        }
        Ok(self)
    }

    fn into_loop(self, pack: &Pack, max_batch: usize, frames: usize) -> Loop {
        match self {
            Self::Stages(pipeline) => {
                let stages = pipeline.into_stages();
                let raw = RawLoop::new(&pack.rig.dims, stages, max_batch, frames);
                Loop::Stages(Box::new(raw))
            }
            Self::Paths(generator) => Loop::Paths(generator, Vec::new()),
            Self::Words(generator) => Loop::Words(generator, 0, frames),
        }
    }
}

/// Runs batches of one size again and again.
enum Loop {
    Stages(Box<RawLoop>),
    Paths(Box<UniMoGen>, Vec<PathTask>),
    /// With the jobs of a batch, and the frames of each.
    Words(Box<VerMo>, usize, usize),
}

impl Loop {
    /// Batches of so many characters; of a pack with many bodies, these in turns.
    fn set_batch(&mut self, pack: &Pack, batch: usize, frames: usize) {
        match self {
            Self::Stages(stages) => stages.set_shape(&pack.rig.dims, batch, frames),
            Self::Paths(_, tasks) => {
                *tasks = (0..batch)
                    .filter_map(|index| probe_task(pack, index, frames))
                    .collect();
            }
            Self::Words(_, jobs, _) => *jobs = batch,
        }
    }

    fn run(&mut self) -> Result<(), EngineError> {
        match self {
            Self::Stages(stages) => stages.run().map(|_| ()),
            Self::Paths(generator, tasks) => generator.run(tasks).map(|_| ()),
            Self::Words(generator, jobs, frames) => generator.run_trial(*jobs, *frames).map(|_| ()),
        }
    }
}

/// Runs `work` on a thread for each item, all at the same time.
fn on_workers<I: Send, T: Send>(
    items: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> Result<T, EngineError> + Sync,
) -> Result<Vec<T>, EngineError> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = items.into_iter().map(|item| scope.spawn(|| work(item))).collect();
        threads
            .into_iter()
            .map(|thread| thread.join().unwrap_or(Err(EngineError::Stopped)))
            .collect()
    })
}

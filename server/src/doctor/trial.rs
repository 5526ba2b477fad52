//! Loads and warms up a pack's networks like the server, and measures their speed for a moment.

use std::sync::Barrier;
use std::time::{Duration, Instant};

use serde::Serialize;

use troupe_engine::pack::Pack;
use troupe_engine::{EngineError, EngineKind, NetworkLoop, Networks, Selector, Workers};

/// Duration of one measurement.
const MOMENT: Duration = Duration::from_millis(200);
/// Batch sizes to measure, up to the largest that the server uses.
const BATCHES: [usize; 3] = [1, 8, 32];
/// Frames of a live session's plan, if the pack can make such plans.
const USUAL_FRAMES: usize = 36;

/// Measurements of one pack.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Time to load the networks of all workers, seconds.
    pub load_s: f64,
    /// Time after that until all shapes had run on all workers, seconds.
    pub warm_up_s: f64,
    /// Frames of the measured plans.
    pub frames: usize,
    /// Speed of the networks alone, by workers and batch size. For packs with a sampler it includes
    /// all steps, for packs with a language model whole answers.
    pub speeds: Vec<Speed>,
}

/// The speed at one batch size.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Speed {
    /// Threads that ran such batches at the same time.
    pub workers: Workers,
    /// Characters in a batch.
    pub batch: usize,
    /// Time of one batch, milliseconds.
    pub batch_ms: f64,
    /// Characters per second, over all workers.
    pub plans_per_s: f64,
}

impl Trial {
    /// Loads, warms up and measures a pack.
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
        let loaded = on_workers(0..workers.count, |_| selector.networks(pack, engine, max_batch))?;
        let warming = Instant::now();
        let warm = on_workers(loaded, |mut loaded| loaded.warm_up(pack).map(|()| loaded))?;
        trial.load_s = (warming - loading).as_secs_f64();
        trial.warm_up_s = warming.elapsed().as_secs_f64();

        let frames = trial.frames;
        let loops = |loaded: Vec<Networks>| {
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
            let alone = selector.networks(pack, engine, max_batch)?;
            trial.measure(pack, one, loops(vec![alone]), max_batch)?;
        }
        Ok(trial)
    }

    fn measure(
        &mut self,
        pack: &Pack,
        workers: Workers,
        mut loops: Vec<NetworkLoop>,
        max_batch: usize,
    ) -> Result<(), EngineError> {
        for batch in BATCHES.into_iter().filter(|&batch| batch <= max_batch) {
            let barrier = Barrier::new(loops.len());
            let runs = on_workers(loops.iter_mut(), |worker| {
                worker.set_batch(pack, batch, self.frames);
                let warm = worker.run();
                // Every worker must reach the barrier, even after an error.
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

/// Runs `work` for each item on a thread of its own, all at the same time.
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

//! The networks of one worker, without scheduler and jobs: to be loaded, warmed up and timed.

use troupe_motion::model::PathTask;

use crate::pack::{Family, Pack};
use crate::select::known;
use crate::sonic_planner::{self, SonicPlanner};
use crate::unimogen::{UniMoGen, probe_task};
use crate::vermo::VerMo;
use crate::{EngineError, EngineKind, Pipeline, RawLoop, Selector};

/// The networks of one worker, whatever the pack's family.
pub struct Networks(Loaded);

enum Loaded {
    Stages(Box<Pipeline>),
    Paths(Box<UniMoGen>),
    Words(Box<VerMo>),
    Plans(Box<SonicPlanner>),
}

impl Selector {
    /// Loads the networks of one worker for batches of up to `max_batch`, with the options of a
    /// server, but does not warm them up.
    ///
    /// # Errors
    /// [`EngineError`] if the engine does not know the family, or the networks do not load.
    pub fn networks(
        &self,
        pack: &Pack,
        engine: EngineKind,
        max_batch: usize,
    ) -> Result<Networks, EngineError> {
        let loaded = match known(pack)? {
            Family::UniMoGen => {
                let denoiser = Box::new(self.load_denoiser(pack, engine)?);
                Loaded::Paths(Box::new(UniMoGen::new(pack, denoiser, max_batch)?))
            }
            Family::VerMo => {
                let networks = Box::new(self.load_language(pack, engine)?);
                Loaded::Words(Box::new(VerMo::new(pack, networks, max_batch)?))
            }
            Family::SonicPlanner => {
                let planner = Box::new(self.load_planner(pack, engine)?);
                Loaded::Plans(Box::new(SonicPlanner::new(pack, planner, max_batch)?))
            }
            Family::MotionBricks => {
                let stages = Box::new(self.load(pack, engine)?);
                Loaded::Stages(Box::new(Pipeline::new(pack.rig.dims, stages, max_batch)))
            }
        };
        Ok(Networks(loaded))
    }
}

impl Networks {
    /// Warms up as a server does before it serves.
    ///
    /// # Errors
    /// [`EngineError`] if a network fails.
    pub fn warm_up(&mut self, pack: &Pack) -> Result<(), EngineError> {
        match &mut self.0 {
            Loaded::Stages(pipeline) => pipeline.warm_up(),
            Loaded::Paths(generator) => generator.warm_up(pack),
            Loaded::Words(generator) => generator.warm_up(),
            Loaded::Plans(generator) => generator.warm_up(pack),
        }
    }

    /// A loop over batches of motions of `frames` frames. Call
    /// [`set_batch`](NetworkLoop::set_batch) before the first run.
    pub fn into_loop(self, pack: &Pack, max_batch: usize, frames: usize) -> NetworkLoop {
        NetworkLoop(match self.0 {
            Loaded::Stages(pipeline) => {
                let stages = pipeline.into_stages();
                let raw = RawLoop::new(&pack.rig.dims, stages, max_batch, frames);
                Looped::Stages(Box::new(raw))
            }
            Loaded::Paths(generator) => Looped::Paths(generator, Vec::new()),
            Loaded::Words(generator) => Looped::Words(generator, 0, frames),
            Loaded::Plans(generator) => Looped::Plans(generator, Vec::new()),
        })
    }
}

/// Runs batches of one size repeatedly.
pub struct NetworkLoop(Looped);

enum Looped {
    Stages(Box<RawLoop>),
    Paths(Box<UniMoGen>, Vec<PathTask>),
    /// With the number of jobs of a batch, and the frames of each.
    Words(Box<VerMo>, usize, usize),
    Plans(Box<SonicPlanner>, Vec<PathTask>),
}

impl NetworkLoop {
    /// Sets the number of characters of the following batches. If the pack has several bodies, the
    /// characters take them in turns.
    pub fn set_batch(&mut self, pack: &Pack, batch: usize, frames: usize) {
        match &mut self.0 {
            Looped::Stages(stages) => stages.set_shape(&pack.rig.dims, batch, frames),
            Looped::Paths(_, tasks) => {
                *tasks = (0..batch)
                    .filter_map(|index| probe_task(pack, index, frames))
                    .collect();
            }
            Looped::Words(_, jobs, _) => *jobs = batch,
            Looped::Plans(_, tasks) => {
                *tasks = (0..batch)
                    .filter_map(|index| sonic_planner::probe_task(pack, index, frames))
                    .collect();
            }
        }
    }

    /// Runs one batch: the three stages, all steps of a sampler, or whole answers of a language
    /// model.
    ///
    /// # Errors
    /// [`EngineError`] if a network fails.
    pub fn run(&mut self) -> Result<(), EngineError> {
        match &mut self.0 {
            Looped::Stages(stages) => stages.run().map(|_| ()),
            Looped::Paths(generator, tasks) => generator.run(tasks).map(|_| ()),
            Looped::Plans(generator, tasks) => generator.run(tasks).map(|_| ()),
            Looped::Words(generator, jobs, frames) => generator.run_trial(*jobs, *frames).map(|_| ()),
        }
    }
}

//! UniMoGen as a [`Generator`]: a step is one call of the network, for the oldest job and for
//! others that fit into the same call.

use std::time::Instant;

use troupe_motion::model::{Dims, Motion, Output, PathTask, Task, all_finite};

use super::batch::Call;
use super::job::{Job, check};
use super::network::Denoiser;
use super::probe::probe_task;
use super::rows::Coding;
use super::schedule::Schedule;
use crate::generator::{Generator, JobId, Progress, StepReport, run_paths, time_path};
use crate::pack::Pack;
use crate::{EngineError, TrialRun};

/// Most rows of a call. A larger job has a call of its own. On CPUs a row costs least in the
/// smallest call, whose numbers stay in the core's cache: 0.36 ms for one person, 0.66 ms for eight
/// (f32, 68 frames; `cargo run --release -p troupe-eval -- unimogen`).
pub const CALL_ROWS: usize = 1;

/// Frames of a live character's window.
pub(crate) const LIVE_FRAMES: usize = 36;

/// The family's generator for one worker.
pub struct UniMoGen {
    coding: Coding,
    schedule: Schedule,
    dims: Dims,
    words: usize,
    /// Names of the networks' files.
    files: Vec<&'static str>,
    denoiser: Box<dyn Denoiser>,
    max_jobs: usize,
    call_rows: usize,
    /// The jobs in progress, the oldest first.
    jobs: Vec<Job>,
    /// Tasks that cannot be done; the next step reports them.
    refused: Vec<(JobId, EngineError)>,
    call: Call,
    clean: Vec<f32>,
    trial: Option<TrialRun>,
}

impl UniMoGen {
    /// A generator for a pack. It holds up to `max_jobs` jobs.
    ///
    /// # Errors
    /// [`EngineError::WrongTask`] if the pack belongs to another family.
    pub fn new(pack: &Pack, denoiser: Box<dyn Denoiser>, max_jobs: usize) -> Result<Self, EngineError> {
        let table = pack.manifest.unimogen.as_ref().ok_or(EngineError::WrongTask)?;
        Ok(Self {
            coding: Coding::new(table, pack.manifest.fps),
            schedule: Schedule::new(&table.signal),
            dims: pack.rig.dims,
            words: table.words.len(),
            files: pack.files(),
            denoiser,
            max_jobs: max_jobs.max(1),
            call_rows: CALL_ROWS,
            jobs: Vec::new(),
            refused: Vec::new(),
            call: Call::default(),
            clean: Vec::new(),
            trial: None,
        })
    }

    /// The same generator, with calls of up to `call_rows` rows.
    #[must_use]
    pub fn with_call_rows(self, call_rows: usize) -> Self {
        Self { call_rows, ..self }
    }

    /// Makes two motions of the pack's first body; the second is timed for the
    /// [trial](Generator::trial). If the first call of a shape is slow, it first makes a call for
    /// each body, with the longest windows and with those of live characters. Call it before the
    /// first job.
    ///
    /// # Errors
    /// [`EngineError`] if the network fails or gives invalid values: the pack is broken.
    pub fn warm_up(&mut self, pack: &Pack) -> Result<(), EngineError> {
        let longest = self.dims.max_frames();
        let live = LIVE_FRAMES.clamp(self.dims.min_frames(), longest);
        if !self.denoiser.any_shape() {
            for frames in [longest, live] {
                let tasks = (0..pack.bodies.len()).filter_map(|index| probe_task(pack, index, frames));
                let one_call = |task| PathTask {
                    steps: 1,
                    guidance: 1.0,
                    ..task
                };
                self.run(&tasks.map(one_call).collect::<Vec<_>>())?;
            }
        }
        let task = probe_task(pack, 0, longest).ok_or(EngineError::WrongTask)?;
        self.trial = Some(time_path(self, task)?);
        Ok(())
    }

    /// The motions of these tasks, in the same order. The generator must have no jobs.
    ///
    /// # Errors
    /// [`EngineError`] of the first task that fails.
    pub fn run(&mut self, tasks: &[PathTask]) -> Result<Vec<Motion>, EngineError> {
        run_paths(self, tasks)
    }

    /// Indices of the jobs of the next call, in rising order: the oldest job, then jobs of the same
    /// network with as many frames that fit into the same call.
    fn chosen(&self) -> Vec<usize> {
        let Some(oldest) = self.jobs.first() else {
            return Vec::new();
        };
        let mut rows = 0;
        let shape = |job: &Job| (job.network(), job.frames());
        let fits = |(place, job): (usize, &Job)| {
            let fits = shape(job) == shape(oldest) && (rows == 0 || rows + job.call_rows() <= self.call_rows);
            rows += if fits { job.call_rows() } else { 0 };
            fits.then_some(place)
        };
        self.jobs.iter().enumerate().filter_map(fits).collect()
    }

    /// Fills the call with the chosen jobs, then with a copy without style of each job with
    /// guidance.
    fn assemble(&mut self, chosen: &[usize]) {
        let Some(&first) = chosen.first() else { return };
        let (network, frames) = (self.jobs[first].network(), self.jobs[first].frames());
        self.call.clear(network, frames, self.words);
        let jobs = || chosen.iter().map(|&place| &self.jobs[place]);
        for job in jobs() {
            self.call.push(&job.character(&self.schedule, true));
        }
        for job in jobs().filter(|job| job.is_guided()) {
            self.call.push(&job.character(&self.schedule, false));
        }
    }

    /// Gives the chosen jobs their rows of the answer. Calls `out` for jobs that are done.
    fn scatter(&mut self, chosen: &[usize], out: &mut dyn FnMut(JobId, Progress)) {
        let styled: usize = chosen.iter().map(|&place| self.jobs[place].rows().len()).sum();
        let (mut styled, mut plain) = self.clean.split_at_mut(styled);
        let mut over = Vec::new();
        for &place in chosen {
            let job = &mut self.jobs[place];
            let length = job.rows().len();
            let Some(own) = styled.split_off_mut(..length) else {
                break;
            };
            let copy = job.is_guided().then(|| plain.split_off_mut(..length)).flatten();
            let was_last = job.advance(&self.schedule, own, copy.as_deref());
            if !all_finite(job.rows()) {
                let error = EngineError::Network {
                    file: self.files[self.call.network],
                    problem: "values that are not finite".to_owned(),
                };
                out(job.id, Progress::Failed(error));
            } else if was_last {
                out(job.id, Progress::Done(Output::Motion(job.motion(&self.coding))));
            } else {
                continue;
            }
            over.push(job.id);
        }
        self.jobs.retain(|job| !over.contains(&job.id));
    }
}

impl Generator for UniMoGen {
    fn free(&self) -> usize {
        self.max_jobs.saturating_sub(self.jobs.len())
    }

    fn is_idle(&self) -> bool {
        self.jobs.is_empty() && self.refused.is_empty()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        let Task::Path(task) = task else {
            self.refused.push((id, EngineError::WrongTask));
            return;
        };
        match check(&task, &self.dims, self.words, self.schedule.steps()) {
            // A body of another pack.
            Ok(()) if task.body.network >= self.files.len() => {
                self.refused.push((id, EngineError::WrongTask))
            }
            Ok(()) => self.jobs.push(Job::new(id, task, &self.coding)),
            Err(error) => self.refused.push((id, error)),
        }
    }

    fn cancel(&mut self, id: JobId) {
        self.refused.retain(|(other, _)| *other != id);
        self.jobs.retain(|job| job.id != id);
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        for (id, error) in self.refused.drain(..) {
            out(id, Progress::Failed(error));
        }
        let started = Instant::now();
        let chosen = self.chosen();
        if chosen.is_empty() {
            return Ok(StepReport::default());
        }
        self.assemble(&chosen);
        self.clean.resize(self.call.x.len(), 0.0);
        let assembled = Instant::now();
        self.denoiser.denoise(&self.call, &mut self.clean)?;
        let denoised = Instant::now();
        self.scatter(&chosen, out);
        Ok(StepReport {
            jobs: chosen.len(),
            rows: 0,
            assemble: assembled - started,
            networks: vec![("denoiser", denoised - assembled)],
            scatter: denoised.elapsed(),
        })
    }

    fn clear(&mut self) {
        self.jobs.clear();
        self.refused.clear();
    }

    fn trial(&self) -> Option<TrialRun> {
        self.trial
    }
}

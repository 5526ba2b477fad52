//! NVIDIA's planner as a [`Generator`]: a step is one call of the graph, for the oldest job.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use troupe_motion::model::{Body, Motion, Output, PathTask, Task, all_finite};

use super::inputs::Inputs;
use super::motion::motion;
use super::network::Planner;
use super::probe::probe_task;
use super::translation::Translation;
use super::{QPOS, robot_of};
use crate::generator::{Generator, JobId, Progress, StepReport, run_paths, time_path};
use crate::pack::{PLANNER_FILE, Pack};
use crate::{EngineError, TrialRun};

/// Shorter quaternions have no direction.
const MIN_QUATERNION: f32 = 1e-3;

/// A job that waits for its call.
struct Job {
    id: JobId,
    body: Arc<Body>,
    frames: usize,
    inputs: Box<Inputs>,
}

/// The family's generator for one worker.
pub struct SonicPlanner {
    translation: Translation,
    fps: f32,
    planner: Box<dyn Planner>,
    max_jobs: usize,
    /// The oldest first.
    jobs: VecDeque<Job>,
    /// Tasks that cannot be done; the next step reports them.
    refused: Vec<(JobId, EngineError)>,
    qpos: Vec<f32>,
    trial: Option<TrialRun>,
}

impl SonicPlanner {
    /// A generator for a pack. It holds up to `max_jobs` jobs.
    ///
    /// # Errors
    /// [`EngineError::WrongTask`] if the pack belongs to another family.
    pub fn new(pack: &Pack, planner: Box<dyn Planner>, max_jobs: usize) -> Result<Self, EngineError> {
        let table = pack
            .manifest
            .sonic_planner
            .as_ref()
            .ok_or(EngineError::WrongTask)?;
        Ok(Self {
            translation: Translation::new(table, pack.manifest.fps, pack.rig.dims),
            fps: pack.manifest.fps,
            planner,
            max_jobs: max_jobs.max(1),
            jobs: VecDeque::new(),
            refused: Vec::new(),
            qpos: Vec::new(),
            trial: None,
        })
    }

    /// Makes two of the longest plans; the second is timed for the [trial](Generator::trial). Call
    /// it before the first job.
    ///
    /// # Errors
    /// [`EngineError`] if the graph fails or gives invalid values: the pack is broken.
    pub fn warm_up(&mut self, pack: &Pack) -> Result<(), EngineError> {
        let task = probe_task(pack, 0, pack.rig.dims.max_frames()).ok_or(EngineError::WrongTask)?;
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

    /// The motion of the frames that the graph just gave.
    fn answer(&self, job: &Job) -> Result<Motion, EngineError> {
        let wrong = |problem| {
            Err(EngineError::Network {
                file: PLANNER_FILE,
                problem,
            })
        };
        let frames = self.qpos.len() / QPOS;
        if frames != job.frames {
            return wrong(format!("it gave {frames} frames, expected {}", job.frames));
        }
        let has_direction = |frame: &[f32]| {
            let squares: f32 = frame[3..7].iter().map(|number| number * number).sum();
            squares.sqrt() > MIN_QUATERNION
        };
        if !all_finite(&self.qpos) {
            return wrong("values that are not finite".to_owned());
        }
        if let Some(frame) = self
            .qpos
            .chunks_exact(QPOS)
            .position(|frame| !has_direction(frame))
        {
            return wrong(format!("frame {frame} has a rotation of length 0"));
        }
        Ok(motion(&job.body, robot_of(&job.body)?, &self.qpos, self.fps))
    }
}

impl Generator for SonicPlanner {
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
        match self.translation.inputs(&task) {
            Ok(inputs) => self.jobs.push_back(Job {
                id,
                frames: task.path.len(),
                body: task.body,
                inputs: Box::new(inputs),
            }),
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
        let Some(job) = self.jobs.front() else {
            return Ok(StepReport::default());
        };
        let started = Instant::now();
        self.planner.plan(&job.inputs, &mut self.qpos)?;
        let planned = Instant::now();
        let progress = match self.answer(job) {
            Ok(motion) => Progress::Done(Output::Motion(motion)),
            Err(error) => Progress::Failed(error),
        };
        out(job.id, progress);
        self.jobs.pop_front();
        Ok(StepReport {
            jobs: 1,
            rows: 1,
            networks: vec![("planner", planned - started)],
            scatter: planned.elapsed(),
            ..StepReport::default()
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

//! The interface of a model family: a worker steps jobs, and the family decides which network call
//! they need next.
//!
//! MotionBricks runs its three networks once for a batch of jobs. A diffusion model runs one
//! network a few times, and jobs may join between the runs. An autoregressive model runs a network
//! once a token. All of them are a [`Generator`].

use std::time::{Duration, Instant};

use troupe_motion::model::{Motion, Output, PathTask, Task};

use crate::{EngineError, TrialRun};

/// Identifies a job: one character of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId {
    /// Number of the request.
    pub request: u64,
    /// Index of the character in the request.
    pub character: u32,
}

/// Result of a job in a step. A job without a result goes on.
#[derive(Debug)]
pub enum Progress {
    /// The next part of its answer, which follows the parts before. More will come.
    Part(Output),
    /// The last part of its answer, or all of it. The job is over.
    Done(Output),
    /// It cannot be done. The job is over; other jobs go on.
    Failed(EngineError),
}

/// The parts of a step, with their times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepReport {
    /// Number of jobs that took part.
    pub jobs: usize,
    /// Rows of the network call, padding included; 0 for a family without such a number.
    pub rows: usize,
    /// Time for filling input tensors, sampling included.
    pub assemble: Duration,
    /// Time of all calls of each network, by name.
    pub networks: Vec<(&'static str, Duration)>,
    /// Time for copying answers out of the output tensors.
    pub scatter: Duration,
}

impl StepReport {
    /// Time of all networks together.
    pub fn inference(&self) -> Duration {
        self.networks.iter().map(|(_, took)| *took).sum()
    }
}

/// One model family on one worker: owns its networks and the state of its jobs.
///
/// The same job gives the same answer bit for bit, whatever other jobs there are and whenever it
/// joined them.
pub trait Generator: Send {
    /// How many more jobs it can take now.
    fn free(&self) -> usize;

    /// Whether it has no job.
    fn is_idle(&self) -> bool;

    /// Takes a job, which joins at the next step. The caller respects [`Generator::free`], and only
    /// gives tasks that the pack's capabilities name.
    fn admit(&mut self, id: JobId, task: Task);

    /// Drops a job whose answer is not needed any more. An unknown job is ignored.
    fn cancel(&mut self, id: JobId);

    /// Runs one network call, or one chain of calls, for its jobs or the oldest of them, and passes
    /// their results to `out`.
    ///
    /// # Errors
    /// [`EngineError`] if the call fails. All jobs fail with it, and are
    /// [cleared](Generator::clear).
    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError>;

    /// Drops all jobs, after a step that failed or panicked.
    fn clear(&mut self);

    /// Time of a step after warm-up, if it was measured.
    fn trial(&self) -> Option<TrialRun> {
        None
    }
}

/// Does a task twice, and times the second run for [`Generator::trial`]. The first one fills
/// caches. The generator must have no jobs.
///
/// # Errors
/// [`EngineError`] if the task fails.
pub(crate) fn time_path(generator: &mut dyn Generator, task: PathTask) -> Result<TrialRun, EngineError> {
    let work = Task::Path(task.clone()).work().into();
    let tasks = [task];
    run_paths(generator, &tasks)?;
    let started = Instant::now();
    run_paths(generator, &tasks)?;
    Ok(TrialRun {
        rows: 1,
        work,
        took: started.elapsed(),
    })
}

/// The motions of these tasks, in the same order. The generator must have no jobs.
///
/// # Errors
/// [`EngineError`] of the first task that fails.
pub(crate) fn run_paths(
    generator: &mut dyn Generator,
    tasks: &[PathTask],
) -> Result<Vec<Motion>, EngineError> {
    for (index, task) in tasks.iter().enumerate() {
        let id = JobId {
            request: index as u64,
            character: 0,
        };
        generator.admit(id, Task::Path(task.clone()));
    }
    let mut motions = vec![Motion::default(); tasks.len()];
    let mut failed = None;
    while !generator.is_idle() {
        let stepped = generator.step(&mut |id, progress| match progress {
            Progress::Done(Output::Motion(motion)) => motions[id.request as usize] = motion,
            Progress::Failed(error) => failed = Some(error),
            Progress::Done(_) | Progress::Part(_) => {}
        });
        if let Some(error) = stepped.err().or(failed.take()) {
            generator.clear();
            return Err(error);
        }
    }
    Ok(motions)
}

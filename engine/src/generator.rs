//! One way to host a model family: a worker steps jobs, and a family says which network call its
//! jobs need next.
//!
//! MotionBricks runs its three networks once for a batch of jobs. A diffusion model runs one
//! network a few times, and jobs may join between the runs. An autoregressive model runs a network
//! once a token. All of them are a [`Generator`].

use std::time::Duration;

use troupe_motion::model::{Output, Task};

use crate::{EngineError, TrialRun};

/// Names a job to its generator: a character of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JobId {
    /// The request.
    pub request: u64,
    /// The character's place in it.
    pub character: u32,
}

/// Result of a job in a step. A job in none of them goes on.
#[derive(Debug)]
pub enum Progress {
    /// The next part of its answer: frames or words that follow those before. More will come.
    Part(Output),
    /// The last part of its answer, or all of it. The job is over.
    Done(Output),
    /// It cannot be done. The job is over; the others go on.
    Failed(EngineError),
}

/// Where a step's time went.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepReport {
    /// Jobs that took part.
    pub jobs: usize,
    /// Rows of the network call, padding included; 0 where there is no such number.
    pub rows: usize,
    /// Filling input tensors, sampling included.
    pub assemble: Duration,
    /// Each network by name, all its calls.
    pub networks: Vec<(&'static str, Duration)>,
    /// Copying answers out of the output tensors.
    pub scatter: Duration,
}

impl StepReport {
    /// All networks together.
    pub fn inference(&self) -> Duration {
        self.networks.iter().map(|(_, took)| *took).sum()
    }
}

/// One model family on one worker: owns its networks and the state of the jobs that it runs.
///
/// The same job gives the same answer, bit for bit, whatever jobs are beside it and whenever it
/// joined them.
pub trait Generator: Send {
    /// How many more jobs it can take now.
    fn free(&self) -> usize;

    /// Whether it has no job.
    fn is_idle(&self) -> bool;

    /// Takes a job, which joins at the next step. For no more than [`Generator::free`] jobs, each
    /// of a kind that the pack's capabilities name.
    fn admit(&mut self, id: JobId, task: Task);

    /// Drops a job: nobody wants its answer any more. One that it does not have is no matter.
    fn cancel(&mut self, id: JobId);

    /// One network call, or one chain of them, for the jobs that it holds or the oldest of them;
    /// tells `out` what became of these.
    ///
    /// # Errors
    /// [`EngineError`] where the call fails. All jobs fail with it, and are
    /// [cleared](Generator::clear).
    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError>;

    /// Drops all jobs, after a step that failed or panicked.
    fn clear(&mut self);

    /// How long a step took when everything was warm, where that was measured.
    fn trial(&self) -> Option<TrialRun> {
        None
    }
}

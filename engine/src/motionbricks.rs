//! MotionBricks as a [`Generator`]: a batch of jobs is one step through root, pose and decoder.

use troupe_motion::model::{KeyframeTask, Output, Task};

use crate::generator::{Generator, JobId, Progress, StepReport};
use crate::pack::Stage;
use crate::{EngineError, Pipeline, StageTimes, TrialRun};

/// The three stages of a pack, run one batch at a time.
pub struct MotionBricks {
    pipeline: Pipeline,
    max_batch: usize,
    ids: Vec<JobId>,
    tasks: Vec<KeyframeTask>,
    /// Jobs with tasks that it has no networks for.
    foreign: Vec<JobId>,
}

impl MotionBricks {
    /// A generator over a warmed-up pipeline. Steps have up to `max_batch` jobs, which the pipeline
    /// must have been made for.
    pub fn new(pipeline: Pipeline, max_batch: usize) -> Self {
        Self {
            pipeline,
            max_batch: max_batch.max(1),
            ids: Vec::new(),
            tasks: Vec::new(),
            foreign: Vec::new(),
        }
    }
}

impl Generator for MotionBricks {
    fn free(&self) -> usize {
        self.max_batch.saturating_sub(self.ids.len())
    }

    fn is_idle(&self) -> bool {
        self.ids.is_empty() && self.foreign.is_empty()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        match task {
            Task::Keyframes(task) => {
                self.ids.push(id);
                self.tasks.push(task);
            }
            Task::Path(_) | Task::Prompt(_) | Task::Describe(_) => self.foreign.push(id),
        }
    }

    fn cancel(&mut self, id: JobId) {
        self.foreign.retain(|&foreign| foreign != id);
        if let Some(at) = self.ids.iter().position(|&other| other == id) {
            self.ids.remove(at);
            self.tasks.remove(at);
        }
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        for id in self.foreign.drain(..) {
            out(id, Progress::Failed(EngineError::WrongTask));
        }
        if self.ids.is_empty() {
            return Ok(StepReport::default());
        }
        let (answers, times) = self.pipeline.run(&self.tasks)?;
        self.tasks.clear();
        let jobs = self.ids.len();
        for (id, answer) in self.ids.drain(..).zip(answers) {
            out(
                id,
                match answer {
                    Ok(motion) => Progress::Done(Output::Motion(motion)),
                    Err(error) => Progress::Failed(error),
                },
            );
        }
        Ok(report(jobs, &times))
    }

    fn clear(&mut self) {
        self.ids.clear();
        self.tasks.clear();
        self.foreign.clear();
    }

    fn trial(&self) -> Option<TrialRun> {
        self.pipeline.trial()
    }
}

fn report(jobs: usize, times: &StageTimes) -> StepReport {
    StepReport {
        jobs,
        rows: times.bucket,
        assemble: times.assemble,
        networks: vec![
            (Stage::Root.name(), times.root),
            (Stage::Pose.name(), times.pose),
            (Stage::Decoder.name(), times.decoder),
        ],
        scatter: times.scatter,
    }
}

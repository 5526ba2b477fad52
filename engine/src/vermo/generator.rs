//! VerMo as a [`Generator`]: a step writes one token of every reply, and decodes the frames that
//! are ready.

use std::sync::Arc;
use std::time::{Duration, Instant};

use troupe_motion::model::{DescribeTask, Output, PromptTask, Rig, Task, all_finite};

use super::arena::Shape;
use super::job::{Job, Phase, Taken};
use super::motion::Frames;
use super::network::{FlowCall, LanguageAnswer, LanguageCall, Networks};
use super::plan::Planner;
use super::sequences::{Said, Sequences};
use super::windows::Windows;
use crate::generator::{Generator, JobId, Progress, StepReport};
use crate::pack::{DECODER_FILE, LANGUAGE_FILE, MessageTask, Pack};
use crate::{EngineError, TrialRun};

/// Most rows of a call of the language model. With more, the cache does not fit into a core's own
/// memory: 32 replies write 7,400 tokens a second in total on two cores, and 64 write no more.
pub const SLOTS: usize = 32;
/// Rows of a guided reply: its message, the message without the style, and no caption.
const GUIDED_ROWS: usize = 3;
/// Number of replies of the trial, and the tokens of each.
const TRIAL: (usize, usize) = (8, 16);

/// The family's generator for one worker.
pub struct VerMo {
    planner: Planner,
    rig: Arc<Rig>,
    networks: Timed,
    max_jobs: usize,
    sequences: Sequences,
    /// The jobs in progress, the oldest first.
    jobs: Vec<Job>,
    /// Tasks that cannot be done; the next step reports them.
    refused: Vec<(JobId, EngineError)>,
    trial: Option<TrialRun>,
}

impl VerMo {
    /// A generator for a pack. It holds up to `max_jobs` jobs, and writes their replies in up to
    /// [`SLOTS`] rows at a time.
    ///
    /// # Errors
    /// [`EngineError::WrongTask`] if the pack belongs to another family.
    pub fn new(pack: &Pack, networks: Box<dyn Networks>, max_jobs: usize) -> Result<Self, EngineError> {
        let planner = Planner::new(pack)?;
        let max_jobs = max_jobs.max(1);
        let shape = Shape::new(&planner.table);
        Ok(Self {
            rig: pack.rig.clone(),
            networks: Timed::new(networks),
            sequences: Sequences::new(shape, planner.vocabulary, rows(&planner, max_jobs)),
            max_jobs,
            jobs: Vec::new(),
            refused: Vec::new(),
            trial: None,
            planner,
        })
    }

    /// Runs every network, and times a few jobs for the [trial](Generator::trial). Call it before
    /// the first job.
    ///
    /// # Errors
    /// [`EngineError`] if a network fails or gives invalid values: the pack is broken.
    pub fn warm_up(&mut self) -> Result<(), EngineError> {
        let (jobs, tokens) = TRIAL;
        let tokens = tokens.clamp(self.planner.dims.min_tokens, self.planner.dims.max_tokens);
        let frames = decode_one(&mut *self.networks.inner, &vec![0; tokens])?;
        self.networks.inner.encode(&frames)?;
        if let Some(width) = self.networks.inner.flow_width() {
            let call = FlowCall {
                codes: &vec![0; tokens],
                state: &vec![0.0; frames.len() * width],
                time: 0.0,
                delta: 1.0,
            };
            self.networks.inner.flow(&call)?;
        }
        let jobs = jobs.min(self.max_jobs);
        for _ in 0..2 {
            self.trial = self.run_trial(jobs, frames.len())?;
        }
        Ok(())
    }

    /// How long `jobs` jobs of `frames` frames take. None for a pack whose tasks all need audio.
    /// The generator must have no jobs.
    ///
    /// # Errors
    /// [`EngineError`] of the first job that fails.
    pub fn run_trial(&mut self, jobs: usize, frames: usize) -> Result<Option<TrialRun>, EngineError> {
        let Some(task) = self.trial_task(frames)? else {
            return Ok(None);
        };
        let started = Instant::now();
        for request in 0..jobs {
            self.admit(trial_id(request), task.clone());
        }
        let mut failed = None;
        while !self.is_idle() {
            let stepped = self.step(&mut |_, progress| {
                if let Progress::Failed(error) = progress {
                    failed = Some(error);
                }
            });
            if let Some(error) = stepped.err().or(failed.take()) {
                self.clear();
                return Err(error);
            }
        }
        Ok(Some(TrialRun {
            rows: jobs,
            work: jobs as u64 * u64::from(task.work()),
            took: started.elapsed(),
        }))
    }

    /// A task for the trial that needs no caller's data: motion for a known word, or motion without
    /// a prompt, or else a description of decoded motion.
    fn trial_task(&mut self, frames: usize) -> Result<Option<Task>, EngineError> {
        let tasks = &self.planner.table.tasks;
        let word = self.planner.lexicon.words().next();
        let word = word.filter(|_| tasks.contains(&MessageTask::TextToMotion));
        if word.is_some() || tasks.contains(&MessageTask::Unconditional) {
            // A style makes the trial's replies as dear as guided ones are.
            let words = word
                .map(str::to_owned)
                .into_iter()
                .chain(self.planner.lexicon.style());
            return Ok(Some(Task::Prompt(PromptTask {
                text: words.collect::<Vec<_>>().join(" "),
                frames: Some(frames),
                ..PromptTask::default()
            })));
        }
        if !tasks.contains(&MessageTask::MotionToText) {
            return Ok(None);
        }
        let tokens = vec![0; self.planner.dims.tokens_for(frames)];
        let motion = decode_one(&mut self.networks, &tokens)?;
        Ok(Some(Task::Describe(DescribeTask {
            frames: motion.keys(self.rig.dims.joints).collect(),
            ..DescribeTask::default()
        })))
    }

    /// Encodes the given motion of waiting jobs, and starts writing their replies.
    fn begin(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<(), EngineError> {
        let Self {
            jobs,
            planner,
            networks,
            sequences,
            ..
        } = self;
        let mut over = Vec::new();
        for job in jobs.iter_mut().filter(|job| job.phase == Phase::Prompt) {
            match job.write_prompt(planner, networks) {
                Ok(prompt) => sequences.admit(job.id, prompt),
                Err(error @ EngineError::Task { .. }) => {
                    out(job.id, Progress::Failed(error));
                    over.push(job.id);
                }
                Err(error) => return Err(error),
            }
        }
        jobs.retain(|job| !over.contains(&job.id));
        Ok(())
    }

    /// Writes one token of each reply. Returns the rows of the call.
    fn write(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<usize, EngineError> {
        let Self {
            jobs,
            planner,
            networks,
            sequences,
            ..
        } = self;
        let mut failed = Vec::new();
        let rows = sequences.step(networks, &mut |id, said| {
            let Some(job) = jobs.iter_mut().find(|job| job.id == id) else {
                return;
            };
            match said {
                Said::Token(token) => job.receive(planner, token),
                Said::End => job.phase = Phase::Whole,
                Said::Failed => failed.push(id),
            }
        })?;
        for &id in &failed {
            let problem = "logits that are not finite".to_owned();
            let file = LANGUAGE_FILE;
            out(id, Progress::Failed(EngineError::Network { file, problem }));
        }
        self.jobs.retain(|job| !failed.contains(&job.id));
        Ok(rows)
    }

    /// Decodes the frames that are ready, and gives them to `out`. Of the jobs with the flow
    /// decoder, the oldest takes a step.
    fn give(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<(), EngineError> {
        let Self {
            jobs,
            planner,
            networks,
            ..
        } = self;
        let mut over = Vec::new();
        let oldest = jobs.iter().find(|job| job.flows()).map(|job| job.id);
        let mut windows = Windows::default();
        let has_turn = |job: &Job| job.phase != Phase::Prompt && (!job.flows() || Some(job.id) == oldest);
        for job in jobs.iter_mut().filter(|job| has_turn(job)) {
            job.want(networks, &mut windows)?;
        }
        windows.decode(networks)?;
        for job in jobs.iter_mut().filter(|job| has_turn(job)) {
            let (output, is_last) = match job.take(planner, &mut windows)? {
                Taken::Nothing => continue,
                Taken::Part(output) => (output, false),
                Taken::Last(output) => (output, true),
            };
            let progress = match (is_finite(&output), is_last) {
                (false, _) => Progress::Failed(EngineError::Network {
                    file: DECODER_FILE,
                    problem: "values that are not finite".to_owned(),
                }),
                (true, true) => Progress::Done(output),
                (true, false) => Progress::Part(output),
            };
            if !matches!(progress, Progress::Part(_)) {
                over.push(job.id);
            }
            out(job.id, progress);
        }
        for &id in &over {
            self.sequences.cancel(id);
        }
        self.jobs.retain(|job| !over.contains(&job.id));
        Ok(())
    }
}

impl Generator for VerMo {
    fn free(&self) -> usize {
        self.max_jobs.saturating_sub(self.jobs.len())
    }

    fn is_idle(&self) -> bool {
        self.jobs.is_empty() && self.refused.is_empty()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        let job = match &task {
            Task::Prompt(task) => Job::prompt(id, task, &self.planner, &self.rig),
            Task::Describe(task) => Job::describe(id, task, &self.planner),
            Task::Keyframes(_) | Task::Path(_) => Err(EngineError::WrongTask),
        };
        match job {
            Ok(job) => self.jobs.push(job),
            Err(error) => self.refused.push((id, error)),
        }
    }

    fn cancel(&mut self, id: JobId) {
        self.refused.retain(|(other, _)| *other != id);
        self.jobs.retain(|job| job.id != id);
        self.sequences.cancel(id);
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        for (id, error) in self.refused.drain(..) {
            out(id, Progress::Failed(error));
        }
        let started = Instant::now();
        let jobs = self.jobs.len();
        if jobs == 0 {
            return Ok(StepReport::default());
        }
        self.begin(out)?;
        let begun = self.networks.total();
        let assembled = started.elapsed().saturating_sub(begun);
        let rows = self.write(out)?;
        self.give(out)?;
        let networks = self.networks.take();
        let inference: Duration = networks.iter().map(|(_, took)| *took).sum();
        Ok(StepReport {
            jobs,
            rows,
            assemble: assembled,
            scatter: started.elapsed().saturating_sub(inference + assembled),
            networks,
        })
    }

    fn clear(&mut self) {
        self.jobs.clear();
        self.refused.clear();
        self.sequences.clear();
    }

    fn trial(&self) -> Option<TrialRun> {
        self.trial
    }
}

/// Most rows of the language model for `jobs` jobs of a pack.
fn rows(planner: &Planner, jobs: usize) -> usize {
    let each = if planner.table.is_guided() { GUIDED_ROWS } else { 1 };
    jobs.saturating_mul(each).min(SLOTS)
}

fn trial_id(request: usize) -> JobId {
    JobId {
        request: request as u64,
        character: 0,
    }
}

fn decode_one(networks: &mut dyn Networks, codes: &[u32]) -> Result<Frames, EngineError> {
    Ok(networks.decode(&[codes])?.pop().unwrap_or_default())
}

fn is_finite(output: &Output) -> bool {
    match output {
        Output::Motion(motion) => all_finite(&motion.root) && all_finite(&motion.rotations),
        Output::Motions(motions) => motions.iter().all(|motion| motion.is_finite()),
        Output::Text(_) | Output::Audio(_) => true,
    }
}

/// Networks that measure their own time since the last [`Timed::take`].
struct Timed {
    inner: Box<dyn Networks>,
    took: [(&'static str, Duration); 4],
}

impl Timed {
    fn new(inner: Box<dyn Networks>) -> Self {
        let names = ["language", "encoder", "decoder", "flow"];
        Self {
            inner,
            took: names.map(|name| (name, Duration::ZERO)),
        }
    }

    fn total(&self) -> Duration {
        self.took.iter().map(|(_, took)| *took).sum()
    }

    /// The times of the networks that ran since the last call, by name.
    fn take(&mut self) -> Vec<(&'static str, Duration)> {
        let ran = self
            .took
            .iter()
            .filter(|(_, took)| !took.is_zero())
            .copied()
            .collect();
        for (_, took) in &mut self.took {
            *took = Duration::ZERO;
        }
        ran
    }

    fn timed<T>(&mut self, network: usize, run: impl FnOnce(&mut dyn Networks) -> T) -> T {
        let started = Instant::now();
        let answer = run(&mut *self.inner);
        self.took[network].1 += started.elapsed();
        answer
    }
}

impl Networks for Timed {
    fn language(&mut self, call: &LanguageCall<'_>, answer: &mut LanguageAnswer) -> Result<(), EngineError> {
        self.timed(0, |networks| networks.language(call, answer))
    }

    fn encode(&mut self, frames: &Frames) -> Result<Vec<u32>, EngineError> {
        self.timed(1, |networks| networks.encode(frames))
    }

    fn decode(&mut self, windows: &[&[u32]]) -> Result<Vec<Frames>, EngineError> {
        self.timed(2, |networks| networks.decode(windows))
    }

    fn flow_width(&self) -> Option<usize> {
        self.inner.flow_width()
    }

    fn flow(&mut self, call: &FlowCall<'_>) -> Result<(Vec<f32>, Frames), EngineError> {
        self.timed(3, |networks| networks.flow(call))
    }
}

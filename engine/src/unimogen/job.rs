//! One character on its way from noise to motion.

use std::f32::consts::TAU;

use troupe_motion::features::FEATURES_PER_JOINT;
use troupe_motion::model::{Dims, KeyTensors, Motion, PathTask};

use super::batch::Character;
use super::noise::row_noise;
use super::rows::Coding;
use super::schedule::Schedule;
use super::{PATH_FEATURES, ROW_CHANNELS};
use crate::EngineError;
use crate::generator::JobId;
use crate::random::step64;

/// A job, with the state of its rows.
pub(super) struct Job {
    pub id: JobId,
    pub task: PathTask,
    /// Calls that the job has taken part in.
    pub calls: usize,
    /// Noisy rows `[J + 1, T, 6]`.
    state: Vec<f32>,
    /// 1 at given frames, else 0: `[T]`.
    given: Vec<f32>,
    /// The given frames, and their rows `[J + 1, 6]`.
    known: Vec<(usize, Vec<f32>)>,
    /// `[T]`.
    path: Vec<[f32; PATH_FEATURES]>,
}

impl Job {
    /// A job at its noisiest step. The task must have passed [`check`].
    pub(super) fn new(id: JobId, mut task: PathTask, coding: &Coding) -> Self {
        if let Some(sway) = task.body.sway.as_ref().filter(|_| task.sways) {
            task.path = sway.path(&task, task.body.rig.fps, start_phase(task.seed));
        }
        let (body, frames) = (&*task.body, task.path.len());
        let mut state = vec![0.0; body.row_count() * frames * ROW_CHANNELS];
        for (row, out) in state.chunks_exact_mut(frames * ROW_CHANNELS).enumerate() {
            row_noise(task.seed, row, out);
        }
        let first_target = frames - task.targets.len();
        let targets = task.targets.iter().enumerate();
        let keys =
            (task.context.iter().enumerate()).chain(targets.map(|(index, key)| (first_target + index, key)));
        let known: Vec<(usize, Vec<f32>)> = keys
            .filter_map(|(frame, key)| Some((frame, coding.encode(body, key, task.path[frame])?)))
            .collect();
        let mut given = vec![0.0; frames];
        for (frame, _) in &known {
            given[*frame] = 1.0;
        }
        let mut job = Self {
            id,
            path: coding.path_features(&task.path, body.size_m),
            task,
            calls: 0,
            state,
            given,
            known,
        };
        job.put_known();
        job
    }

    /// Frames T of the job's window.
    pub(super) fn frames(&self) -> usize {
        self.task.path.len()
    }

    /// The network that moves the job's body, an index of the pack's files.
    pub(super) fn network(&self) -> usize {
        self.task.body.network
    }

    /// Whether each call needs a second copy of the job without style.
    pub(super) fn is_guided(&self) -> bool {
        self.task.guidance != 1.0
    }

    /// Rows of the job in a call, the second copy included.
    pub(super) fn call_rows(&self) -> usize {
        let copies = if self.is_guided() { 2 } else { 1 };
        copies * self.task.body.row_count()
    }

    /// The inputs of the job's next call, with its style or without.
    pub(super) fn character(&self, schedule: &Schedule, with_style: bool) -> Character<'_> {
        Character {
            body: &self.task.body,
            x: &self.state,
            given: &self.given,
            path: &self.path,
            step: schedule.step(self.calls, self.task.steps as usize),
            style: with_style.then_some(&self.task.style),
        }
    }

    /// Takes the clean rows of a call, and those of the copy without style for a job with guidance.
    /// `clean` is overwritten. Returns whether that was the last call.
    pub(super) fn advance(&mut self, schedule: &Schedule, clean: &mut [f32], plain: Option<&[f32]>) -> bool {
        if let Some(plain) = plain {
            for (styled, plain) in clean.iter_mut().zip(plain) {
                *styled = plain + self.task.guidance * (*styled - plain);
            }
        }
        let steps = self.task.steps as usize;
        schedule.advance(self.calls, steps, &mut self.state, clean);
        self.put_known();
        self.calls += 1;
        self.calls == steps
    }

    /// The motion of the job's rows.
    pub(super) fn motion(&self, coding: &Coding) -> Motion {
        coding.decode(&self.task.body, &self.state, &self.task.path)
    }

    /// The rows, `[J + 1, T, 6]`.
    pub(super) fn rows(&self) -> &[f32] {
        &self.state
    }

    fn put_known(&mut self) {
        let frames = self.given.len();
        for (frame, rows) in &self.known {
            for (row, values) in rows.chunks_exact(ROW_CHANNELS).enumerate() {
                let start = (row * frames + frame) * ROW_CHANNELS;
                self.state[start..start + ROW_CHANNELS].copy_from_slice(values);
            }
        }
    }
}

/// The phase in radians in which a gait begins without a past.
pub(super) fn start_phase(seed: u64) -> f32 {
    // Rows of noise have the other indices.
    let share = step64(seed, u64::MAX) as f64 / u64::MAX as f64;
    share as f32 * TAU
}

/// Checks a task against the sizes of a pack, its number of words and its diffusion steps.
pub(super) fn check(task: &PathTask, dims: &Dims, words: usize, steps: usize) -> Result<(), EngineError> {
    let wrong = |field, found: &dyn ToString, allowed: String| {
        Err(EngineError::Task {
            field,
            found: found.to_string(),
            allowed,
        })
    };
    let frames = task.path.len();
    let (least, most, unit) = (dims.min_frames(), dims.max_frames(), dims.frames_per_token);
    if !(least..=most).contains(&frames) || !frames.is_multiple_of(unit) {
        let allowed = format!("{least} to {most} frames, a multiple of {unit}");
        return wrong("path", &frames, allowed);
    }
    if !task.path.as_flattened().iter().all(|number| number.is_finite()) {
        return wrong("path", &"not finite", "finite numbers".to_owned());
    }
    let context = dims.context_frames;
    if ![0, context].contains(&task.context.len()) {
        return wrong(
            "context",
            &task.context.len(),
            format!("0 or {context} keyframes"),
        );
    }
    if task.targets.len() > dims.max_targets {
        let allowed = format!("0 to {} keyframes", dims.max_targets);
        return wrong("targets", &task.targets.len(), allowed);
    }
    let pose = task.body.joints() * FEATURES_PER_JOINT;
    let is_short = |key: &&KeyTensors| key.pose.as_ref().is_some_and(|found| found.len() != pose);
    if let Some(key) = task.context.iter().chain(&task.targets).find(is_short) {
        let found = key.pose.as_ref().map_or(0, |pose| pose.len());
        return wrong("pose", &found, format!("{pose} numbers"));
    }
    if task.style.len() != words || !task.style.iter().all(|weight| weight.is_finite()) {
        return wrong("style", &task.style.len(), format!("{words} finite weights"));
    }
    if !(1..=steps).contains(&(task.steps as usize)) {
        return wrong("steps", &task.steps, format!("1 to {steps}"));
    }
    if !task.guidance.is_finite() {
        return wrong("guidance", &task.guidance, "a finite number".to_owned());
    }
    Ok(())
}

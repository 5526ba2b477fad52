//! Runs the stages alone in a loop, on inputs that are filled once: the best that an engine could
//! reach, without requests around it. Benchmarks and `troupe-server doctor` measure with it.

use std::time::Instant;

use troupe_motion::model::{Dims, GLOBAL_ROOT, KeyTensors, KeyframeTask};

use super::fill::FillRows as _;
use super::{
    DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, StageTimes, Stages, TokenInput, length_of,
    lengths,
};

/// One batch of a fixed size and length, for repeated runs.
pub struct RawLoop {
    stages: Box<dyn Stages>,
    rows: usize,
    root_input: RootInput,
    root_output: RootOutput,
    token_input: TokenInput,
    pose_output: PoseOutput,
    decoder_output: DecoderOutput,
}

impl RawLoop {
    /// Batches of `rows` straight walks of `frames` frames each.
    pub fn new(dims: &Dims, stages: Box<dyn Stages>, rows: usize, frames: usize) -> Self {
        let mut raw = Self {
            stages,
            rows,
            root_input: RootInput::new(dims, rows),
            root_output: RootOutput::new(dims, rows),
            token_input: TokenInput::new(dims, rows),
            pose_output: PoseOutput::new(dims, rows),
            decoder_output: DecoderOutput::new(dims, rows),
        };
        raw.set_shape(dims, rows, frames);
        raw
    }

    /// Changes the shape of the batches, to at most as many rows as at first.
    pub fn set_shape(&mut self, dims: &Dims, rows: usize, frames: usize) {
        let item = straight_walk(dims, frames);
        let tokens = dims.tokens_for(frames);
        let length = length_of(&lengths(dims, self.stages.any_length()), tokens);
        self.rows = rows;
        self.token_input.set_length(dims, length);
        self.pose_output.set_length(dims, length);
        self.decoder_output.set_length(dims, length);
        let standing = vec![0.0; dims.max_frames() * GLOBAL_ROOT];
        for row in 0..rows {
            item.fill_root_input(dims, row, &mut self.root_input);
            item.fill_token_input(dims, row, tokens, &standing, &mut self.token_input);
            // Codes, as the decoder needs them; the pose stage takes them as well as masks.
            self.token_input.tokens.fill_row(row, 0);
        }
    }

    /// Runs the three stages once.
    ///
    /// # Errors
    /// [`EngineError`] if a stage fails.
    pub fn run(&mut self) -> Result<StageTimes, EngineError> {
        let front = self.run_front()?;
        let decoder = self.run_decoder()?;
        Ok(StageTimes {
            decoder: decoder.decoder,
            ..front
        })
    }

    /// Runs the stages before the decoder once.
    ///
    /// # Errors
    /// [`EngineError`] if a stage fails.
    pub fn run_front(&mut self) -> Result<StageTimes, EngineError> {
        let started = Instant::now();
        self.stages
            .root(self.rows, &self.root_input, &mut self.root_output)?;
        let rooted = Instant::now();
        self.stages
            .pose(self.rows, &self.token_input, &mut self.pose_output)?;
        Ok(StageTimes {
            root: rooted - started,
            pose: rooted.elapsed(),
            bucket: self.rows,
            ..StageTimes::default()
        })
    }

    /// Runs the decoder once.
    ///
    /// # Errors
    /// [`EngineError`] if it fails.
    pub fn run_decoder(&mut self) -> Result<StageTimes, EngineError> {
        let started = Instant::now();
        self.stages
            .decoder(self.rows, &self.token_input, &mut self.decoder_output)?;
        Ok(StageTimes {
            decoder: started.elapsed(),
            bucket: self.rows,
            ..StageTimes::default()
        })
    }
}

/// A straight walk of `frames` frames towards one target, at 1.2 m/s if a second has 30 frames.
/// Each keyframe has the same neutral pose feature: the task is for measurements.
pub fn straight_walk(dims: &Dims, frames: usize) -> KeyframeTask {
    const SPEED_MPS: f32 = 1.2;
    let tokens = dims.tokens_for(frames);
    let key = |frame: usize| {
        let z = SPEED_MPS * (frame as f32 - (dims.context_frames as f32 - 1.0)) / 30.0;
        KeyTensors {
            local_root: Some([0.0, SPEED_MPS, 0.0, 0.9]),
            global_root: Some([0.0, 0.9, z, 1.0, 0.0]),
            pose: Some(vec![0.1; dims.pose()].into()),
        }
    };
    KeyframeTask {
        context: (0..dims.context_frames).map(key).collect(),
        targets: vec![key(frames - 1)],
        frames: Some(frames),
        allowed_counts: (dims.min_tokens..=dims.max_tokens)
            .map(|count| count == tokens)
            .collect(),
        seed: 1,
        temperature: 0.0,
        pose_steps: 1,
        root_guide: None,
        root_override: None,
        gap_poses: Vec::new(),
    }
}

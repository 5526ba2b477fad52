//! Takes a batch of characters through root, pose and decoder.
//!
//! Batches are padded to a size [bucket](buckets) with neutral rows, so that the engine sees few shapes. Rows are ordered
//! by their number of pose passes: the pose stage then runs on a shrinking prefix of the batch, and characters that asked
//! for one pass do not pay for those that asked for ten.

use std::time::{Duration, Instant};

use super::sampling::{PoseSampler, fill_count_noise};
use super::{
    DecoderOutput, EngineError, PoseOutput, RawMotion, RootInput, RootOutput, Stages, TokenInput, WorkItem,
};
use crate::pack::{Dims, GLOBAL_ROOT, SIX_D, Stage};

/// Batch sizes that an engine is asked for: powers of two up to `max_batch`, and `max_batch` itself.
pub fn buckets(max_batch: usize) -> Vec<usize> {
    let mut sizes: Vec<usize> = std::iter::successors(Some(1), |size| Some(size * 2))
        .take_while(|&size| size < max_batch)
        .collect();
    sizes.push(max_batch.max(1));
    sizes
}

/// Where a batch's time in the engine went.
#[derive(Debug, Clone, Copy, Default)]
pub struct StageTimes {
    /// Filling input tensors, the choice of tokens included.
    pub assemble: Duration,
    /// The root stage.
    pub root: Duration,
    /// All passes of the pose stage.
    pub pose: Duration,
    /// The decoder.
    pub decoder: Duration,
    /// Copying each character's rows out of the output tensors.
    pub scatter: Duration,
    /// Rows of the batch, padding included.
    pub bucket: usize,
}

impl StageTimes {
    /// The three stages together.
    pub fn inference(&self) -> Duration {
        self.root + self.pose + self.decoder
    }
}

/// What a batch has for one character.
pub type RowAnswer = Result<RawMotion, EngineError>;

/// The stages of one pack and the buffers between them.
pub struct Pipeline {
    dims: Dims,
    stages: Box<dyn Stages>,
    buckets: Vec<usize>,
    root_input: RootInput,
    root_output: RootOutput,
    token_input: TokenInput,
    pose_output: PoseOutput,
    decoder_output: DecoderOutput,
}

impl Pipeline {
    /// A pipeline for batches of up to `max_batch` characters, all buffers allocated.
    pub fn new(dims: Dims, stages: Box<dyn Stages>, max_batch: usize) -> Self {
        let buckets = buckets(max_batch);
        let rows = max_batch.max(1);
        Self {
            root_input: RootInput::new(&dims, rows),
            root_output: RootOutput::new(&dims, rows),
            token_input: TokenInput::new(&dims, rows),
            pose_output: PoseOutput::new(&dims, rows),
            decoder_output: DecoderOutput::new(&dims, rows),
            dims,
            stages,
            buckets,
        }
    }

    /// Runs every stage once in every bucket: the first run of a shape is slow, so it must not meet a caller.
    ///
    /// # Errors
    /// [`EngineError`] where a stage fails.
    pub fn warm_up(&mut self) -> Result<(), EngineError> {
        for bucket in self.buckets.clone() {
            self.clear_padding(0, bucket);
            for row in 0..bucket {
                self.token_input.clear_row(row, self.dims.min_tokens);
            }
            self.stages
                .root(bucket, &self.root_input, &mut self.root_output)?;
            self.stages
                .pose(bucket, &self.token_input, &mut self.pose_output)?;
            self.stages
                .decoder(bucket, &self.token_input, &mut self.decoder_output)?;
        }
        Ok(())
    }

    /// Runs a batch; the answers are in the order of `items`, which must not be more than the largest batch. A character
    /// for which a stage gives values out of the contract has an error of its own; the others are served.
    ///
    /// # Errors
    /// [`EngineError`] where a stage fails. The whole batch fails with it.
    pub fn run(&mut self, items: &[WorkItem]) -> Result<(Vec<RowAnswer>, StageTimes), EngineError> {
        let mut order: Vec<usize> = (0..items.len()).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(items[index].pose_steps));
        let sorted: Vec<&WorkItem> = order.iter().map(|&index| &items[index]).collect();

        let bucket = self.bucket(items.len());
        let mut times = StageTimes {
            bucket,
            ..StageTimes::default()
        };
        timed(&mut times.assemble, || self.fill_root(&sorted, bucket));
        timed(&mut times.root, || {
            self.stages.root(bucket, &self.root_input, &mut self.root_output)
        })?;
        let mut counts = timed(&mut times.assemble, || self.fill_tokens(&sorted, bucket));
        self.choose_tokens(&sorted, &mut counts, &mut times)?;
        timed(&mut times.decoder, || {
            self.stages
                .decoder(bucket, &self.token_input, &mut self.decoder_output)
        })?;
        let motions = timed(&mut times.scatter, || {
            let mut answers: Vec<(usize, RowAnswer)> = order
                .into_iter()
                .zip(counts.into_iter().enumerate())
                .map(|(index, (row, count))| (index, count.map(|count| self.copy_out(row, count))))
                .collect();
            answers.sort_by_key(|answer| answer.0);
            answers.into_iter().map(|answer| answer.1).collect()
        });
        Ok((motions, times))
    }

    fn bucket(&self, rows: usize) -> usize {
        self.buckets
            .iter()
            .copied()
            .find(|&bucket| bucket >= rows)
            .unwrap_or(rows)
    }

    fn clear_padding(&mut self, from: usize, bucket: usize) {
        for row in from..bucket {
            self.root_input.clear_row(row);
        }
    }

    fn fill_root(&mut self, items: &[&WorkItem], bucket: usize) {
        for (row, item) in items.iter().enumerate() {
            item.fill_root_input(&self.dims, row, &mut self.root_input);
            fill_count_noise(
                item.seed,
                item.temperature,
                self.root_input.count_noise.row_mut(row),
            );
        }
        self.clear_padding(items.len(), bucket);
    }

    /// Fills the token input from the root stage's answer, and gives each row's token count. A row without one goes on
    /// as padding.
    fn fill_tokens(&mut self, items: &[&WorkItem], bucket: usize) -> Vec<Result<usize, EngineError>> {
        let mut counts = Vec::with_capacity(items.len());
        for (row, item) in items.iter().enumerate() {
            let count = self.root_answer(row, item);
            match count {
                Ok(tokens) => {
                    item.fill_token_input(&self.dims, row, tokens, &self.root_output, &mut self.token_input);
                }
                Err(_) => self.token_input.clear_row(row, self.dims.min_tokens),
            }
            counts.push(count);
        }
        for row in items.len()..bucket {
            self.token_input.clear_row(row, self.dims.min_tokens);
        }
        counts
    }

    /// The token count that the root stage chose for a row, where its trajectory is usable.
    fn root_answer(&self, row: usize, item: &WorkItem) -> Result<usize, EngineError> {
        let tokens = self.checked_count(self.root_output.num_tokens.row(row)[0], item)?;
        let frames = tokens * self.dims.frames_per_token;
        let trajectory = &self.root_output.global_root.row(row)[..frames * GLOBAL_ROOT];
        if trajectory.iter().all(|value| value.is_finite()) {
            Ok(tokens)
        } else {
            Err(output(Stage::Root, "a trajectory that is not finite"))
        }
    }

    fn checked_count(&self, chosen: i64, item: &WorkItem) -> Result<usize, EngineError> {
        usize::try_from(chosen)
            .ok()
            .filter(|tokens| {
                let index = tokens.checked_sub(self.dims.min_tokens);
                index
                    .and_then(|index| item.allowed_counts.get(index))
                    .copied()
                    .unwrap_or(false)
            })
            .ok_or_else(|| {
                output(
                    Stage::Root,
                    &format!("the token count {chosen}, which was not allowed"),
                )
            })
    }

    /// Runs the pose stage until every row has its tokens. A row whose logits are not usable goes on as padding.
    fn choose_tokens(
        &mut self,
        items: &[&WorkItem],
        counts: &mut [Result<usize, EngineError>],
        times: &mut StageTimes,
    ) -> Result<(), EngineError> {
        let Dims { heads, codes, .. } = self.dims;
        let mut samplers: Vec<PoseSampler> = items
            .iter()
            .map(|item| PoseSampler::new(item.seed, item.temperature, item.pose_steps.max(1)))
            .collect();
        let passes = items.first().map_or(0, |item| item.pose_steps.max(1));
        for pass in 1..=passes {
            let active = items.partition_point(|item| item.pose_steps.max(1) >= pass);
            let bucket = self.bucket(active);
            timed(&mut times.pose, || {
                self.stages.pose(bucket, &self.token_input, &mut self.pose_output)
            })?;
            let started = Instant::now();
            for (row, sampler) in samplers[..active].iter_mut().enumerate() {
                let Ok(count) = counts[row] else { continue };
                let tokens = &mut self.token_input.tokens.row_mut(row)[..count * heads];
                if !sampler.commit(pass, codes, self.pose_output.logits.row(row), tokens) {
                    counts[row] = Err(output(Stage::Pose, "logits that are not finite"));
                    self.token_input.clear_row(row, self.dims.min_tokens);
                }
            }
            times.assemble += started.elapsed();
        }
        Ok(())
    }

    fn copy_out(&self, row: usize, num_tokens: usize) -> RawMotion {
        let dims = &self.dims;
        let frames = num_tokens * dims.frames_per_token;
        let tokens = &self.token_input.tokens.row(row)[..num_tokens * dims.heads];
        RawMotion {
            num_tokens,
            count_probs: self.root_output.count_probs.row(row).to_vec(),
            root_r_g3: self.root_output.global_root.row(row)[..frames * GLOBAL_ROOT].to_vec(),
            tokens: tokens.iter().map(|&token| token as u32).collect(),
            root_r_g4: self.decoder_output.global_root.row(row)[..frames * GLOBAL_ROOT].to_vec(),
            rotations: self.decoder_output.rotations.row(row)[..frames * dims.joints * SIX_D].to_vec(),
            contacts: self.decoder_output.contacts.row(row)[..frames * dims.contacts].to_vec(),
        }
    }
}

fn timed<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = work();
    *total += started.elapsed();
    result
}

fn output(stage: Stage, problem: &str) -> EngineError {
    EngineError::Output {
        stage,
        problem: problem.to_owned(),
    }
}

#[cfg(test)]
#[path = "pipeline_tests.rs"]
mod tests;

//! Runs a batch of characters through the stages root, pose and decoder.
//!
//! Some engines are slow when they meet a tensor shape for the first time. For them, batches are
//! padded with neutral rows to one of a few [sizes](BatchSizes).
//!
//! The root stage chooses token counts. The stages behind it run rows in groups of one
//! [length](lengths) each, so that a short segment does not cost as much as a long one. A row's own
//! token count decides its length: the same request has the same frames, bit for bit, in any batch.
//! In a group, rows are ordered by their number of pose passes. The pose stage runs on a shrinking
//! prefix of the group, so that characters with one pass do not cost as much as those with ten.

use std::cmp::Reverse;
use std::time::{Duration, Instant};

use troupe_motion::model::{Dims, GLOBAL_ROOT, KeyframeTask, Motion, SIX_D, Trace, all_finite, work_of};

use super::fill::FillRows as _;
use super::sampling::{PoseSampler, fill_count_noise, fill_root_noise};
use super::tensors::{ROOM_MULTIPLE, Rows};
use super::{BatchSizes, DecoderOutput, EngineError, PoseOutput, RootInput, RootOutput, Stages, TokenInput};
use crate::generator::Generator;
use crate::motionbricks::MotionBricks;
use crate::pack::Stage;

/// Token counts that batches are padded to, in rising order: the most tokens, three quarters of
/// that, and so on down to half. Only the most tokens, unless the engine takes `any` length.
///
/// The list is short, because a batch of segments of all lengths is split into one group a length.
/// A call of a stage costs at least as much as one or two rows of the longest segment, and OpenVINO
/// has separate networks for each length.
pub fn lengths(dims: &Dims, any: bool) -> Vec<usize> {
    let shortest = match any {
        true => (dims.max_tokens / 2).max(dims.min_tokens),
        false => dims.max_tokens,
    };
    let mut lengths: Vec<usize> = std::iter::successors(Some(dims.max_tokens), |length| Some(length * 3 / 4))
        .take_while(|&length| length >= shortest)
        .collect();
    lengths.reverse();
    lengths
}

/// The index in [`lengths`] that a segment of `tokens` tokens is padded to.
pub fn length_of(lengths: &[usize], tokens: usize) -> usize {
    let longer = lengths.iter().copied().find(|&length| length >= tokens);
    longer.or(lengths.last().copied()).unwrap_or(tokens)
}

/// Rows of the batch that [`Pipeline::trial`] measures, or the largest batch if it is smaller. A
/// busy server has at least as many.
const TRIAL_ROWS: usize = 8;

/// Durations of the parts of a batch.
#[derive(Debug, Clone, Copy, Default)]
pub struct StageTimes {
    /// Filling the input tensors and choosing tokens.
    pub assemble: Duration,
    /// The root stage.
    pub root: Duration,
    /// All passes of the pose stage, summed over all groups.
    pub pose: Duration,
    /// The decoder, summed over all groups.
    pub decoder: Duration,
    /// Copying each character's rows out of the output tensors.
    pub scatter: Duration,
    /// Rows of the batch in the root stage, with padding.
    pub bucket: usize,
}

impl StageTimes {
    /// Root, pose and decoder together.
    pub fn inference(&self) -> Duration {
        self.root + self.pose + self.decoder
    }
}

/// A batch of rows of the longest length, run to measure the speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialRun {
    /// Rows of the batch.
    pub rows: usize,
    /// Their [work](troupe_motion::model::Task::work).
    pub work: u64,
    /// Duration of the three stages together.
    pub took: Duration,
}

/// The motion of one character in a batch, or its error.
pub type RowAnswer = Result<Motion, EngineError>;

/// The stages of one pack, and the buffers between them.
pub struct Pipeline {
    dims: Dims,
    stages: Box<dyn Stages>,
    sizes: BatchSizes,
    lengths: Vec<usize>,
    trial: Option<TrialRun>,
    root_input: RootInput,
    root_output: RootOutput,
    token_input: TokenInput,
    pose_output: PoseOutput,
    decoder_output: DecoderOutput,
}

impl Pipeline {
    /// A pipeline for batches of up to `max_batch` characters. It allocates all buffers.
    pub fn new(dims: Dims, stages: Box<dyn Stages>, max_batch: usize) -> Self {
        let rows = max_batch.max(1);
        Self {
            root_input: RootInput::new(&dims, rows),
            root_output: RootOutput::new(&dims, rows),
            token_input: TokenInput::new(&dims, rows),
            pose_output: PoseOutput::new(&dims, rows),
            decoder_output: DecoderOutput::new(&dims, rows),
            lengths: lengths(&dims, stages.any_length()),
            trial: None,
            sizes: BatchSizes::new(max_batch, stages.any_batch()),
            dims,
            stages,
        }
    }

    /// The stages, for another use.
    pub fn into_stages(self) -> Box<dyn Stages> {
        self.stages
    }

    /// A generator that runs the stages and takes up to `max_batch` jobs in a step: the `max_batch`
    /// of the pipeline.
    pub fn into_generator(self, max_batch: usize) -> Box<dyn Generator> {
        Box::new(MotionBricks::new(self, max_batch))
    }

    /// Runs every stage once in every shape, because the first run of a shape is slow and must not
    /// delay a request. The largest shape comes first: the engine then needs less memory for the
    /// others. An engine that takes any batch runs the largest and the smallest only; one that
    /// [opens shapes on demand](Stages::opens_on_demand) runs the smallest. Then the batch of the
    /// [trial](Pipeline::trial) is timed.
    ///
    /// # Errors
    /// [`EngineError`] if a stage fails.
    pub fn warm_up(&mut self) -> Result<(), EngineError> {
        let mut sizes = self.sizes.all().to_vec();
        let on_demand = self.stages.opens_on_demand();
        if self.stages.any_batch() {
            let largest = if on_demand { 1 } else { self.sizes.largest() };
            sizes.retain(|size| [1, largest].contains(size));
        }
        for bucket in sizes.into_iter().rev() {
            self.run_root_of_nothing(bucket)?;
            for length in self.lengths.clone().into_iter().rev() {
                self.run_tokens_of_nothing(bucket, length)?;
            }
        }
        let rows = self.sizes.within(if on_demand { 1 } else { TRIAL_ROWS });
        let mut took = Duration::ZERO;
        timed(&mut took, || {
            self.run_root_of_nothing(rows)?;
            self.run_tokens_of_nothing(rows, self.dims.max_tokens)
        })?;
        let work = rows as u64 * u64::from(work_of(self.dims.max_frames(), 3));
        self.trial = Some(TrialRun { rows, work, took });
        self.check_finite(rows)
    }

    /// Fails if the networks answer neutral rows with values that are not finite: the pack is
    /// broken.
    fn check_finite(&self, rows: usize) -> Result<(), EngineError> {
        let all = |values: &Rows<f32>| (0..rows).all(|row| all_finite(values.row(row)));
        let stages = [
            (Stage::Root, all(&self.root_output.global_root)),
            (Stage::Pose, all(&self.pose_output.logits)),
            (
                Stage::Decoder,
                all(&self.decoder_output.rotations) && all(&self.decoder_output.global_root),
            ),
        ];
        match stages.into_iter().find(|(_, finite)| !finite) {
            Some((stage, _)) => Err(EngineError::Output {
                stage,
                problem: "values that are not finite, for neutral rows; the pack is broken".to_owned(),
            }),
            None => Ok(()),
        }
    }

    /// Most characters of a batch.
    pub fn max_batch(&self) -> usize {
        self.sizes.largest()
    }

    /// How long a batch took after the warm-up. None before [`Pipeline::warm_up`].
    pub fn trial(&self) -> Option<TrialRun> {
        self.trial
    }

    fn run_root_of_nothing(&mut self, rows: usize) -> Result<(), EngineError> {
        self.clear_padding(0, rows);
        self.stages.root(rows, &self.root_input, &mut self.root_output)
    }

    fn run_tokens_of_nothing(&mut self, rows: usize, length: usize) -> Result<(), EngineError> {
        self.set_length(length);
        for row in 0..rows {
            self.token_input.clear_row(row, length);
        }
        self.stages.pose(rows, &self.token_input, &mut self.pose_output)?;
        self.stages
            .decoder(rows, &self.token_input, &mut self.decoder_output)
    }

    /// Runs a batch of at most [`Pipeline::max_batch`] items. The answers have the order of
    /// `items`. A character for which a stage gives invalid values has an error of its own, and the
    /// others have their motion.
    ///
    /// # Errors
    /// [`EngineError`] if a stage fails. The whole batch fails with it.
    pub fn run(&mut self, items: &[KeyframeTask]) -> Result<(Vec<RowAnswer>, StageTimes), EngineError> {
        let bucket = self.sizes.for_rows(items.len());
        let mut times = StageTimes {
            bucket,
            ..StageTimes::default()
        };
        timed(&mut times.assemble, || self.fill_root(items, bucket));
        timed(&mut times.root, || {
            self.stages.root(bucket, &self.root_input, &mut self.root_output)
        })?;

        let mut answers: Vec<Option<RowAnswer>> = std::iter::repeat_with(|| None).take(items.len()).collect();
        let mut members = Vec::with_capacity(items.len());
        for (row, item) in items.iter().enumerate() {
            match self.root_answer(row, item) {
                Ok(tokens) => members.push(Member {
                    row,
                    item,
                    tokens,
                    length: length_of(&self.lengths, tokens),
                }),
                Err(error) => answers[row] = Some(Err(error)),
            }
        }
        members.sort_by_key(|member| (member.length, Reverse(member.passes())));
        for group in members.chunk_by(|a, b| a.length == b.length) {
            self.run_group(group, &mut answers, &mut times)?;
        }
        // Every row is either in a group or has failed.
        let answers = answers
            .into_iter()
            .map(|answer| answer.unwrap_or(Err(EngineError::Stopped)));
        Ok((answers.collect(), times))
    }

    /// Runs the stages behind the root stage for rows of one length, ordered by falling number of
    /// passes.
    fn run_group(
        &mut self,
        group: &[Member<'_>],
        answers: &mut [Option<RowAnswer>],
        times: &mut StageTimes,
    ) -> Result<(), EngineError> {
        let bucket = self.sizes.for_rows(group.len());
        timed(&mut times.assemble, || self.fill_tokens(group, bucket));
        let chosen = self.choose_tokens(group, times)?;
        timed(&mut times.assemble, || self.override_roots(group));
        timed(&mut times.decoder, || {
            self.stages
                .decoder(bucket, &self.token_input, &mut self.decoder_output)
        })?;
        timed(&mut times.scatter, || {
            let tensors = (&self.root_output, &self.token_input, &self.decoder_output);
            for (row, (member, chosen)) in group.iter().zip(chosen).enumerate() {
                let answer = chosen.map(|()| copy_out(&self.dims, tensors, row, member));
                answers[member.row] = Some(answer);
            }
        });
        Ok(())
    }

    fn set_length(&mut self, length: usize) {
        self.token_input.set_length(&self.dims, length);
        self.pose_output.set_length(&self.dims, length);
        self.decoder_output.set_length(&self.dims, length);
    }

    fn clear_padding(&mut self, from: usize, bucket: usize) {
        for row in from..bucket {
            self.root_input.clear_row(row);
        }
    }

    fn fill_root(&mut self, items: &[KeyframeTask], bucket: usize) {
        for (row, item) in items.iter().enumerate() {
            item.fill_root_input(&self.dims, row, &mut self.root_input);
            let (seed, temperature) = (item.seed, item.temperature);
            fill_count_noise(seed, temperature, self.root_input.count_noise.row_mut(row));
            fill_root_noise(seed, temperature, self.root_input.root_noise.row_mut(row));
        }
        self.clear_padding(items.len(), bucket);
    }

    /// Resizes the token input for a group and fills it from the root stage's output.
    fn fill_tokens(&mut self, group: &[Member<'_>], bucket: usize) {
        self.set_length(group.first().map_or(self.dims.max_tokens, |member| member.length));
        for (row, member) in group.iter().enumerate() {
            let trajectory = self.root_output.global_root.row(member.row);
            member
                .item
                .fill_token_input(&self.dims, row, member.tokens, trajectory, &mut self.token_input);
        }
        for row in group.len()..bucket {
            self.token_input.clear_row(row, self.dims.min_tokens);
        }
        for row in bucket..bucket.next_multiple_of(ROOM_MULTIPLE) {
            self.token_input.spare_row(row, self.dims.min_tokens);
        }
    }

    /// Gives the decoder the root trajectories that tasks override. The pose stage runs on the
    /// predicted trajectories.
    fn override_roots(&mut self, group: &[Member<'_>]) {
        for (row, member) in group.iter().enumerate() {
            if let Some(given) = &member.item.root_override {
                let numbers = member.tokens * self.dims.frames_per_token * GLOBAL_ROOT;
                given.draw(&mut self.token_input.global_root.row_mut(row)[..numbers]);
            }
        }
    }

    /// The token count that the root stage chose for a row. Fails if the count or the trajectory is
    /// invalid.
    fn root_answer(&self, row: usize, item: &KeyframeTask) -> Result<usize, EngineError> {
        let tokens = self.checked_count(self.root_output.num_tokens.row(row)[0], item)?;
        let frames = tokens * self.dims.frames_per_token;
        let trajectory = &self.root_output.global_root.row(row)[..frames * GLOBAL_ROOT];
        if all_finite(trajectory) {
            Ok(tokens)
        } else {
            Err(output(Stage::Root, "a trajectory that is not finite"))
        }
    }

    fn checked_count(&self, chosen: i64, item: &KeyframeTask) -> Result<usize, EngineError> {
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

    /// Runs the pose stage until every row of the group has its tokens. A row with invalid logits
    /// remains in the group as padding.
    fn choose_tokens(
        &mut self,
        group: &[Member<'_>],
        times: &mut StageTimes,
    ) -> Result<Vec<Result<(), EngineError>>, EngineError> {
        let Dims { heads, codes, .. } = self.dims;
        let mut chosen = vec![Ok(()); group.len()];
        let mut samplers: Vec<PoseSampler> = group
            .iter()
            .map(|member| PoseSampler::new(member.item.seed, member.item.temperature, member.passes()))
            .collect();
        let passes = group.first().map_or(0, Member::passes);
        for pass in 1..=passes {
            let active = group.partition_point(|member| member.passes() >= pass);
            let bucket = self.sizes.for_rows(active);
            timed(&mut times.pose, || {
                self.stages.pose(bucket, &self.token_input, &mut self.pose_output)
            })?;
            let started = Instant::now();
            for (row, sampler) in samplers[..active].iter_mut().enumerate() {
                if chosen[row].is_err() {
                    continue;
                }
                let tokens = &mut self.token_input.tokens.row_mut(row)[..group[row].tokens * heads];
                if !sampler.commit(pass, codes, self.pose_output.logits.row(row), tokens) {
                    chosen[row] = Err(output(Stage::Pose, "logits that are not finite"));
                    self.token_input.clear_row(row, self.dims.min_tokens);
                }
            }
            times.assemble += started.elapsed();
        }
        Ok(chosen)
    }
}

/// Copies the motion of the group's row `row` out of the outputs.
fn copy_out(
    dims: &Dims,
    (root, input, decoder): (&RootOutput, &TokenInput, &DecoderOutput),
    row: usize,
    member: &Member<'_>,
) -> Motion {
    let frames = member.tokens * dims.frames_per_token;
    let tokens = &input.tokens.row(row)[..member.tokens * dims.heads];
    Motion {
        root: decoder.global_root.row(row)[..frames * GLOBAL_ROOT].to_vec(),
        rotations: decoder.rotations.row(row)[..frames * dims.joints * SIX_D].to_vec(),
        contacts: decoder.contacts.row(row)[..frames * dims.contacts].to_vec(),
        trace: Some(Box::new(Trace {
            num_tokens: member.tokens,
            count_probs: root.count_probs.row(member.row).to_vec(),
            root_r_g3: root.global_root.row(member.row)[..frames * GLOBAL_ROOT].to_vec(),
            tokens: tokens.iter().map(|&token| token as u32).collect(),
        })),
    }
}

/// A row in one of the groups behind the root stage.
struct Member<'a> {
    /// Its row in the root stage, which is also its index among the answers.
    row: usize,
    item: &'a KeyframeTask,
    tokens: usize,
    /// Tokens, with padding.
    length: usize,
}

impl Member<'_> {
    fn passes(&self) -> u32 {
        self.item.pose_steps.max(1)
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

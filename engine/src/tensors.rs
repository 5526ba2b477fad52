//! Input and output buffers of the stages: allocated once for the largest batch, then reused.

use std::ops::Range;

use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT, SIX_D};

/// Inputs have room for a multiple of so many rows: an engine may run a batch in calls of fixed
/// sizes, up to this one, and the last of them reads rows behind the batch.
pub(super) const ROOM_MULTIPLE: usize = 8;

/// A batch of equally wide rows in one allocation, without gaps: the first rows are a tensor as
/// they lie.
#[derive(Debug, Clone)]
pub struct Rows<T> {
    data: Vec<T>,
    width: usize,
}

impl<T: Copy + Default> Rows<T> {
    /// `rows` rows of `width` elements, all default.
    pub fn new(rows: usize, width: usize) -> Self {
        Self {
            data: vec![T::default(); rows * width],
            width,
        }
    }

    /// Makes every row `width` elements wide, at most the width it was made with. What rows hold is
    /// lost.
    fn set_width(&mut self, width: usize) {
        self.width = width;
    }

    /// One row.
    ///
    /// # Panics
    /// If there are no more than `row` rows.
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.width..(row + 1) * self.width]
    }

    /// One row, to write.
    ///
    /// # Panics
    /// If there are no more than `row` rows.
    pub fn row_mut(&mut self, row: usize) -> &mut [T] {
        &mut self.data[row * self.width..(row + 1) * self.width]
    }

    /// Elements of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Some rows in one slice.
    ///
    /// # Panics
    /// If there are fewer rows.
    pub fn range(&self, rows: Range<usize>) -> &[T] {
        &self.data[rows.start * self.width..rows.end * self.width]
    }

    /// Some rows in one slice, to write.
    ///
    /// # Panics
    /// If there are fewer rows.
    pub fn range_mut(&mut self, rows: Range<usize>) -> &mut [T] {
        &mut self.data[rows.start * self.width..rows.end * self.width]
    }

    /// Sets every element of `row`.
    pub fn fill_row(&mut self, row: usize, value: T) {
        self.row_mut(row).fill(value);
    }
}

/// Input of the root stage. `S` slots: the context frames, then the last frames of the segment;
/// absent entries are zero.
#[derive(Debug, Clone)]
pub struct RootInput {
    /// `[S, 4]`: velocity x and z in m/s, angular velocity in rad/s, height in metres; segment
    /// frame.
    pub key_local_root: Rows<f32>,
    /// `[S, 5]`: x, y, z in metres, cosine and sine of the heading; segment frame.
    pub key_global_root: Rows<f32>,
    /// `[S, joints * 9]`: pose features; segment frame.
    pub key_pose: Rows<f32>,
    /// `[S]`: 1 where the slot has a local root.
    pub has_local_root: Rows<f32>,
    /// `[S]`: 1 where the slot has a global root.
    pub has_global_root: Rows<f32>,
    /// `[S]`: 1 where the slot has a pose.
    pub has_pose: Rows<f32>,
    /// `[counts]`: 1 where the token count may be chosen.
    pub allowed_counts: Rows<f32>,
    /// `[counts]`: added to the counts' log-probabilities before the choice.
    pub count_noise: Rows<f32>,
    /// `[root choices]`: which of the ways to the targets the trajectory takes, temperature times
    /// standard normal numbers. Empty for a pack whose root stage has no such input.
    pub root_noise: Rows<f32>,
}

impl RootInput {
    /// Buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        let rows = rows.next_multiple_of(ROOM_MULTIPLE);
        let slots = dims.slots();
        Self {
            key_local_root: Rows::new(rows, slots * LOCAL_ROOT),
            key_global_root: Rows::new(rows, slots * GLOBAL_ROOT),
            key_pose: Rows::new(rows, slots * dims.pose()),
            has_local_root: Rows::new(rows, slots),
            has_global_root: Rows::new(rows, slots),
            has_pose: Rows::new(rows, slots),
            allowed_counts: Rows::new(rows, dims.counts()),
            count_noise: Rows::new(rows, dims.counts()),
            root_noise: Rows::new(rows, dims.root_choices),
        }
    }

    /// Makes `row` neutral: no constraint, every count allowed, no noise.
    pub fn clear_row(&mut self, row: usize) {
        for rows in [
            &mut self.key_local_root,
            &mut self.key_global_root,
            &mut self.key_pose,
            &mut self.has_local_root,
            &mut self.has_global_root,
            &mut self.has_pose,
            &mut self.count_noise,
            &mut self.root_noise,
        ] {
            rows.fill_row(row, 0.0);
        }
        self.allowed_counts.fill_row(row, 1.0);
    }
}

/// Output of the root stage.
#[derive(Debug, Clone)]
pub struct RootOutput {
    /// `[]`: the chosen token count.
    pub num_tokens: Rows<i64>,
    /// `[counts]`: probability of each count.
    pub count_probs: Rows<f32>,
    /// `[max frames, 5]`: r_g3 in the segment frame; padding behind the last token.
    pub global_root: Rows<f32>,
}

impl RootOutput {
    /// Buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        Self {
            num_tokens: Rows::new(rows, 1),
            count_probs: Rows::new(rows, dims.counts()),
            global_root: Rows::new(rows, dims.max_frames() * GLOBAL_ROOT),
        }
    }
}

/// Input of the pose stage and of the decoder, laid out for calls of N tokens and F frames: N is
/// [`Self::length`].
#[derive(Debug, Clone)]
pub struct TokenInput {
    length: usize,
    /// `[N, heads]`: pose tokens; the number of codes stands for a masked token.
    pub tokens: Rows<i64>,
    /// `[]`: tokens of the segment, N or fewer.
    pub num_tokens: Rows<i64>,
    /// `[F, 5]`: r_g3 in the segment frame.
    pub global_root: Rows<f32>,
    /// `[F, joints * 9]`: pose features at the frames of pose keyframes, zero elsewhere.
    pub frame_pose: Rows<f32>,
    /// `[F]`: 1 at the frames of pose keyframes.
    pub frame_mask: Rows<f32>,
}

impl TokenInput {
    /// Buffers for up to `rows` characters, laid out for the longest segments.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        let rows = rows.next_multiple_of(ROOM_MULTIPLE);
        let frames = dims.max_frames();
        Self {
            length: dims.max_tokens,
            tokens: Rows::new(rows, dims.max_tokens * dims.heads),
            num_tokens: Rows::new(rows, 1),
            global_root: Rows::new(rows, frames * GLOBAL_ROOT),
            frame_pose: Rows::new(rows, frames * dims.pose()),
            frame_mask: Rows::new(rows, frames),
        }
    }

    /// N, the token axis of a call: every row has room for so many tokens, padding included.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Lays the rows out for calls of `length` tokens, at most the pack's most. What rows hold is
    /// lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        let frames = length * dims.frames_per_token;
        self.length = length;
        self.tokens.set_width(length * dims.heads);
        self.global_root.set_width(frames * GLOBAL_ROOT);
        self.frame_pose.set_width(frames * dims.pose());
        self.frame_mask.set_width(frames);
    }

    /// Makes `row`, which is no part of the batch, harmless for a call that reads it: whatever else
    /// it holds, its codes and its token count are such as there are.
    pub fn spare_row(&mut self, row: usize, num_tokens: usize) {
        self.tokens.fill_row(row, 0);
        self.num_tokens.fill_row(row, num_tokens as i64);
    }

    /// Makes `row` neutral: `num_tokens` tokens of code 0 without any keyframe, standing at the
    /// origin.
    pub fn clear_row(&mut self, row: usize, num_tokens: usize) {
        self.tokens.fill_row(row, 0);
        self.num_tokens.fill_row(row, num_tokens as i64);
        self.frame_pose.fill_row(row, 0.0);
        self.frame_mask.fill_row(row, 0.0);
        for frame in self.global_root.row_mut(row).chunks_exact_mut(GLOBAL_ROOT) {
            frame.copy_from_slice(&[0.0, 0.0, 0.0, 1.0, 0.0]);
        }
    }
}

/// Output of the pose stage, laid out as its input is.
#[derive(Debug, Clone)]
pub struct PoseOutput {
    /// `[N, heads, codes]`: unnormalised log-probability of each code.
    pub logits: Rows<f32>,
}

impl PoseOutput {
    /// Buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        Self {
            logits: Rows::new(rows, dims.max_tokens * dims.heads * dims.codes),
        }
    }

    /// Lays the rows out for calls of `length` tokens. What rows hold is lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        self.logits.set_width(length * dims.heads * dims.codes);
    }
}

/// Output of the decoder, as far as the server reads it, laid out as its input is.
#[derive(Debug, Clone)]
pub struct DecoderOutput {
    /// `[F, joints, 6]`: 6D rotations in the segment frame.
    pub rotations: Rows<f32>,
    /// `[F, 5]`: r_g4 in the segment frame.
    pub global_root: Rows<f32>,
    /// `[F, contacts]`: probability of ground contact.
    pub contacts: Rows<f32>,
}

impl DecoderOutput {
    /// Buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        let frames = dims.max_frames();
        Self {
            rotations: Rows::new(rows, frames * dims.joints * SIX_D),
            global_root: Rows::new(rows, frames * GLOBAL_ROOT),
            contacts: Rows::new(rows, frames * dims.contacts),
        }
    }

    /// Lays the rows out for calls of `length` tokens. What rows hold is lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        let frames = length * dims.frames_per_token;
        self.rotations.set_width(frames * dims.joints * SIX_D);
        self.global_root.set_width(frames * GLOBAL_ROOT);
        self.contacts.set_width(frames * dims.contacts);
    }
}

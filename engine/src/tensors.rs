//! Input and output buffers of the stages: allocated once for the largest batch, then reused.

use std::ops::Range;

use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT, SIX_D};

/// Inputs have room for a multiple of this number of rows. An engine may run a batch in calls of
/// fixed sizes up to this one, and its last call then reads rows behind the batch.
pub(super) const ROOM_MULTIPLE: usize = 8;

/// A batch of rows of equal width in one allocation without gaps: the first rows in memory are a
/// tensor.
#[derive(Debug, Clone)]
pub struct Rows<T> {
    data: Vec<T>,
    width: usize,
}

impl<T: Copy + Default> Rows<T> {
    /// `rows` rows of `width` elements, all with the default value.
    pub fn new(rows: usize, width: usize) -> Self {
        Self {
            data: vec![T::default(); rows * width],
            width,
        }
    }

    /// Makes every row `width` elements wide, at most as wide as at creation. The contents of the
    /// rows are lost.
    fn set_width(&mut self, width: usize) {
        self.width = width;
    }

    /// The elements of one row.
    ///
    /// # Panics
    /// If there are no more than `row` rows.
    pub fn row(&self, row: usize) -> &[T] {
        &self.data[row * self.width..(row + 1) * self.width]
    }

    /// The elements of one row, for writing.
    ///
    /// # Panics
    /// If there are no more than `row` rows.
    pub fn row_mut(&mut self, row: usize) -> &mut [T] {
        &mut self.data[row * self.width..(row + 1) * self.width]
    }

    /// Number of elements of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// A range of rows as one slice.
    ///
    /// # Panics
    /// If there are fewer rows.
    pub fn range(&self, rows: Range<usize>) -> &[T] {
        &self.data[rows.start * self.width..rows.end * self.width]
    }

    /// A range of rows as one slice, for writing.
    ///
    /// # Panics
    /// If there are fewer rows.
    pub fn range_mut(&mut self, rows: Range<usize>) -> &mut [T] {
        &mut self.data[rows.start * self.width..rows.end * self.width]
    }

    /// Sets every element of `row` to `value`.
    pub fn fill_row(&mut self, row: usize, value: T) {
        self.row_mut(row).fill(value);
    }
}

/// Input of the root stage. It has `S` slots: first the context frames, then the last frames of the
/// segment. Absent entries are zero.
#[derive(Debug, Clone)]
pub struct RootInput {
    /// `[S, 4]`: velocity x and z in m/s, angular velocity in rad/s, height in metres; segment
    /// frame.
    pub key_local_root: Rows<f32>,
    /// `[S, 5]`: x, y, z in metres, cosine and sine of the heading; segment frame.
    pub key_global_root: Rows<f32>,
    /// `[S, joints * 9]`: pose features; segment frame.
    pub key_pose: Rows<f32>,
    /// `[S]`: 1 if the slot has a local root, else 0.
    pub has_local_root: Rows<f32>,
    /// `[S]`: 1 if the slot has a global root, else 0.
    pub has_global_root: Rows<f32>,
    /// `[S]`: 1 if the slot has a pose, else 0.
    pub has_pose: Rows<f32>,
    /// `[counts]`: 1 if the token count may be chosen, else 0.
    pub allowed_counts: Rows<f32>,
    /// `[counts]`: added to the counts' log-probabilities before the choice.
    pub count_noise: Rows<f32>,
    /// `[root choices]`: temperature times standard normal numbers, which decide between possible
    /// trajectories to the targets. Empty for a pack whose root stage has no such input.
    pub root_noise: Rows<f32>,
}

impl RootInput {
    /// Allocates buffers for up to `rows` characters.
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
    /// Allocates buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        Self {
            num_tokens: Rows::new(rows, 1),
            count_probs: Rows::new(rows, dims.counts()),
            global_root: Rows::new(rows, dims.max_frames() * GLOBAL_ROOT),
        }
    }
}

/// Input of the pose stage and of the decoder, with the shape of calls of N tokens and F frames. N
/// is
/// [`Self::length`].
#[derive(Debug, Clone)]
pub struct TokenInput {
    length: usize,
    /// `[N, heads]`: pose tokens; a masked token is the number of codes.
    pub tokens: Rows<i64>,
    /// `[]`: number of tokens of the segment, at most N.
    pub num_tokens: Rows<i64>,
    /// `[F, 5]`: r_g3 in the segment frame.
    pub global_root: Rows<f32>,
    /// `[F, joints * 9]`: pose features at the frames of pose keyframes, zero elsewhere.
    pub frame_pose: Rows<f32>,
    /// `[F]`: 1 at the frames of pose keyframes, else 0.
    pub frame_mask: Rows<f32>,
}

impl TokenInput {
    /// Allocates buffers for up to `rows` characters, with the shape of the longest segments.
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

    /// N, the token count of a call: every row has room for N tokens, padding included.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Changes the shape to calls of `length` tokens, at most the pack's most. The contents of the
    /// rows are lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        let frames = length * dims.frames_per_token;
        self.length = length;
        self.tokens.set_width(length * dims.heads);
        self.global_root.set_width(frames * GLOBAL_ROOT);
        self.frame_pose.set_width(frames * dims.pose());
        self.frame_mask.set_width(frames);
    }

    /// Makes `row`, which is not part of the batch, harmless for a call that reads it: its codes
    /// and its token count become valid. Other values remain.
    pub fn spare_row(&mut self, row: usize, num_tokens: usize) {
        self.tokens.fill_row(row, 0);
        self.num_tokens.fill_row(row, num_tokens as i64);
    }

    /// Makes `row` neutral: `num_tokens` tokens of code 0, no keyframes, and a root that stands at
    /// the origin.
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

/// Output of the pose stage, with the shape of its input.
#[derive(Debug, Clone)]
pub struct PoseOutput {
    /// `[N, heads, codes]`: unnormalised log-probability of each code.
    pub logits: Rows<f32>,
}

impl PoseOutput {
    /// Allocates buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        Self {
            logits: Rows::new(rows, dims.max_tokens * dims.heads * dims.codes),
        }
    }

    /// Changes the shape to calls of `length` tokens. The contents of the rows are lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        self.logits.set_width(length * dims.heads * dims.codes);
    }
}

/// The outputs of the decoder that the server reads, with the shape of its input.
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
    /// Allocates buffers for up to `rows` characters.
    pub fn new(dims: &Dims, rows: usize) -> Self {
        let frames = dims.max_frames();
        Self {
            rotations: Rows::new(rows, frames * dims.joints * SIX_D),
            global_root: Rows::new(rows, frames * GLOBAL_ROOT),
            contacts: Rows::new(rows, frames * dims.contacts),
        }
    }

    /// Changes the shape to calls of `length` tokens. The contents of the rows are lost.
    pub(super) fn set_length(&mut self, dims: &Dims, length: usize) {
        let frames = length * dims.frames_per_token;
        self.rotations.set_width(frames * dims.joints * SIX_D);
        self.global_root.set_width(frames * GLOBAL_ROOT);
        self.contacts.set_width(frames * dims.contacts);
    }
}

//! The inputs of one call: the rows of several characters, one after another.

use troupe_motion::model::{Body, DESCRIPTION, SLOTS};

use super::{PATH_FEATURES, ROW_CHANNELS};

/// Inputs of one call, with the names of docs/unimogen-pack.md. The buffers are reused.
#[derive(Debug, Default)]
pub struct Call {
    /// The network that runs it, an index of the pack's files.
    pub network: usize,
    /// Frames T of every character in the call.
    pub frames: usize,
    /// Words K of the pack.
    pub words: usize,
    /// `[R, T, 6]`.
    pub x: Vec<f32>,
    /// `[B, T]`.
    pub given: Vec<f32>,
    /// `[B, T, 3]`.
    pub path: Vec<f32>,
    /// `[B]`.
    pub step: Vec<f32>,
    /// `[B, K]`.
    pub style: Vec<f32>,
    /// `[R, 19]`.
    pub description: Vec<f32>,
    /// `[R]`.
    pub owner: Vec<i64>,
    /// `[R, 16]`.
    pub rows: Vec<i64>,
    /// `[R, 16]`.
    pub reads: Vec<f32>,
}

/// The inputs of one character in a call.
pub(super) struct Character<'a> {
    pub body: &'a Body,
    /// Noisy rows `[J + 1, T, 6]`.
    pub x: &'a [f32],
    /// `[T]`.
    pub given: &'a [f32],
    /// `[T]`.
    pub path: &'a [[f32; PATH_FEATURES]],
    pub step: usize,
    /// Weights of the words; none for a character without style.
    pub style: Option<&'a [f32]>,
}

impl Call {
    /// Characters B of the call. A character with guidance counts twice.
    pub fn characters(&self) -> usize {
        self.step.len()
    }

    /// Rows R of the call.
    pub fn row_count(&self) -> usize {
        self.owner.len()
    }

    /// Empties the call, for characters of `frames` frames and `words` words who move by `network`.
    pub(super) fn clear(&mut self, network: usize, frames: usize, words: usize) {
        let Self {
            x,
            given,
            path,
            step,
            style,
            description,
            owner,
            rows,
            reads,
            ..
        } = self;
        for list in [x, given, path, step, style, description, reads] {
            list.clear();
        }
        owner.clear();
        rows.clear();
        (self.network, self.frames, self.words) = (network, frames, words);
    }

    /// Appends a character.
    pub(super) fn push(&mut self, character: &Character<'_>) {
        let Character { body, style, .. } = character;
        let (index, first) = (self.characters() as i64, self.row_count() as i64);
        self.x.extend_from_slice(character.x);
        self.given.extend_from_slice(character.given);
        self.path.extend_from_slice(character.path.as_flattened());
        self.step.push(character.step as f32);
        match style {
            Some(style) => self.style.extend_from_slice(style),
            None => self.style.resize(self.style.len() + self.words, 0.0),
        }
        self.description
            .extend_from_slice(body.description.as_flattened());
        self.owner.resize(self.owner.len() + body.row_count(), index);
        self.rows
            .extend(body.rows.as_flattened().iter().map(|row| first + row));
        self.reads.extend_from_slice(body.reads.as_flattened());
    }

    /// The float tensors of the call, in the order of names: name, shape, numbers.
    pub(crate) fn floats(&self) -> [(&'static str, Vec<usize>, &[f32]); 7] {
        let (rows, characters, frames) = (self.row_count(), self.characters(), self.frames);
        [
            ("x", vec![rows, frames, ROW_CHANNELS], &self.x),
            ("given", vec![characters, frames], &self.given),
            ("path", vec![characters, frames, PATH_FEATURES], &self.path),
            ("step", vec![characters], &self.step),
            ("style", vec![characters, self.words], &self.style),
            ("description", vec![rows, DESCRIPTION], &self.description),
            ("reads", vec![rows, SLOTS], &self.reads),
        ]
    }

    /// The integer tensors of the call: name, shape, numbers.
    pub(crate) fn integers(&self) -> [(&'static str, Vec<usize>, &[i64]); 2] {
        let rows = self.row_count();
        [
            ("owner", vec![rows], &self.owner),
            ("rows", vec![rows, SLOTS], &self.rows),
        ]
    }
}

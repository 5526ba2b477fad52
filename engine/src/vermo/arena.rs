//! The cache: one slot with keys and values for each sequence that is being written.
//!
//! The slots of all sequences are adjacent in memory, so that a call reads them without copying.
//! When a sequence ends, the last slot moves into its slot. A slot has as many columns as the
//! longest message, in every call. With fewer columns a sum would be rounded differently, and the
//! bits of a sequence would depend on the other sequences.

use crate::pack::VerMoDoc;

/// Shape of a slot: `[layers, 2, key_heads, positions, head_width]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Layers times two (keys and values) times heads.
    pub heads: usize,
    /// Columns of a slot.
    pub positions: usize,
    /// Numbers of a head in one column.
    pub width: usize,
}

impl Shape {
    /// The shape for a pack.
    pub fn new(table: &VerMoDoc) -> Self {
        Self {
            heads: table.layers * 2 * table.key_heads,
            positions: table.positions,
            width: table.head_width,
        }
    }

    /// Number of values in `columns` columns.
    pub fn numbers(&self, columns: usize) -> usize {
        self.heads * columns * self.width
    }

    /// Number of values in a slot.
    pub fn slot(&self) -> usize {
        self.numbers(self.positions)
    }
}

/// The slots of a cache, in one allocation.
#[derive(Debug)]
pub(super) struct Arena {
    shape: Shape,
    numbers: Vec<f32>,
}

impl Arena {
    pub(super) fn new(shape: Shape) -> Self {
        Self {
            shape,
            numbers: Vec::new(),
        }
    }

    pub(super) fn shape(&self) -> Shape {
        self.shape
    }

    /// The first `slots` slots. Columns that no sequence has written yet are 0 or left over from
    /// another sequence. They are not read.
    pub(super) fn first(&mut self, slots: usize) -> &[f32] {
        let wanted = slots * self.shape.slot();
        if self.numbers.len() < wanted {
            self.numbers.resize(wanted, 0.0);
        }
        &self.numbers[..wanted]
    }

    /// Writes the first `count` of the columns `[heads, columns, width]` into a slot, from column
    /// `start` on.
    pub(super) fn write(&mut self, slot: usize, start: usize, count: usize, columns: &[f32]) {
        self.first(slot + 1);
        let Shape {
            heads,
            positions,
            width,
        } = self.shape;
        let given = columns.len() / heads;
        let slot = &mut self.numbers[slot * heads * positions * width..];
        for (head, from) in columns.chunks_exact(given).enumerate() {
            let to = (head * positions + start) * width;
            slot[to..to + count * width].copy_from_slice(&from[..count * width]);
        }
    }

    /// Copies one slot over another.
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        self.first(from.max(to) + 1);
        let slot = self.shape.slot();
        self.numbers
            .copy_within(from * slot..(from + 1) * slot, to * slot);
    }
}

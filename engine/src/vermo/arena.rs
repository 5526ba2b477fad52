//! The cache: a slot of keys and values for each sequence that is being written.
//!
//! The slots of all sequences lie one behind another, so that a call reads them where they are. A
//! sequence that ends leaves its slot to the last one. The columns of a slot are as many as the
//! longest message has, in every call: a sum over fewer would be rounded in another way, and a
//! sequence would get other bits with others beside it.

use crate::pack::VerMoDoc;

/// Shape of a slot: `[layers, 2, key_heads, positions, head_width]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Layers, keys and values, heads.
    pub heads: usize,
    /// Columns.
    pub positions: usize,
    /// Numbers of a head in a column.
    pub width: usize,
}

impl Shape {
    /// Of a pack.
    pub fn new(table: &VerMoDoc) -> Self {
        Self {
            heads: table.layers * 2 * table.key_heads,
            positions: table.positions,
            width: table.head_width,
        }
    }

    /// Numbers of so many columns.
    pub fn numbers(&self, columns: usize) -> usize {
        self.heads * columns * self.width
    }

    /// Numbers of a slot.
    pub fn slot(&self) -> usize {
        self.numbers(self.positions)
    }
}

/// Slots of a cache.
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

    /// The first `slots` slots. What no sequence has written is 0, or left by another that is over:
    /// it is not read.
    pub(super) fn first(&mut self, slots: usize) -> &[f32] {
        let wanted = slots * self.shape.slot();
        if self.numbers.len() < wanted {
            self.numbers.resize(wanted, 0.0);
        }
        &self.numbers[..wanted]
    }

    /// Puts the first `count` of the columns `[heads, columns, width]` into a slot, from column
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

    /// Copies a slot over another.
    pub(super) fn copy(&mut self, from: usize, to: usize) {
        self.first(from.max(to) + 1);
        let slot = self.shape.slot();
        self.numbers
            .copy_within(from * slot..(from + 1) * slot, to * slot);
    }
}

//! What a character wants made of the networks.

use troupe_character::live::{PlanRequest, WordsRequest};

/// What a character wants made.
#[derive(Debug, Default)]
pub struct Wants {
    /// A plan.
    pub plan: Option<PlanRequest>,
    /// Words.
    pub words: Option<WordsRequest>,
}

impl Wants {
    /// Whether it is nothing.
    pub fn is_empty(&self) -> bool {
        self.plan.is_none() && self.words.is_none()
    }
}

/// What to do where the batcher's queue is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patience {
    /// Ask again until there is a place: the character waits for this very plan.
    Waits,
    /// Give up: the character asks again at its next frame, from where it then is.
    Fails,
}

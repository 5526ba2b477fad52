//! The requests of a character to the networks.

use troupe_character::live::{PlanRequest, WordsRequest};

/// The requests of a character to the networks, at most one of each kind.
#[derive(Debug, Default)]
pub struct Wants {
    /// The next frames of its motion, to replace or extend the buffered ones.
    pub plan: Option<PlanRequest>,
    /// The motion of a sentence.
    pub words: Option<WordsRequest>,
}

impl Wants {
    /// Whether there is no request.
    pub fn is_empty(&self) -> bool {
        self.plan.is_none() && self.words.is_none()
    }
}

/// What to do if the batcher's queue is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Patience {
    /// Try again until there is room, because the character cannot advance without this plan.
    Waits,
    /// Give up. The character sends a fresh request with its next frame.
    Fails,
}

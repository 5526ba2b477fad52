//! What a caller gets: an answer as a whole, or piece by piece.

use std::time::{Duration, Instant};

use troupe_motion::model::{Motion, Output};

/// A served request.
#[derive(Debug, Default)]
pub struct Served {
    /// One answer a character, in the request's order.
    pub outputs: Vec<Output>,
    /// From the arrival to the start of its first character.
    pub queued: Duration,
    /// From the arrival to the start of the first step that gave some of the answer.
    pub started: Duration,
    /// From the arrival to the end of the last step that gave some of the answer.
    pub finished: Duration,
    /// Filling inputs, over the steps that gave some of the answer. Workers work side by side, so
    /// these sums may be longer than the time from start to finish.
    pub assemble: Duration,
    /// The networks, over the same.
    pub inference: Duration,
    /// Copying out of the output tensors, over the same.
    pub scatter: Duration,
    /// What its characters take of the workers' time, on average.
    pub work: Duration,
    /// Jobs of the largest of these steps.
    pub batch_size: usize,
    /// These steps.
    pub steps: Vec<ServedStep>,
}

/// A step that gave some of an answer. Other requests may have been in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServedStep {
    /// When it started.
    pub started: Instant,
    /// When it ended.
    pub ended: Instant,
    /// Jobs in it.
    pub jobs: usize,
    /// Rows of its network calls, padding included; 0 where there is no such number.
    pub rows: usize,
    /// The networks.
    pub inference: Duration,
}

impl Served {
    /// The answers as motions; what is none is left out.
    pub fn into_motions(self) -> impl Iterator<Item = Motion> {
        self.outputs.into_iter().filter_map(Output::into_motion)
    }
}

/// A part of a streamed answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// The character that it is of.
    pub character: usize,
    /// What follows the character's parts before.
    pub output: Output,
    /// Whether it is the character's last.
    pub is_last: bool,
    /// From the request's arrival to the start of its first character.
    pub queued: Duration,
    /// The step that made it.
    pub step: ServedStep,
}

//! Answers: as a whole, or piece by piece.

use std::time::{Duration, Instant};

use troupe_motion::model::{Motion, Output};

/// The whole answer to a request. Its steps are those that made some of the answer.
#[derive(Debug, Default)]
pub struct Served {
    /// One output for each character, in the request's order.
    pub outputs: Vec<Output>,
    /// From the arrival until the first character was given to a worker.
    pub queued: Duration,
    /// From the arrival to the start of the first step.
    pub started: Duration,
    /// From the arrival to the end of the last step.
    pub finished: Duration,
    /// Time to fill input tensors, summed over the steps. Workers run in parallel, so this sum and
    /// the next two may be longer than the time from `started` to `finished`.
    pub assemble: Duration,
    /// Time of the networks, summed over the steps.
    pub inference: Duration,
    /// Time to copy the output tensors, summed over the steps.
    pub scatter: Duration,
    /// Worker time of the characters, estimated from the mean time for one character.
    pub work: Duration,
    /// Jobs of the largest step.
    pub batch_size: usize,
    /// In the order in which workers delivered them.
    pub steps: Vec<ServedStep>,
}

/// A step that made some of an answer. Jobs of other requests may have been in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServedStep {
    /// Start of the step on its worker.
    pub started: Instant,
    /// End of the step on its worker.
    pub ended: Instant,
    /// Jobs of all requests in it.
    pub jobs: usize,
    /// Rows of its network calls, including padding; 0 if the generator does not count them.
    pub rows: usize,
    /// Time of its networks.
    pub inference: Duration,
}

impl Served {
    /// The outputs that are motions, in order.
    pub fn into_motions(self) -> impl Iterator<Item = Motion> {
        self.outputs.into_iter().filter_map(Output::into_motion)
    }
}

/// A piece of a streamed answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Index of the character in the request.
    pub character: usize,
    /// Continues the character's previous piece.
    pub output: Output,
    /// Whether it is the character's last piece.
    pub is_last: bool,
    /// From the request's arrival until its first character was given to a worker.
    pub queued: Duration,
    /// The step that made this piece.
    pub step: ServedStep,
}

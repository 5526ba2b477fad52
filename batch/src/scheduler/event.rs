//! What happens to a scheduler, and what it has done about it.

use std::time::Duration;

use super::limits::QueueRefusal;
use crate::order::{Class, Order};

/// Names a request for as long as it is known to the scheduler. Never reused, and rising with the
/// arrivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// A request asks for a place in the queue. Unless an [`Action::Refuse`] follows, it has one.
    Arrived {
        /// The new request.
        request: RequestId,
        /// How many characters it carries; at least one.
        characters: usize,
        /// Its claim on a place.
        order: Order,
    },
    /// Nobody waits for the request's answer any more.
    Gone {
        /// The abandoned request.
        request: RequestId,
    },
    /// A worker that has not been ready yet tried how fast it is.
    Tried {
        /// Characters of a batch.
        characters: usize,
        /// How long it took.
        took: Duration,
    },
    /// A worker is between two steps: it has started, was woken, or a step (a batch, where the
    /// family has one step) has ended.
    Ready(Ready<'a>),
    /// A worker will step no more.
    WorkerLost {
        /// Its number.
        worker: usize,
        /// What it had.
        finished: &'a [Finished],
    },
}

/// A worker between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ready<'a> {
    /// Its number.
    pub worker: usize,
    /// How many more characters it takes.
    pub room: usize,
    /// Whether it has nothing left to do.
    pub is_idle: bool,
    /// How long the step that has ended took; none where it did none.
    pub took: Option<Duration>,
    /// What is over with that step, or was dropped before it.
    pub finished: &'a [Finished],
}

/// Characters of a request that are with a worker no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finished {
    /// The request.
    pub request: RequestId,
    /// How many.
    pub characters: usize,
}

/// What to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The request has no place in the queue; it is forgotten.
    Refuse {
        /// The refused request.
        request: RequestId,
        /// Why.
        refusal: QueueRefusal,
    },
    /// A newer plan of the same owner has the place of this one, which is forgotten.
    Supersede {
        /// The older request.
        request: RequestId,
    },
    /// What is left of the request has expired, and is forgotten.
    Expire {
        /// The expired request.
        request: RequestId,
        /// How long it waited.
        waited: Duration,
    },
    /// The rest of an abandoned request has left the queue unserved.
    Drop {
        /// The abandoned request.
        request: RequestId,
        /// Characters that will not be served.
        characters: usize,
    },
    /// The worker takes these along into its next step.
    Start(Batch),
    /// An idle worker has something to do: it is to say [`Event::Ready`] again.
    Wake {
        /// Its number.
        worker: usize,
    },
}

/// Why a batch is as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BatchReason {
    /// The worker was idle when the work arrived.
    Idle,
    /// The worker came from a step and took what waited.
    Backlog,
    /// More waits than fits.
    Full,
}

impl BatchReason {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Idle, Self::Backlog, Self::Full];

    /// The reason as a metric label.
    pub fn label(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Backlog => "backlog",
            Self::Full => "full",
        }
    }
}

/// What a worker is to take: parts of requests, the most urgent first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Batch {
    /// The worker.
    pub worker: usize,
    /// Never empty.
    pub slices: Vec<RequestSlice>,
    /// Why it is as it is.
    pub reason: BatchReason,
}

/// Consecutive characters of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RequestSlice {
    /// The request they belong to.
    pub request: RequestId,
    /// Its class.
    pub class: Class,
    /// Index of the first character within the request.
    pub first: usize,
    /// How many characters, at least one.
    pub characters: usize,
    /// How long they waited since the request's arrival.
    pub waited: Duration,
}

//! The events that a scheduler takes, and the actions that it returns.

use std::time::Duration;

use super::limits::QueueRefusal;
use crate::order::{Class, Order};

/// Identifies a request. Ids rise with the arrivals and are never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// An event, as the callers and workers of a pack cause it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event<'a> {
    /// A new request. It is in the queue unless an [`Action::Refuse`] follows.
    Arrived {
        /// The new request.
        request: RequestId,
        /// Characters of the request, at least one.
        characters: usize,
        /// Decides its position in the queue.
        order: Order,
    },
    /// The caller no longer waits for the request's answer.
    Gone {
        /// The abandoned request.
        request: RequestId,
    },
    /// A starting worker measured its speed with a trial batch.
    Tried {
        /// Work of the trial batch.
        work: u64,
        /// Time for the trial batch.
        took: Duration,
    },
    /// A worker is between two steps: it has started, was woken, or has ended a step. (In a family
    /// with one step, a step is a whole batch.)
    Ready(Ready<'a>),
    /// A worker panicked.
    WorkerLost {
        /// Number of the worker, from 0.
        worker: usize,
        /// All characters that were with it.
        finished: &'a [Finished],
    },
}

/// A worker between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ready<'a> {
    /// Number of the worker, from 0.
    pub worker: usize,
    /// How many more characters it can take.
    pub room: usize,
    /// Whether it has no jobs.
    pub is_idle: bool,
    /// Time of the step that has just ended; none if no step came before.
    pub took: Option<Duration>,
    /// Characters that were finished in that step or cancelled before it.
    pub finished: &'a [Finished],
}

/// Characters of a request that have left their worker: done, failed or cancelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finished {
    /// The request to which they belong.
    pub request: RequestId,
    /// How many have left, at least one.
    pub characters: usize,
}

/// An action, which the caller of [`Scheduler::step`](super::Scheduler::step) must carry out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The request is not in the queue; the scheduler has forgotten it.
    Refuse {
        /// The refused request.
        request: RequestId,
        /// Whether the queue was full or too slow.
        refusal: QueueRefusal,
    },
    /// The request leaves the full queue, because a client with less waiting work needs its room.
    /// The scheduler has forgotten it.
    PushOut {
        /// The least urgent request of the client with most waiting work.
        request: RequestId,
        /// As for a request that finds the queue full.
        refusal: QueueRefusal,
    },
    /// A newer plan of the same owner replaced this one, which the scheduler has forgotten.
    Supersede {
        /// The older request.
        request: RequestId,
    },
    /// The waiting rest of the request has expired, and the scheduler has forgotten it.
    Expire {
        /// The expired request.
        request: RequestId,
        /// Time since its arrival.
        waited: Duration,
    },
    /// The waiting rest of an abandoned request has left the queue.
    Drop {
        /// The abandoned request.
        request: RequestId,
        /// Characters that will not be served.
        characters: usize,
    },
    /// A worker gets new jobs for its next step.
    Start(Batch),
    /// Wake an idle worker. It then sends [`Event::Ready`] again.
    Wake {
        /// Number of the worker, from 0.
        worker: usize,
    },
}

/// Why a batch was formed, and why it is no larger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BatchReason {
    /// An idle worker took all ready work.
    Idle,
    /// A worker took all ready work after a step.
    Backlog,
    /// More work was ready than the worker took.
    Full,
}

impl BatchReason {
    /// In the order of the discriminants.
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

/// New jobs for a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Batch {
    /// Number of the worker, from 0.
    pub worker: usize,
    /// The most urgent first; never empty.
    pub slices: Vec<RequestSlice>,
    /// For the metrics.
    pub reason: BatchReason,
}

/// Consecutive characters of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RequestSlice {
    /// The request to which they belong.
    pub request: RequestId,
    /// Class of the request, for the metrics.
    pub class: Class,
    /// Index of the first character within the request.
    pub first: usize,
    /// How many characters, at least one.
    pub characters: usize,
    /// Time since the request's arrival.
    pub waited: Duration,
}

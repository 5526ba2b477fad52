//! The batch scheduler as a pure state machine: [`Scheduler::step`] takes what happened and answers what to do.
//! It reads no clock, holds no work and does no I/O, so every rule below is tested without threads or time.
//!
//! - The queue is bounded in characters: a request that does not fit is refused whole, at once. A batch that a free
//!   engine is about to take does not count.
//! - While the engine is busy, requests wait. When it is free, everything that waits is cut together, up to the
//!   batch limit; a lone request is cut at once, with no artificial delay.
//! - First come, first served. A request larger than what is left of a batch is split over several.
//! - Work whose caller has gone is dropped before it is cut.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Names a request for as long as it is known to the scheduler; never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RequestId(pub u64);

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A request asks for a place in the queue.
    Arrived {
        /// The new request.
        request: RequestId,
        /// How many characters it carries; at least one.
        characters: usize,
    },
    /// Nobody waits for the request's answer any more.
    Gone {
        /// The abandoned request.
        request: RequestId,
    },
    /// The engine is ready for a batch: it has started, or finished the previous one.
    EngineFree,
    /// Everything that has happened so far was told, so a batch may be cut now. (Without this, the first of many
    /// requests that arrive together would always travel alone.)
    Settled,
}

/// What to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The request has its place in the queue.
    Admit {
        /// The admitted request.
        request: RequestId,
    },
    /// The queue has no room for the request; it is forgotten.
    Refuse {
        /// The refused request.
        request: RequestId,
        /// Characters already waiting.
        pending_characters: usize,
    },
    /// The rest of an abandoned request has left the queue unserved.
    Drop {
        /// The abandoned request.
        request: RequestId,
        /// Characters that will not be served.
        characters: usize,
    },
    /// Run this batch; the engine counts as busy until the next [`Event::EngineFree`].
    Cut(Cut),
}

/// Why a batch was cut when it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CutReason {
    /// The engine was idle when the work arrived.
    Idle,
    /// The engine became free and took all that waited.
    Backlog,
    /// More waits than fits into one batch.
    Full,
}

impl CutReason {
    /// The reason as a metric label.
    pub fn label(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Backlog => "backlog",
            Self::Full => "full",
        }
    }
}

/// One batch: parts of requests, in the order of their arrival.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    /// What the batch carries; never empty.
    pub parts: Vec<Part>,
    /// Why it was cut now.
    pub reason: CutReason,
}

impl Cut {
    /// Characters in the batch.
    pub fn characters(&self) -> usize {
        self.parts.iter().map(|part| part.characters).sum()
    }
}

/// Consecutive characters of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// The request they belong to.
    pub request: RequestId,
    /// Index of the first character within the request.
    pub first: usize,
    /// How many characters, at least one.
    pub characters: usize,
    /// How long they waited since the request's arrival.
    pub waited: Duration,
}

/// The limits that a scheduler keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most characters in one batch.
    pub max_batch: usize,
    /// Most characters that may wait.
    pub max_queued: usize,
}

#[derive(Debug)]
struct Waiting {
    request: RequestId,
    next: usize,
    left: usize,
    arrived: Instant,
}

/// The state machine. See the module's text for its rules.
#[derive(Debug)]
pub struct Scheduler {
    limits: Limits,
    queue: VecDeque<Waiting>,
    pending_characters: usize,
    engine: Engine,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Engine {
    Busy,
    /// Free since the last event, so whatever waits has piled up meanwhile.
    JustFreed,
    Idle,
}

impl Scheduler {
    /// An empty scheduler whose engine has not reported yet.
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            queue: VecDeque::new(),
            pending_characters: 0,
            engine: Engine::Busy,
        }
    }

    /// Characters that wait for a batch.
    pub fn pending_characters(&self) -> usize {
        self.pending_characters
    }

    /// Requests that wait with at least one character.
    pub fn pending_requests(&self) -> usize {
        self.queue.len()
    }

    /// Requests that wait, oldest first.
    pub fn waiting(&self) -> impl Iterator<Item = RequestId> {
        self.queue.iter().map(|waiting| waiting.request)
    }

    /// Takes one event and answers what to do, at most one action an event.
    pub fn step(&mut self, now: Instant, event: Event) -> Option<Action> {
        match event {
            Event::Arrived { request, characters } => Some(self.arrive(now, request, characters)),
            Event::Gone { request } => self.forget(request),
            Event::EngineFree => {
                self.engine = Engine::JustFreed;
                None
            }
            Event::Settled => self.cut(now),
        }
    }

    fn arrive(&mut self, now: Instant, request: RequestId, characters: usize) -> Action {
        let pending_characters = self.pending_characters;
        // What a free engine is about to take does not count as waiting.
        let leaving = if self.engine == Engine::Busy {
            0
        } else {
            self.limits.max_batch
        };
        if characters > (self.limits.max_queued + leaving).saturating_sub(pending_characters) {
            return Action::Refuse {
                request,
                pending_characters,
            };
        }
        self.pending_characters += characters;
        self.queue.push_back(Waiting {
            request,
            next: 0,
            left: characters,
            arrived: now,
        });
        Action::Admit { request }
    }

    fn forget(&mut self, request: RequestId) -> Option<Action> {
        let place = self.queue.iter().position(|waiting| waiting.request == request)?;
        let characters = self.queue.remove(place)?.left;
        self.pending_characters -= characters;
        Some(Action::Drop { request, characters })
    }

    fn cut(&mut self, now: Instant) -> Option<Action> {
        if self.engine == Engine::Busy {
            return None;
        }
        let reason = match self.engine {
            _ if self.pending_characters > self.limits.max_batch => CutReason::Full,
            Engine::JustFreed => CutReason::Backlog,
            _ => CutReason::Idle,
        };
        let mut room = self.limits.max_batch;
        let mut parts = Vec::new();
        while let Some(waiting) = self.queue.front_mut() {
            let characters = waiting.left.min(room);
            if characters == 0 {
                break;
            }
            parts.push(Part {
                request: waiting.request,
                first: waiting.next,
                characters,
                waited: now.saturating_duration_since(waiting.arrived),
            });
            waiting.next += characters;
            waiting.left -= characters;
            room -= characters;
            self.pending_characters -= characters;
            if waiting.left == 0 {
                self.queue.pop_front();
            }
        }
        self.engine = if parts.is_empty() {
            Engine::Idle
        } else {
            Engine::Busy
        };
        (!parts.is_empty()).then_some(Action::Cut(Cut { parts, reason }))
    }
}

#[cfg(test)]
#[path = "scheduler_tests.rs"]
mod tests;

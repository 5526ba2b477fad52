//! Who goes first.

use std::time::Instant;

/// What kind of work a request is. Inside a class, the earliest deadline goes first; between
/// classes, each class's [offset](super::scheduler::Limits::class_offset) is added to the deadline,
/// so that what waits long enough goes first whatever its class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// Plans of live characters whose frames are shown by the clock.
    Live,
    /// Plans of characters whose caller waits for their frames.
    Step,
    /// InBetween calls.
    Request,
}

impl Class {
    /// All classes, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Live, Self::Step, Self::Request];

    /// The class as a metric label.
    pub fn label(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Step => "step",
            Self::Request => "request",
        }
    }
}

/// Names a session to the scheduler. At most one plan of an owner is with a worker at a time, and
/// at most one waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OwnerId(pub u64);

/// A request's claim on its place in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order {
    /// What kind of work it is.
    pub class: Class,
    /// When the answer should be there. It orders the queue; work whose deadline has passed is done
    /// all the same.
    pub deadline: Instant,
    /// When nobody wants the answer any more: what has not started by then is not run.
    pub expires: Option<Instant>,
    /// Whose plan it is, where it is one.
    pub owner: Option<OwnerId>,
}

impl Order {
    /// An InBetween call.
    pub fn request(deadline: Instant) -> Self {
        Self {
            class: Class::Request,
            deadline,
            expires: None,
            owner: None,
        }
    }

    /// A plan of a live character, which is to take over at `deadline`.
    pub fn live(owner: OwnerId, deadline: Instant) -> Self {
        Self {
            class: Class::Live,
            deadline,
            expires: None,
            owner: Some(owner),
        }
    }

    /// A plan of a character whose caller waits for it.
    pub fn step(owner: OwnerId, deadline: Instant) -> Self {
        Self {
            class: Class::Step,
            ..Self::live(owner, deadline)
        }
    }

    /// The same, not to be run any more from `at` on.
    pub fn expiring(self, at: Instant) -> Self {
        Self {
            expires: Some(at),
            ..self
        }
    }
}

//! A request's class, deadline and owner, which decide when it is served.

use std::time::Instant;

use troupe_base::turns::ClientId;

/// The kind of a request. Within a class, the earliest deadline goes first. To compare requests of
/// different classes, the class's [offset](super::scheduler::Limits::class_offset) is added to the
/// deadline. So a request that has waited for long enough goes first, whatever its class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Class {
    /// Plans of live characters whose frames are shown by the clock.
    Live,
    /// Plans of characters whose caller waits for the frames of a `Step` call.
    Step,
    /// Calls that are no plans of a session: InBetween, Generate, Describe.
    Request,
}

impl Class {
    /// In the order of the discriminants.
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

/// Identifies a session to the scheduler. At most one plan of an owner is with a worker at a time,
/// and at most one waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OwnerId(pub u64);

/// Decides a request's position in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order {
    /// Moves the deadline by the class's offset.
    pub class: Class,
    /// When the answer should be ready. It only orders the queue: work is also done after its
    /// deadline.
    pub deadline: Instant,
    /// From then on the answer is useless: characters that have not started are not run.
    pub expires: Option<Instant>,
    /// The session whose plan it is; none for calls.
    pub owner: Option<OwnerId>,
    /// The client that asks. Clients with waiting work get the same share.
    pub client: ClientId,
    /// Work of one character, as [`Task::work`](troupe_motion::model::Task::work) says. The batcher
    /// sets it by the tasks; before, it is a guess. At least 1.
    pub work: u32,
}

impl Order {
    /// A call that is no plan of a session.
    pub fn request(deadline: Instant) -> Self {
        Self {
            class: Class::Request,
            deadline,
            expires: None,
            owner: None,
            client: ClientId::default(),
            work: 1,
        }
    }

    /// A plan of a live character whose first frame is needed at `deadline`.
    pub fn live(owner: OwnerId, deadline: Instant) -> Self {
        Self {
            class: Class::Live,
            deadline,
            expires: None,
            owner: Some(owner),
            client: ClientId::default(),
            work: 1,
        }
    }

    /// A plan of a character whose caller waits for it in a `Step` call.
    pub fn step(owner: OwnerId, deadline: Instant) -> Self {
        Self {
            class: Class::Step,
            ..Self::live(owner, deadline)
        }
    }

    /// The same order, for a request of this client.
    pub fn of(self, client: ClientId) -> Self {
        Self { client, ..self }
    }

    /// Work of one character, at least 1. It counts in the client's share.
    pub(crate) fn cost(&self) -> u64 {
        u64::from(self.work.max(1))
    }

    /// The same order, but work that has not started at `at` is dropped.
    pub fn expiring(self, at: Instant) -> Self {
        Self {
            expires: Some(at),
            ..self
        }
    }
}

//! Limits of a scheduler, and the refusals that follow from them.

use std::time::Duration;

use crate::order::Class;

/// Shortest time after which a refused caller should try again.
const MIN_RETRY: Duration = Duration::from_millis(10);

/// The limits of a pack's scheduler. The engine and the server's options decide them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Workers of the pack.
    pub workers: usize,
    /// Most characters in a batch.
    pub max_batch: usize,
    /// Rows of the engine's largest call if it cuts batches into calls; otherwise 0. A batch larger
    /// than one call consists of whole calls, because further rows would need small calls, which
    /// cost more per row.
    pub call_rows: usize,
    /// Longest time of a batch, estimated from measured steps; zero for no limit.
    pub max_batch_time: Duration,
    /// The same while no plan came lately. A large network needs large batches to be fast, and then
    /// no live character waits for them.
    pub calls_batch_time: Duration,
    /// Most of a batch for one client while another client calls for little, or for a group while a
    /// client of another group does; zero for no limit. So a client with few calls does not wait
    /// long for a batch of another.
    pub shared_batch_time: Duration,
    /// Most waiting characters of calls.
    pub max_queued: usize,
    /// Most waiting characters of plans. A session has at most one, so if this is at least the
    /// number of sessions, no plan is ever refused, however many calls wait.
    pub max_live: usize,
    /// A call that would wait for longer than this is refused; zero for no limit.
    pub max_wait: Duration,
    /// How long a call waits before it goes in front of live plans.
    pub ageing: Duration,
    /// One of this number of places in batches goes to a waiting call; 0 for none. In a large crowd
    /// some plans always wait, and would make each call wait for `ageing` or be refused.
    pub call_share: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            workers: 1,
            max_batch: 64,
            call_rows: 0,
            // Two frames at 30 Hz. Half of a plan's usual look-ahead is then left for its own
            // batch.
            max_batch_time: Duration::from_millis(66),
            calls_batch_time: Duration::from_millis(500),
            shared_batch_time: Duration::from_millis(8),
            max_queued: 1024,
            max_live: 16_384,
            max_wait: Duration::from_secs(1),
            ageing: Duration::from_secs(2),
            call_share: 8,
        }
    }
}

impl Limits {
    /// Added to the deadlines of the class, to compare them with those of other classes.
    pub fn class_offset(&self, class: Class) -> Duration {
        match class {
            Class::Live => Duration::ZERO,
            // After frames that the clock shows, and before calls.
            Class::Step => self.ageing / 2,
            Class::Request => self.ageing,
        }
    }

    /// The largest number of characters that fills whole calls, at most `characters`. If they fill
    /// no call, all of them.
    pub fn whole_calls(&self, characters: usize) -> usize {
        match characters.checked_rem(self.call_rows) {
            Some(rest) if characters > self.call_rows => characters - rest,
            _ => characters,
        }
    }

    /// Most waiting characters of the class.
    pub fn room(&self, class: Class) -> usize {
        match class {
            Class::Live | Class::Step => self.max_live,
            Class::Request => self.max_queued,
        }
    }
}

/// Why the queue refuses a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueRefusal {
    /// Waiting characters of all classes.
    pub pending_characters: usize,
    /// How long a request of this class would wait.
    pub expected_wait: Duration,
    /// Whether only room is missing; otherwise the wait is too long.
    pub full: bool,
}

impl QueueRefusal {
    /// How long the caller should wait before it tries again: until the requests that wait now
    /// should have started.
    pub fn retry_after(&self) -> Duration {
        self.expected_wait.max(MIN_RETRY)
    }
}

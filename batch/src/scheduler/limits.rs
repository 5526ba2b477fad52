//! The limits that a scheduler keeps.

use std::time::Duration;

use crate::order::Class;

/// Shortest time after which it is worth to try again.
const MIN_RETRY: Duration = Duration::from_millis(10);

/// The limits that a scheduler keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Workers of the pack.
    pub workers: usize,
    /// Most characters that a worker takes at once.
    pub max_batch: usize,
    /// Rows of the engine's largest call, where it cuts batches into calls; else 0. More than a
    /// call is taken in whole calls: rows beyond them would run in small ones, which cost more a
    /// row.
    pub call_rows: usize,
    /// Longest time of what a worker takes at once, by measure; zero for no such limit.
    pub max_batch_time: Duration,
    /// Most characters of calls that may wait.
    pub max_queued: usize,
    /// Most characters of live plans that may wait. A session has one at most, so with a place for
    /// each session none is ever refused, however many calls wait.
    pub max_live: usize,
    /// A call that would wait for longer than this is refused; zero for no such limit.
    pub max_wait: Duration,
    /// What calls wait for before they go in front of live plans.
    pub ageing: Duration,
    /// One of so many places goes to a call first, where one waits; 0 for none. Of a large crowd
    /// some plans always wait, and made each call wait for `ageing`, or be refused.
    pub call_share: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            workers: 1,
            max_batch: 64,
            call_rows: 0,
            // Two frames at 30 Hz: half of the usual look-ahead of a plan is left for its own
            // batch.
            max_batch_time: Duration::from_millis(66),
            max_queued: 1024,
            max_live: 16_384,
            max_wait: Duration::from_secs(1),
            ageing: Duration::from_secs(2),
            call_share: 8,
        }
    }
}

impl Limits {
    /// What is added to a deadline of the class, to order it among those of the other.
    pub fn class_offset(&self, class: Class) -> Duration {
        match class {
            Class::Live => Duration::ZERO,
            // Behind what is shown by the clock, and before what nobody sees yet.
            Class::Step => self.ageing / 2,
            Class::Request => self.ageing,
        }
    }

    /// The most of so many characters that fill whole calls; all of them if they are less than one.
    pub fn whole_calls(&self, characters: usize) -> usize {
        match characters.checked_rem(self.call_rows) {
            Some(rest) if characters > self.call_rows => characters - rest,
            _ => characters,
        }
    }

    /// Most characters of the class that may wait.
    pub fn room(&self, class: Class) -> usize {
        match class {
            Class::Live | Class::Step => self.max_live,
            Class::Request => self.max_queued,
        }
    }
}

/// Why a request has no place in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueRefusal {
    /// Characters that wait, of all classes.
    pub pending_characters: usize,
    /// How long a request of the class would wait.
    pub expected_wait: Duration,
    /// Whether there is no room; else the wait is too long.
    pub full: bool,
}

impl QueueRefusal {
    /// When what waits now should have started.
    pub fn retry_after(&self) -> Duration {
        self.expected_wait.max(MIN_RETRY)
    }
}

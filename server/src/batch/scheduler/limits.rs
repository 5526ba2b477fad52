//! The limits that a scheduler keeps.

use std::time::Duration;

use crate::batch::order::Class;
use troupe_engine::BatchSizes;

/// Shortest time after which it is worth to try again.
const MIN_RETRY: Duration = Duration::from_millis(10);

/// The limits that a scheduler keeps, and how it weighs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Lanes of the engine: so many batches may run at a time.
    pub lanes: usize,
    /// Most characters in one batch.
    pub max_batch: usize,
    /// Whether the engine pads batches to one of its [sizes](troupe_engine::BatchSizes); else it takes any as it is.
    pub padded: bool,
    /// Most characters of one call of the engine, where it cuts batches into calls; else 0.
    pub call_rows: usize,
    /// Most characters of InBetween calls that may wait.
    pub max_queued: usize,
    /// Most characters of live plans that may wait. A session has one at most, so with a place for each session none is
    /// ever refused, however many calls wait.
    pub max_live: usize,
    /// An InBetween call that would wait for longer than this is refused; zero for no such limit.
    pub max_wait: Duration,
    /// The same in an overload, in which a long queue serves no more and every admitted call later; see
    /// [`Limits::longest_wait`]. A batch for each lane may always wait. Zero: no difference is made. (The controlled delay of
    /// Nichols and Jacobson 2012, as request queues have it.)
    pub max_standing_wait: Duration,
    /// What InBetween calls wait for before they go in front of live plans.
    pub ageing: Duration,
    /// Longest time that a free lane waits for [`Limits::preferred_batch`] characters; zero to wait for nobody.
    pub batch_delay: Duration,
    /// How many characters are worth to wait for.
    pub preferred_batch: usize,
    /// Longest time of a batch while there are live characters, by measure; zero for no such limit.
    pub live_slice: Duration,
    /// How long the first free lane stays awake for more work after its last; zero to sleep at once.
    pub lane_spin: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            lanes: 1,
            max_batch: 64,
            padded: true,
            call_rows: 0,
            max_queued: 1024,
            max_live: 16_384,
            max_wait: Duration::from_secs(1),
            max_standing_wait: Duration::ZERO,
            ageing: Duration::from_secs(2),
            batch_delay: Duration::ZERO,
            preferred_batch: 0,
            // Two frames at 30 Hz: half of the usual look-ahead of a plan is left for its own batch.
            live_slice: Duration::from_millis(66),
            lane_spin: Duration::ZERO,
        }
    }
}

impl Limits {
    /// The sizes of batches that cost the engine nothing besides.
    pub(super) fn sizes(&self) -> BatchSizes {
        match self.call_rows {
            0 => BatchSizes::new(self.max_batch, !self.padded),
            rows => BatchSizes::of_calls(self.max_batch, rows),
        }
    }

    /// What is added to a deadline of the class, to order it among those of the other.
    pub fn handicap(&self, class: Class) -> Duration {
        match class {
            Class::Live => Duration::ZERO,
            Class::Request => self.ageing,
        }
    }

    /// The longest that a call may wait, where more calls came than were served, by what takes `beyond`, while some always
    /// waited; zero for no limit.
    ///
    /// It falls from [`Limits::max_wait`] to [`Limits::max_standing_wait`], which it is once a third of a `max_wait` came beyond: what
    /// comes at five times the rate that can be served would fill the whole queue else, and all of that would be late.
    pub fn longest_wait(&self, beyond: Duration) -> Duration {
        let most = self.max_standing_wait.min(self.max_wait);
        if most.is_zero() {
            return self.max_wait;
        }
        let share = (3 * beyond).div_duration_f64(self.max_wait).min(1.0);
        self.max_wait - (self.max_wait - most).mul_f64(share)
    }

    /// Whether so much beyond what was served makes [`Limits::longest_wait`] as short as it gets, by far.
    pub(super) fn is_plain_overload(&self, beyond: Duration) -> bool {
        beyond >= self.max_wait
    }

    /// Most characters of the class that may wait.
    pub fn room(&self, class: Class) -> usize {
        match class {
            Class::Live => self.max_live,
            Class::Request => self.max_queued,
        }
    }
}

/// Why a request has no place in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refusal {
    /// Characters that wait, of all classes.
    pub pending_characters: usize,
    /// How long a request of the class would wait.
    pub expected_wait: Duration,
    /// Whether there is no room; else the wait is too long.
    pub full: bool,
}

impl Refusal {
    /// When what waits now should have been cut.
    pub fn retry_after(&self) -> Duration {
        self.expected_wait.max(MIN_RETRY)
    }
}

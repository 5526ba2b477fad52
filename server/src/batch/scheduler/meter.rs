//! How fast the lanes are, and how fast calls leave the queue: the base of every expectation.

use std::time::{Duration, Instant};

/// Time of a character on a lane before any was measured. It counts as one character of the measurements to come.
const FIRST_GUESS_S: f64 = 0.005;
/// What is left of older measurements of the lanes after each batch.
const LANE_MEMORY: f64 = 0.9;
/// Batches of fewer characters tell little of whether lengths differ.
const LEAST_MEASURED: usize = 4;
/// Lengths differ where fewer characters of a batch than this share have one.
const ALIKE_SHARE: f64 = 0.75;
/// Time, in seconds, after which older measurements of the queue have lost two thirds of their weight.
const QUEUE_MEMORY_S: f64 = 0.5;
/// Time, in seconds, that calls are taken to have left at the lanes' full speed when they begin to pile up.
const QUEUE_PRIOR_S: f64 = 0.1;

/// Two measures.
///
/// - **Lanes**: lane time a character, over the latest batches. It tells how large a batch may be to end in time.
/// - **Queue**: InBetween characters that were cut a second, over the latest time during which some were left waiting.
///   It takes in what live plans took away from them, and tells how long a call would wait (Little's law).
#[derive(Debug)]
pub(super) struct Meter {
    /// The batch of each lane.
    running: Vec<Option<Running>>,
    lanes: usize,
    lane_time_s: f64,
    lane_characters: f64,
    /// The share of characters, in the latest batches, whose segments had the length that most of their batch had.
    alike_share: f64,
    queue_time_s: f64,
    queue_characters: f64,
    /// Since when calls are left waiting, without a look at how many left.
    backlog_since: Option<Instant>,
}

/// A batch that is with a lane.
#[derive(Debug, Clone, Copy)]
struct Running {
    /// When it was cut.
    since: Instant,
    characters: usize,
    /// Those of them that have no answer yet, and whose they are.
    unanswered: usize,
    callers: usize,
}

/// A batch that is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Done {
    /// How long it took.
    pub(super) took: Duration,
    /// That were answered at its end.
    pub(super) characters: usize,
    /// Whose work it was: requests, or plans of one character each.
    pub(super) callers: usize,
}

impl Meter {
    pub(super) fn new(lanes: usize) -> Self {
        Self {
            running: vec![None; lanes],
            lanes,
            lane_time_s: FIRST_GUESS_S,
            lane_characters: 1.0,
            alike_share: 1.0,
            queue_time_s: 0.0,
            queue_characters: 0.0,
            backlog_since: None,
        }
    }

    /// A lane has a batch, of so many characters of so many callers.
    pub(super) fn began(&mut self, lane: usize, since: Instant, characters: usize, callers: usize) {
        self.running[lane] = Some(Running {
            since,
            characters,
            unanswered: characters,
            callers,
        });
    }

    /// So many characters of so many callers have their answers though the lane's batch still runs.
    pub(super) fn answered(&mut self, lane: usize, characters: usize, callers: usize) {
        if let Some(Some(running)) = self.running.get_mut(lane) {
            running.unanswered = running.unanswered.saturating_sub(characters);
            running.callers = running.callers.saturating_sub(callers);
        }
    }

    /// A lane has none any more. Answers what it had.
    pub(super) fn done(&mut self, lane: usize, now: Instant) -> Option<Done> {
        let Running {
            since,
            characters,
            unanswered,
            callers,
        } = self.running[lane].take()?;
        let took = now.saturating_duration_since(since);
        self.ran(characters, took);
        Some(Done {
            took,
            characters: unanswered,
            callers,
        })
    }

    /// A lane has taken so long for a batch of so many characters.
    pub(super) fn ran(&mut self, characters: usize, took: Duration) {
        self.lane_time_s = self.lane_time_s * LANE_MEMORY + took.as_secs_f64();
        self.lane_characters = self.lane_characters * LANE_MEMORY + characters as f64;
    }

    /// In a batch of so many characters, the segments of so many had one length: none where it failed before that was known.
    pub(super) fn measured(&mut self, characters: usize, alike: usize) {
        if characters >= LEAST_MEASURED && alike > 0 {
            let share = alike as f64 / characters as f64;
            self.alike_share = share + (self.alike_share - share) * LANE_MEMORY;
        }
    }

    /// Whether the segments of a batch are likely to be of several lengths.
    pub(super) fn lengths_differ(&self) -> bool {
        self.alike_share < ALIKE_SHARE
    }

    /// Characters that are with lanes now, and have no answer yet.
    pub(super) fn running(&self) -> usize {
        self.running
            .iter()
            .flatten()
            .map(|running| running.unanswered)
            .sum()
    }

    /// There is a lane less.
    pub(super) fn lost(&mut self) {
        self.lanes = self.lanes.saturating_sub(1);
    }

    /// So many characters of calls have left the queue since the last time this was told, and some, or none, are left.
    pub(super) fn left(&mut self, now: Instant, characters: usize, some_wait: bool) {
        match self.backlog_since {
            Some(since) => {
                let passed = now.saturating_duration_since(since).as_secs_f64();
                let memory = (-passed / QUEUE_MEMORY_S).exp();
                self.queue_time_s = self.queue_time_s * memory + passed;
                self.queue_characters = self.queue_characters * memory + characters as f64;
            }
            None => {
                self.queue_time_s = QUEUE_PRIOR_S;
                self.queue_characters = QUEUE_PRIOR_S * self.lanes.max(1) as f64 / self.character_s();
            }
        }
        self.backlog_since = some_wait.then_some(now);
    }

    /// How long it should take until so many characters of calls have left.
    pub(super) fn wait(&self, characters: usize) -> Duration {
        if characters == 0 {
            return Duration::ZERO;
        }
        let character_s = match self.queue_characters > 0.0 {
            true => self.queue_time_s / self.queue_characters,
            false => self.character_s() / self.lanes.max(1) as f64,
        };
        // Where next to none leave, the wait is as good as endless; an hour is long enough a hint.
        Duration::from_secs_f64((characters as f64 * character_s).min(3600.0))
    }

    /// Characters that a lane should do in `time`.
    pub(super) fn batch_within(&self, time: Duration) -> usize {
        (time.as_secs_f64() / self.character_s()) as usize
    }

    fn character_s(&self) -> f64 {
        (self.lane_time_s / self.lane_characters).max(1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_measured_by_their_batches() {
        let start = Instant::now();
        let mut meter = Meter::new(2);
        assert_eq!(meter.batch_within(Duration::from_millis(51)), 10);
        for batch in 0..100 {
            let at = start + Duration::from_millis(20) * batch;
            meter.began(1, at, 10, 1);
            meter.done(1, at + Duration::from_millis(20));
        }
        assert!((24..=25).contains(&meter.batch_within(Duration::from_millis(50))));
    }

    #[test]
    fn lengths_differ_where_they_did_in_the_latest_batches() {
        let mut meter = Meter::new(1);
        for _ in 0..100 {
            // Few characters tell nothing, nor does what failed, and a few of many change nothing.
            meter.measured(3, 1);
            meter.measured(8, 0);
            meter.measured(8, 7);
            meter.measured(32, 28);
            assert!(!meter.lengths_differ());
        }
        for _ in 0..10 {
            meter.measured(8, 4);
        }
        assert!(meter.lengths_differ());
        for _ in 0..10 {
            meter.measured(32, 29);
        }
        assert!(!meter.lengths_differ());
    }

    #[test]
    fn a_wait_follows_the_rate_at_which_calls_leave() {
        let start = Instant::now();
        let mut meter = Meter::new(2);
        assert_eq!(meter.wait(0), Duration::ZERO);
        // Nothing known: two lanes at 5 ms a character.
        meter.left(start, 0, true);
        assert_eq!(meter.wait(100).as_millis(), 250);
        // Live plans take most of the lanes: 4 characters of calls in 100 ms.
        for cut in 1..=50 {
            meter.left(start + Duration::from_millis(100) * cut, 4, true);
        }
        assert!((2400..2600).contains(&meter.wait(100).as_millis()));
        // None leave any more.
        meter.left(start + Duration::from_secs(60), 0, true);
        assert_eq!(meter.wait(1000), Duration::from_secs(3600));
        // All are gone, and it starts anew.
        meter.left(start + Duration::from_secs(61), 100, false);
        meter.left(start + Duration::from_secs(90), 0, true);
        assert_eq!(meter.wait(100).as_millis(), 250);
    }
}

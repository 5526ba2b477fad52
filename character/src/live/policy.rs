//! When a character asks for plans: what its style and its crowd's budget decide about that.

use super::budget::{LEFT_FRAMES, Pace};
use super::buffer::CROSSFADE_FRAMES;

/// Frames that must be left at the splice frame of a plan. With fewer and no plan, the character
/// slows down.
pub(super) const MARGIN_FRAMES: i64 = CROSSFADE_FRAMES as i64;
/// A buffer counts as low up to this many frames early, so that standing characters do not all ask
/// at once.
const SPREAD_FRAMES: u32 = 8;
/// A plan for the interval alone may be this many frames late, as far as its buffer lasts, before
/// it goes ahead of a plan that another character needs.
pub(super) const INTERVAL_GRACE: i64 = 4;

/// When to ask for plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Policy {
    /// Frames between the splice frames of plans. `None`: plans for commands and a low buffer only.
    pub(super) interval_frames: Option<u32>,
    /// The budget's intervals and lengths; none if plans are as usual.
    pub(super) pace: Option<Pace>,
    /// The last plan leaves off in the middle of a turn: the next comes at the usual interval.
    pub(super) unfinished: bool,
}

impl Policy {
    /// Frames between the splice frames of plans, stretched by the budget.
    pub(super) fn interval(&self) -> Option<u32> {
        let pace = self.pace.filter(|_| !self.unfinished);
        let paced = |interval: u32| pace.map_or(interval, |pace| pace.interval_frames.max(interval));
        self.interval_frames.map(paced)
    }

    /// Frames that must be left at the splice frame of a plan, without the spread between
    /// characters.
    pub(super) fn margin(&self) -> i64 {
        match self.pace {
            Some(_) => i64::from(LEFT_FRAMES),
            None => MARGIN_FRAMES,
        }
    }

    /// Most frames that a buffer may count as low early. Under the budget, plans last as long as
    /// the interval, and the interval has already spread the characters.
    pub(super) fn early(&self) -> u32 {
        match (self.pace, self.interval_frames) {
            (Some(_), Some(_)) => 1,
            _ => SPREAD_FRAMES,
        }
    }
}

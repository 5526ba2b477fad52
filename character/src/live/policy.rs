//! When a character asks for plans, as far as that is settled: by its style, and by its crowd's
//! budget.

use super::budget::{LEFT_FRAMES, Pace};
use super::buffer::CROSSFADE_FRAMES;

/// Frames that must remain at the splice frame of a plan. With fewer and no plan, the character
/// slows down.
pub(super) const MARGIN_FRAMES: i64 = CROSSFADE_FRAMES as i64;
/// A buffer counts as low up to so many frames early, so that characters who stand about do not ask
/// all at once.
const SPREAD_FRAMES: u32 = 8;
/// Frames by which a plan for the interval alone may come late before one that somebody else needs
/// goes first, as far as its buffer lasts.
pub(super) const INTERVAL_GRACE: i64 = 4;

/// When to ask for plans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Policy {
    /// Frames between the splice frames of plans. `None`: plans for commands and a low buffer only.
    pub(super) interval_frames: Option<u32>,
    /// What the budget makes of it, where not as usual.
    pub(super) pace: Option<Pace>,
    /// The last plan leaves off in the middle of something: the next comes as soon as usual.
    pub(super) unfinished: bool,
}

impl Policy {
    /// Frames between the splice frames of plans.
    pub(super) fn interval(&self) -> Option<u32> {
        let pace = self.pace.filter(|_| !self.unfinished);
        let paced = |interval: u32| pace.map_or(interval, |pace| pace.interval_frames.max(interval));
        self.interval_frames.map(paced)
    }

    /// Frames that must remain at the splice frame of a plan, those by which characters differ not
    /// counted.
    pub(super) fn margin(&self) -> i64 {
        match self.pace {
            Some(_) => i64::from(LEFT_FRAMES),
            None => MARGIN_FRAMES,
        }
    }

    /// How many frames early a buffer may count as low. With a pace, plans last as long as the
    /// interval and the interval has spread the characters already.
    pub(super) fn early(&self) -> u32 {
        match (self.pace, self.interval_frames) {
            (Some(_), Some(_)) => 1,
            _ => SPREAD_FRAMES,
        }
    }
}

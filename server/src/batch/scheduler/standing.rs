//! How much more came than was served: what tells an overload from a burst and from many callers.

use std::time::Instant;

/// Time, in seconds, that the queue must be empty until two thirds of what was refused before are forgotten.
const MEMORY_S: f64 = 1.0;

/// A queue of calls that has not been empty after a cut for some time, or has been an overload's lately.
///
/// Its length alone tells little. Callers who each wait for their answer make a long one that neither grows nor would be
/// served sooner if some of them were refused; so does a burst. An overload is what keeps coming, be it let in or not. Lanes may well
/// empty the short queue that it is left; that it does come is remembered, or it would fill a long one anew each time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Standing {
    /// Fewest characters that were left waiting since it was empty.
    fewest: usize,
    /// Characters that were refused; less of them the longer it is empty.
    refused: f64,
    /// Since when it is empty, as far as cuts have seen.
    empty_since: Option<Instant>,
}

impl Standing {
    /// The queue after a cut that left so many characters waiting; `before` is that of the cut before.
    pub(super) fn after_cut(before: Option<Self>, now: Instant, waiting: usize) -> Option<Self> {
        let refused = before.map_or(0.0, |before| before.remembered(now));
        let fewest = before.filter(|before| before.empty_since.is_none());
        let standing = Self {
            fewest: fewest.map_or(waiting, |before| before.fewest.min(waiting)),
            refused,
            empty_since: (waiting == 0).then_some(now),
        };
        (waiting > 0 || refused >= 1.0).then_some(standing)
    }

    /// So many characters found no place.
    pub(super) fn refused(&mut self, characters: usize) {
        self.refused += characters as f64;
    }

    /// Characters that came beyond those that were served, where so many wait now. What has come since none were left waiting
    /// is not among them before the next cut: it may be a burst.
    pub(super) fn beyond(&self, now: Instant, waiting: usize) -> usize {
        let more = match self.empty_since {
            Some(_) => 0,
            None => waiting.saturating_sub(self.fewest),
        };
        more + self.remembered(now) as usize
    }

    /// Characters that were refused, less by two thirds for each second that none are left waiting.
    fn remembered(&self, now: Instant) -> f64 {
        let empty = self.empty_since.map(|since| now.saturating_duration_since(since));
        self.refused * (-empty.unwrap_or_default().as_secs_f64() / MEMORY_S).exp()
    }
}

//! How much more came than was served: what tells an overload from a burst and from many callers.

/// A queue of calls that has not been empty after a cut for some time.
///
/// Its length alone tells little. Callers who each wait for their answer make a long one that neither grows nor would be
/// served sooner if some of them were refused; so does a burst. An overload is what keeps coming, be it let in or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Standing {
    /// Fewest characters that were left waiting.
    fewest: usize,
    /// Characters that were refused.
    refused: usize,
}

impl Standing {
    /// The queue after a cut that left so many characters waiting; `before` is that of the cut before.
    pub(super) fn after_cut(before: Option<Self>, waiting: usize) -> Option<Self> {
        let Self { fewest, refused } = before.unwrap_or(Self {
            fewest: waiting,
            refused: 0,
        });
        (waiting > 0).then_some(Self {
            fewest: fewest.min(waiting),
            refused,
        })
    }

    /// So many characters found no place.
    pub(super) fn refused(&mut self, characters: usize) {
        self.refused = self.refused.saturating_add(characters);
    }

    /// Characters that came beyond those that were served, where so many wait now.
    pub(super) fn beyond(&self, waiting: usize) -> usize {
        waiting.saturating_sub(self.fewest).saturating_add(self.refused)
    }
}

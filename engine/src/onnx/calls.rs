//! Splits a batch into calls, for an engine with a network for each size of a call.

use crate::tensors::ROOM_MULTIPLE;

/// Sizes of the calls that networks are made for, in rows. A call costs one or two rows on top of
/// its own. Beyond 8 rows, a row becomes no cheaper. There are few sizes, because a network takes a
/// fifth of a second and 17 MB, and the pose stage and the decoder need one for each length.
pub(super) const CALL_ROWS: [usize; 3] = [1, 4, 8];
// A call reads whole rows, padding included.
const _: () = assert!(CALL_ROWS[CALL_ROWS.len() - 1] <= ROOM_MULTIPLE);

/// The sizes of calls that a stage may use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Calls {
    /// Increasing, from 1.
    sizes: Vec<usize>,
}

impl Default for Calls {
    fn default() -> Self {
        Self::of(CALL_ROWS)
    }
}

impl Calls {
    /// Calls of these sizes, which increase.
    pub(super) fn of(sizes: impl IntoIterator<Item = usize>) -> Self {
        Self {
            sizes: sizes.into_iter().collect(),
        }
    }

    /// Size of the next call if only these sizes are open, for inputs with memory for `room` rows.
    /// Most of it may be padding. None if no size fits.
    pub(super) fn fallback(&self, rows: usize, room: usize) -> Option<usize> {
        let next = Some(self.next(rows, room)).filter(|size| self.sizes.contains(size));
        let filled = || self.sizes.iter().rev().copied().find(|&size| size <= rows);
        let all = || {
            self.sizes
                .iter()
                .copied()
                .find(|&size| size >= rows && size <= room)
        };
        next.or_else(filled).or_else(all)
    }

    /// Size of the next call for `rows` remaining rows, and inputs with memory for `room`. It holds
    /// them all if at most a quarter of it is padding. Otherwise it is the largest size that they
    /// fill.
    pub(super) fn next(&self, rows: usize, room: usize) -> usize {
        let fits = |size: &usize| (rows..=room).contains(size);
        let all = self.sizes.iter().copied().find(fits);
        let filled = self.sizes.iter().rev().copied().find(|&size| size <= rows);
        match (all, filled) {
            (Some(all), _) if (all - rows) * 4 <= all => all,
            (_, Some(filled)) => filled,
            (all, None) => all.unwrap_or(1),
        }
    }

    /// Allows no more calls of this many rows or more. Calls of one row stay allowed.
    pub(super) fn forbid(&mut self, rows: usize) {
        self.sizes.retain(|&size| size < rows.max(2));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calls_of(calls: &Calls, rows: usize) -> Vec<usize> {
        let mut left = rows;
        std::iter::from_fn(|| {
            (left > 0).then(|| {
                let size = calls.next(left, left.next_multiple_of(ROOM_MULTIPLE));
                left = left.saturating_sub(size);
                size
            })
        })
        .collect()
    }

    #[test]
    fn a_batch_is_cut_into_few_calls_with_little_padding() {
        let calls = Calls::default();
        let cut = [1, 2, 3, 5, 7, 9, 12, 13, 16, 27, 64].map(|rows| calls_of(&calls, rows));
        assert_eq!(
            cut.each_ref().map(Vec::as_slice),
            [
                &[1][..],
                &[1, 1],
                &[4],
                &[4, 1],
                &[8],
                &[8, 1],
                &[8, 4],
                &[8, 4, 1],
                &[8, 8],
                &[8, 8, 8, 4],
                &[8, 8, 8, 8, 8, 8, 8, 8]
            ]
        );
    }

    #[test]
    fn an_open_size_replaces_the_best_one() {
        let next = |open: &[usize], rows, room| Calls::of(open.iter().copied()).fallback(rows, room);
        assert_eq!(next(&[1], 8, 8), Some(1));
        assert_eq!(next(&[1, 4], 8, 8), Some(4));
        assert_eq!(next(&[1, 8], 2, 8), Some(1));
        // Mostly padding, if there is memory for it.
        assert_eq!(next(&[8], 2, 8), Some(8));
        assert_eq!(next(&[8], 2, 4), None);
        assert_eq!(next(&[4, 8], 1, 4), Some(4));
        assert_eq!(next(&[4, 8], 7, 7), Some(4));
        assert_eq!(next(&[], 1, 8), None);
        // After a call of one row that replaced a larger one.
        assert_eq!(next(&[1, 4, 8], 7, 7), Some(4));
    }

    #[test]
    fn calls_cover_every_row_and_at_most_a_quarter_of_the_last_is_padding() {
        for forbidden in [16, 8, 4, 2, 1] {
            let mut calls = Calls::default();
            calls.forbid(forbidden);
            for rows in 1..=100 {
                let cut = calls_of(&calls, rows);
                let called: usize = cut.iter().sum();
                assert!(
                    called >= rows && (called - rows) * 4 <= cut[cut.len() - 1],
                    "{rows}: {cut:?}"
                );
                assert!(cut.iter().all(|&size| size < forbidden.max(2)), "{rows}: {cut:?}");
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn calls_stay_within_the_memory(
            rows in 1..100_usize,
            open in proptest::collection::vec(proptest::sample::subsequence(CALL_ROWS.to_vec(), 1..=3), 100),
        ) {
            let room = rows.next_multiple_of(ROOM_MULTIPLE);
            let mut done = 0;
            for open in open {
                if done < rows {
                    let best = Calls::default().next(rows - done, room - done);
                    let other = Calls::of(open.iter().copied()).fallback(rows - done, room - done);
                    done += if open.contains(&best) { best } else { other.unwrap_or(0) };
                    proptest::prop_assert!(done <= room);
                }
            }
        }
    }
}

//! How a batch is cut into calls, for an engine that has a network for each size of a call.

use crate::tensors::ROOM_MULTIPLE;

/// Rows of the calls that networks are made for. A call costs what one or two rows do beside its
/// own rows; beyond 8 rows a row costs no less. They are few, for a network takes a fifth of a
/// second to make and 17 MB, and those of the pose stage and the decoder are made for each length.
pub(super) const CALL_ROWS: [usize; 3] = [1, 4, 8];
// A call reads whole rows, padding among them.
const _: () = assert!(CALL_ROWS[CALL_ROWS.len() - 1] <= ROOM_MULTIPLE);

/// The sizes of calls that a stage may be asked in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Calls {
    /// In rising order, from 1.
    sizes: Vec<usize>,
}

impl Default for Calls {
    fn default() -> Self {
        Self::of(CALL_ROWS)
    }
}

impl Calls {
    /// Calls of these sizes, which rise.
    pub(super) fn of(sizes: impl IntoIterator<Item = usize>) -> Self {
        Self {
            sizes: sizes.into_iter().collect(),
        }
    }

    /// The size of the next call where only these are open, with inputs for `room` rows. It may be
    /// padding for the most part. None where there is no such size.
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

    /// The size of the next call where `rows` rows are left, with inputs for `room`: one that holds
    /// them all if no more than a quarter of it is padding, else the largest that they fill.
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

    /// No more calls of so many rows, nor of more. Calls of one row stay.
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
    fn what_is_open_serves_where_the_best_size_is_not() {
        let next = |open: &[usize], rows, room| Calls::of(open.iter().copied()).fallback(rows, room);
        assert_eq!(next(&[1], 8, 8), Some(1));
        assert_eq!(next(&[1, 4], 8, 8), Some(4));
        assert_eq!(next(&[1, 8], 2, 8), Some(1));
        // Padding for the most part, where there is room for it.
        assert_eq!(next(&[8], 2, 8), Some(8));
        assert_eq!(next(&[8], 2, 4), None);
        assert_eq!(next(&[4, 8], 1, 4), Some(4));
        assert_eq!(next(&[4, 8], 7, 7), Some(4));
        assert_eq!(next(&[], 1, 8), None);
        // After a call of one row that served in the place of a larger one.
        assert_eq!(next(&[1, 4, 8], 7, 7), Some(4));
    }

    #[test]
    fn every_row_is_called_for_and_at_most_a_quarter_of_the_last_call_is_padding() {
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
        fn calls_stay_within_the_room_whatever_is_open(
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

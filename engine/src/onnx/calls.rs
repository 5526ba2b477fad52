//! How a batch is cut into calls, for an engine that has a network for each size of a call.

use crate::tensors::ROOM_MULTIPLE;

/// Rows of the calls that networks are made for. A call costs what one or two rows do beside its own rows; beyond 8 rows a row
/// costs no less. They are few, for a network takes a third of a second to make and 35 MB, and those of the pose stage and the
/// decoder are made for each length.
pub(super) const CALL_ROWS: [usize; 3] = [1, 4, 8];
// A call reads whole rows, padding among them.
const _: () = assert!(CALL_ROWS[CALL_ROWS.len() - 1] <= ROOM_MULTIPLE);

/// The sizes of calls that a stage may be asked in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Calls {
    /// In rising order, from 1.
    sizes: Vec<usize>,
}

impl Calls {
    pub(super) fn new() -> Self {
        Self {
            sizes: CALL_ROWS.to_vec(),
        }
    }

    /// The size of the next call where `rows` rows are left: one that holds them all if no more than a quarter of it is
    /// padding, else the largest that they fill.
    pub(super) fn next(&self, rows: usize) -> usize {
        let all = self.sizes.iter().copied().find(|&size| size >= rows);
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
                let size = calls.next(left);
                left = left.saturating_sub(size);
                size
            })
        })
        .collect()
    }

    #[test]
    fn a_batch_is_cut_into_few_calls_with_little_padding() {
        let calls = Calls::new();
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

    /// What warm-up runs, the smallest batch, the largest and those of [`CALL_ROWS`] between, makes all calls that a batch
    /// may be cut into.
    #[test]
    fn no_batch_makes_a_call_that_warm_up_did_not() {
        for forbidden in [16, 8, 4, 2] {
            let mut calls = Calls::new();
            calls.forbid(forbidden);
            for most in 1..=40 {
                let warm = CALL_ROWS.into_iter().filter(|&rows| rows < most).chain([most]);
                let met: Vec<usize> = warm.flat_map(|rows| calls_of(&calls, rows)).collect();
                for rows in 1..=most {
                    let cut = calls_of(&calls, rows);
                    assert!(
                        cut.iter().all(|size| met.contains(size)),
                        "{rows} of {most}: {cut:?}, {met:?}"
                    );
                    let called: usize = cut.iter().sum();
                    assert!(
                        called <= most.next_multiple_of(ROOM_MULTIPLE),
                        "{rows} of {most}: {cut:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn every_row_is_called_for_and_at_most_a_quarter_of_the_last_call_is_padding() {
        for forbidden in [16, 8, 4, 2, 1] {
            let mut calls = Calls::new();
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
}

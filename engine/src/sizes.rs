//! The batch sizes that an engine gets.

use std::iter::successors;

/// The batch sizes that an engine gets. An engine that takes any batch gets every size. For others
/// the list is short, and each batch is padded up to one of the sizes, so that the engine sees few
/// shapes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BatchSizes {
    /// In rising order, the largest batch last; never empty.
    sizes: Vec<usize>,
}

impl BatchSizes {
    /// Sizes of batches of up to `max_batch` rows, at least one, for an engine that takes `any`
    /// batch or for one that needs padding. With padding the sizes are powers of two, from 4 on
    /// also the numbers half-way between them, and `max_batch` itself: less than a third of a batch
    /// is padding.
    pub fn new(max_batch: usize, any: bool) -> Self {
        let largest = max_batch.max(1);
        let sizes = match any {
            true => (1..=largest).collect(),
            false => successors(Some(1_usize), |size| size.checked_mul(2))
                .flat_map(|power| [Some(power), (power > 2).then_some(power + power / 2)])
                .flatten()
                .take_while(|&size| size < largest)
                .chain([largest])
                .collect(),
        };
        Self { sizes }
    }

    /// Sizes of batches of up to `max_batch` rows for an engine that splits them into calls of up
    /// to `rows`, at least one: every size up to half a call, then multiples of whole calls, and
    /// `max_batch` itself.
    pub fn of_calls(max_batch: usize, rows: usize) -> Self {
        let (largest, rows) = (max_batch.max(1), rows.max(1));
        let sizes = (1..=rows / 2)
            .chain((rows..largest).step_by(rows))
            .filter(|&size| size < largest)
            .chain([largest]);
        Self {
            sizes: sizes.collect(),
        }
    }

    /// All sizes, in rising order.
    pub fn all(&self) -> &[usize] {
        &self.sizes
    }

    /// The size of the largest batch.
    pub fn largest(&self) -> usize {
        self.sizes.last().copied().unwrap_or(1)
    }

    /// The smallest size that holds `rows`: padding fills the rest. A number above the largest
    /// batch is returned unchanged.
    pub fn for_rows(&self, rows: usize) -> usize {
        let size = self.sizes.iter().find(|&&size| size >= rows);
        size.copied().unwrap_or(rows)
    }

    /// The largest size that `rows` fill without padding; 0 for no rows.
    pub fn within(&self, rows: usize) -> usize {
        let size = self.sizes.iter().rev().find(|&&size| size <= rows);
        size.copied().unwrap_or(rows)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn sizes_are_at_most_a_third_padding() {
        assert_eq!(
            BatchSizes::new(64, false).all(),
            [1, 2, 4, 6, 8, 12, 16, 24, 32, 48, 64]
        );
        assert_eq!(BatchSizes::new(10, false).all(), [1, 2, 4, 6, 8, 10]);
        assert_eq!(BatchSizes::new(3, false).all(), [1, 2, 3]);
        assert_eq!(BatchSizes::new(1, false).all(), [1]);
    }

    #[test]
    fn beyond_half_a_call_sizes_are_whole_calls() {
        assert_eq!(BatchSizes::of_calls(32, 8).all(), [1, 2, 3, 4, 8, 16, 24, 32]);
        assert_eq!(BatchSizes::of_calls(20, 8).all()[4..], [8, 16, 20]);
        assert_eq!(BatchSizes::of_calls(8, 8).all(), [1, 2, 3, 4, 8]);
        assert_eq!(BatchSizes::of_calls(6, 8).all(), [1, 2, 3, 4, 6]);
        assert_eq!(BatchSizes::of_calls(3, 8).all(), [1, 2, 3]);
        assert_eq!(BatchSizes::of_calls(9, 8).all()[4..], [8, 9]);
        assert_eq!(BatchSizes::of_calls(2, 1).all(), [1, 2]);
    }

    #[test]
    fn an_engine_that_pads_gets_the_sizes_around_a_batch() {
        let sizes = BatchSizes::new(32, false);
        assert_eq!([1, 5, 9, 32].map(|rows| sizes.for_rows(rows)), [1, 6, 12, 32]);
        assert_eq!([1, 5, 9, 32].map(|rows| sizes.within(rows)), [1, 4, 8, 32]);
    }

    #[test]
    fn an_engine_that_takes_any_batch_has_every_size() {
        let sizes = BatchSizes::new(5, true);
        assert_eq!(sizes.all(), [1, 2, 3, 4, 5]);
        for rows in 1..=5 {
            assert_eq!((sizes.for_rows(rows), sizes.within(rows)), (rows, rows));
        }
    }

    #[test]
    fn there_is_a_size_even_if_the_largest_batch_is_0() {
        for any in [true, false] {
            let sizes = BatchSizes::new(0, any);
            assert_eq!((sizes.all(), sizes.within(0)), (&[1][..], 0));
        }
    }

    #[test]
    fn more_rows_than_the_largest_batch_get_no_padding_and_fill_it() {
        let sizes = BatchSizes::new(10, false);
        assert_eq!((sizes.for_rows(11), sizes.within(11)), (11, 10));
    }

    proptest! {
        #[test]
        fn a_batch_lies_between_the_two_nearest_sizes(max_batch in 1_usize..=300, share in 0.0..1.0, any: bool) {
            let rows = 1 + (share * max_batch as f64) as usize;
            let sizes = BatchSizes::new(max_batch, any);
            let (padded, filled) = (sizes.for_rows(rows), sizes.within(rows));
            prop_assert!(filled <= rows && rows <= padded && padded <= max_batch);
            prop_assert!(sizes.all().contains(&padded) && sizes.all().contains(&filled));
            prop_assert!(sizes.all().iter().all(|&size| size <= filled || size >= padded));
            prop_assert!((padded - rows) * 3 < padded, "{rows} of {padded}");
        }

        #[test]
        fn sizes_rise_up_to_the_largest_batch(max_batch in 1_usize..=300, any: bool) {
            let sizes = BatchSizes::new(max_batch, any);
            prop_assert!(sizes.all().is_sorted_by(|a, b| a < b));
            prop_assert_eq!(sizes.all().last(), Some(&max_batch));
        }
    }
}

//! Orders that wait for the next step of a session.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::order::Move;

/// The orders that a session has not got yet: at most a style and one motion. A newer order
/// replaces a waiting one of its kind, so a stop leaves nothing of the motions before it.
#[derive(Debug, Default)]
pub(crate) struct Waiting(Mutex<Vec<Move>>);

impl Waiting {
    /// Adds an order, behind those of the other kind.
    pub(crate) fn give(&self, order: Move) {
        let is_style = |order: &Move| matches!(order, Move::Style(_));
        let mut orders = self.lock();
        orders.retain(|waiting| is_style(waiting) != is_style(&order));
        orders.push(order);
    }

    /// Takes all orders, the oldest first.
    pub(crate) fn take(&self) -> Vec<Move> {
        std::mem::take(&mut *self.lock())
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Move>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    fn walk(x: f32) -> Move {
        Move::Walk(Vec3::new(x, 0.0, 0.0), None)
    }

    fn style(name: &str) -> Move {
        Move::Style(name.to_owned())
    }

    #[test]
    fn a_stop_leaves_nothing_of_the_motions_before_it() {
        let waiting = Waiting::default();
        for order in [walk(1.0), style("old"), walk(2.0), style("march"), Move::Stand] {
            waiting.give(order);
        }
        assert_eq!(waiting.take(), [style("march"), Move::Stand]);
        assert_eq!(waiting.take(), []);
    }

    proptest! {
        #[test]
        fn at_most_two_wait_and_the_newest_of_each_kind_is_there(
            orders in proptest::collection::vec((any::<bool>(), 0_u8..9), 0..200),
        ) {
            let waiting = Waiting::default();
            let order = |&(is_style, number): &(bool, u8)| match is_style {
                true => style(&number.to_string()),
                false => walk(f32::from(number)),
            };
            orders.iter().for_each(|one| waiting.give(order(one)));
            let newest = |wanted: bool| orders.iter().rev().find(|(is_style, _)| *is_style == wanted);
            let taken = waiting.take();
            prop_assert_eq!(taken.len(), [true, false].into_iter().filter_map(newest).count());
            prop_assert_eq!(taken.last().cloned(), orders.last().map(order));
            for one in [true, false].into_iter().filter_map(newest) {
                prop_assert!(taken.contains(&order(one)));
            }
        }
    }
}

//! Commands that wait.

use thiserror::Error;
use troupe_client::{Act, Locomotion};

/// Commands of one character that may wait.
const MOST: usize = 16;

/// A command, in Troupe's frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Move over the ground.
    Move(Locomotion),
    /// Do something once.
    Act(Act),
    /// Priority for plans, 0 to 1.
    Priority(f32),
}

/// Why a command is not taken.
#[derive(Debug, Error, PartialEq)]
pub enum OrderError {
    /// Commands come faster than they leave.
    #[error("{MOST} commands of the character wait already, which is the most")]
    Full,
    /// The character could not be opened, or left.
    #[error("the character is not on the server")]
    Gone,
}

/// The commands of a character, in order. A newer locomotion replaces one right before it, and a
/// newer priority as well.
#[derive(Debug, Default)]
pub struct Orders(Vec<Order>);

impl Orders {
    /// Adds a command.
    ///
    /// # Errors
    /// [`OrderError::Full`] if too many wait.
    pub fn push(&mut self, order: Order) -> Result<(), OrderError> {
        let replaces = matches!(
            (self.0.last(), &order),
            (Some(Order::Move(_)), Order::Move(_)) | (Some(Order::Priority(_)), Order::Priority(_))
        );
        if replaces {
            self.0.pop();
        }
        if self.0.len() >= MOST {
            return Err(OrderError::Full);
        }
        self.0.push(order);
        Ok(())
    }

    /// Gives all commands away.
    pub fn take(&mut self) -> Vec<Order> {
        std::mem::take(&mut self.0)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn the_newest_locomotion_wins_and_acts_keep_their_order() {
        let walk = |z| Order::Move(Locomotion::walk(Vec3::Z * z));
        let jump = || Order::Act(Act::skill("jump"));
        let mut orders = Orders::default();
        for order in [
            walk(1.0),
            walk(2.0),
            jump(),
            walk(3.0),
            Order::Priority(0.1),
            Order::Priority(0.2),
        ] {
            orders.push(order).unwrap();
        }
        assert_eq!(
            orders.take(),
            [walk(2.0), jump(), walk(3.0), Order::Priority(0.2)]
        );
        assert_eq!(orders.take(), []);
    }

    #[test]
    fn the_queue_has_an_end() {
        let mut orders = Orders::default();
        for _ in 0..MOST {
            orders.push(Order::Act(Act::Drop)).unwrap();
        }
        assert_eq!(orders.push(Order::Act(Act::Drop)), Err(OrderError::Full));
        assert_eq!(orders.take().len(), MOST);
        assert_eq!(orders.push(Order::Act(Act::Drop)), Ok(()));
    }
}

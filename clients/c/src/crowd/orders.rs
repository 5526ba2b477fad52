//! Commands that wait until the next step or tick.

use std::sync::{Mutex, MutexGuard, PoisonError};

use troupe_client::{Act, Crowd, Drive, Locomotion, MemberId};

use crate::status::Failure;

/// Commands of one character that may wait.
const MOST: usize = 16;

/// A command.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Order {
    Move(Locomotion),
    Act(Act),
    Priority(f32),
}

/// The commands of all characters, in order for each. A newer locomotion replaces one right before
/// it, and a newer priority as well.
#[derive(Debug)]
pub(crate) struct Orders(Mutex<Waiting>);

#[derive(Debug)]
struct Waiting {
    of: Vec<Vec<Order>>,
    /// Characters whose commands wait.
    characters: Vec<u32>,
}

impl Orders {
    /// Without commands.
    pub(crate) fn new(characters: usize) -> Self {
        Self(Mutex::new(Waiting {
            of: vec![Vec::new(); characters],
            characters: Vec::with_capacity(characters),
        }))
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a command of a character.
    pub(crate) fn push(&self, character: u32, order: Order) -> Result<(), Failure> {
        let mut waiting = self.lock();
        let count = waiting.of.len();
        let Some(of) = waiting.of.get_mut(character as usize) else {
            return Err(Failure::Range {
                field: "character",
                got: character.to_string(),
                allowed: format!("0 to {}", count.saturating_sub(1)),
            });
        };
        let was_empty = of.is_empty();
        let replaces = matches!(
            (of.last(), &order),
            (Some(Order::Move(_)), Order::Move(_)) | (Some(Order::Priority(_)), Order::Priority(_))
        );
        if replaces {
            of.pop();
        }
        if of.len() >= MOST {
            return Err(Failure::Full {
                character,
                waiting: MOST,
            });
        }
        of.push(order);
        if was_empty {
            waiting.characters.push(character);
        }
        Ok(())
    }

    /// Gives all commands away, in order for each character.
    pub(crate) fn give(&self, mut to: impl FnMut(u32, Order)) {
        let mut waiting = self.lock();
        let Waiting { of, characters } = &mut *waiting;
        for character in characters.drain(..) {
            for order in of[character as usize].drain(..) {
                to(character, order);
            }
        }
    }
}

/// Commands the character of a stream.
pub(crate) fn to_drive(drive: &mut Drive, session: &str, order: Order) {
    match order {
        Order::Move(wanted) => {
            if let Some(intent) = drive.intent_mut(session) {
                *intent = wanted;
            }
        }
        Order::Act(act) => drive.act(session, &act),
        Order::Priority(priority) => drive.set_priority(session, priority),
    }
}

/// Commands the character of a crowd that is stepped.
pub(crate) fn to_crowd(crowd: &mut Crowd, member: MemberId, order: Order) {
    match order {
        Order::Move(wanted) => {
            if let Some(intent) = crowd.intent_mut(member) {
                *intent = wanted;
            }
        }
        Order::Act(act) => crowd.act(member, &act),
        Order::Priority(priority) => crowd.set_priority(member, priority),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::status::TroupeStatus;

    fn given(orders: &Orders) -> Vec<(u32, Order)> {
        let mut all = Vec::new();
        orders.give(|character, order| all.push((character, order)));
        all
    }

    #[test]
    fn the_newest_locomotion_wins_and_acts_keep_their_order() {
        let orders = Orders::new(2);
        let walk = |z| Order::Move(Locomotion::walk(Vec3::Z * z));
        orders.push(1, walk(1.0)).unwrap();
        orders.push(1, walk(2.0)).unwrap();
        orders.push(1, Order::Act(Act::skill("jump"))).unwrap();
        orders.push(1, walk(3.0)).unwrap();
        orders.push(0, Order::Priority(0.25)).unwrap();
        orders.push(0, Order::Priority(0.5)).unwrap();
        let expected = [
            (1, walk(2.0)),
            (1, Order::Act(Act::skill("jump"))),
            (1, walk(3.0)),
            (0, Order::Priority(0.5)),
        ];
        assert_eq!(given(&orders), expected);
        assert_eq!(given(&orders), []);
    }

    #[test]
    fn the_queue_of_a_character_has_an_end() {
        let orders = Orders::new(2);
        for _ in 0..MOST {
            orders.push(0, Order::Act(Act::Drop)).unwrap();
        }
        let failure = orders.push(0, Order::Act(Act::Drop)).unwrap_err();
        assert_eq!(failure.status(), TroupeStatus::Full);
        orders.push(1, Order::Act(Act::Drop)).unwrap();
        let failure = orders.push(2, Order::Act(Act::Drop)).unwrap_err().to_string();
        assert_eq!(failure, "character is 2, but must be 0 to 1");
        assert_eq!(given(&orders).len(), MOST + 1);
    }
}

//! Orders for a robot that its session has not taken yet. The newest order replaces one that
//! waits.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::steering::Order;

/// One order and one style, shared by topics and the session's task.
#[derive(Debug, Default)]
pub(crate) struct Inbox {
    slots: Mutex<Slots>,
}

#[derive(Debug, Default)]
struct Slots {
    /// With the time at which it came.
    order: Option<(Order, Instant)>,
    style: Option<String>,
}

impl Inbox {
    pub(crate) fn order(&self, order: Order) {
        self.slots().order = Some((order, Instant::now()));
    }

    pub(crate) fn style(&self, style: String) {
        self.slots().style = Some(style);
    }

    /// Takes both.
    pub(crate) fn take(&self) -> (Option<(Order, Instant)>, Option<String>) {
        let mut slots = self.slots();
        (slots.order.take(), slots.style.take())
    }

    fn slots(&self) -> MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_order_and_style_wait() {
        let inbox = Inbox::default();
        inbox.order(Order::Say("wave".to_owned()));
        inbox.order(Order::Drive([1.0, 0.0, 0.0]));
        inbox.style("slow".to_owned());
        inbox.style("march".to_owned());
        let (order, style) = inbox.take();
        assert_eq!(order.unwrap().0, Order::Drive([1.0, 0.0, 0.0]));
        assert_eq!(style.as_deref(), Some("march"));
        assert_eq!(inbox.take(), (None, None));
    }
}

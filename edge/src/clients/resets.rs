//! Cancelled calls beside answered ones. A client that only cancels costs the server work for
//! nothing (CVE-2023-44487). The HTTP library limits calls that are cancelled before it hands them
//! out; these were handed out.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time in which calls are counted.
const WINDOW: Duration = Duration::from_secs(1);
/// Calls that one connection may cancel in a window, in addition to as many as were answered: all
/// that it may have open at a time, so that a client may cancel all its calls at once.
const MOST_OF_CONNECTION: u64 = 1024;
/// As [`MOST_OF_CONNECTION`], for all connections of an address. Four connections may cancel all
/// their calls within a second.
const MOST_OF_ADDRESS: u64 = 4 * MOST_OF_CONNECTION;

/// The calls of the current window.
#[derive(Debug)]
struct Window {
    begun: Instant,
    cancelled: u64,
    answered: u64,
}

/// Counts answered and cancelled calls.
#[derive(Debug)]
pub(crate) struct Resets {
    most: u64,
    window: Mutex<Window>,
}

impl Resets {
    pub(crate) fn of_connection() -> Self {
        Self::new(MOST_OF_CONNECTION)
    }

    pub(super) fn of_address() -> Self {
        Self::new(MOST_OF_ADDRESS)
    }

    fn new(most: u64) -> Self {
        let window = Window {
            begun: Instant::now(),
            cancelled: 0,
            answered: 0,
        };
        Self {
            most,
            window: Mutex::new(window),
        }
    }

    /// Counts a call that ended at `now`. Answers whether too many were cancelled.
    pub(crate) fn ended(&self, answered: bool, now: Instant) -> bool {
        let mut window = self.window.lock().unwrap_or_else(PoisonError::into_inner);
        if now.saturating_duration_since(window.begun) >= WINDOW {
            *window = Window {
                begun: now,
                cancelled: 0,
                answered: 0,
            };
        }
        match answered {
            true => window.answered += 1,
            false => window.cancelled += 1,
        }
        window.cancelled > self.most + window.answered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancelled_calls_have_a_limit_beside_answered_ones() {
        let (resets, now) = (Resets::new(3), Instant::now());
        assert!((0..3).all(|_| !resets.ended(false, now)));
        assert!(!resets.ended(true, now) && !resets.ended(false, now));
        assert!(resets.ended(false, now));
        // The next window begins at zero.
        assert!(!resets.ended(false, now + WINDOW));
    }
}

//! What a timeline does for a character that uses an object, falls or performs: plans to given
//! keyframes, held poses, and frames that no plan made.

use super::super::PlanCause;
use super::super::buffer::{Fade, Frames};
use super::super::policy::MARGIN_FRAMES;
use super::{HISTORY_FRAMES, Ticket, Timeline};

/// When a plan for the keyframes of an object is to take over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::live) struct Wish {
    /// The last context frame: the plan takes over after it.
    pub(in crate::live) splice: i64,
    /// The character stands still from that frame on until the plan arrives.
    pub(in crate::live) still: bool,
}

impl Timeline {
    /// No plan is in flight, once the frame at the cursor is settled.
    pub(in crate::live) fn is_free(&self) -> bool {
        self.flights.is_free_at(self.frame())
    }

    /// Fewest frames between the cursor and where a plan takes over, unless it is for a command.
    pub(in crate::live) fn look_ahead(&self) -> i64 {
        self.look_ahead.least()
    }

    /// The frame after which the newest motion took over, a plan's or other.
    pub(in crate::live) fn last_splice(&self) -> Option<i64> {
        self.newest.splice
    }

    /// Frames between the cursor and where a plan that is asked for now takes over in time.
    pub(in crate::live) fn ahead(&self) -> i64 {
        self.look_ahead.in_time(self.look_ahead.least())
    }

    /// The soonest frame at which a plan that is asked for at `frame` should take over: in time,
    /// but not beyond what the buffer lasts, and not within the look-ahead.
    pub(in crate::live) fn soonest(&self, frame: i64) -> i64 {
        let lasts = self.buffer.last() - MARGIN_FRAMES;
        (frame + self.ahead()).min(lasts).max(frame + self.look_ahead())
    }

    /// Decides about the frame that the cursor is at, for a character whose motion does not follow
    /// the policy. As [`Self::settle`], but asks for no plan but the given one, and only while none
    /// is in flight. A buffer that ends here without a plan in flight holds its last frame.
    pub(in crate::live) fn settle_for(&mut self, wish: Option<Wish>) -> Option<Ticket> {
        let frame = self.begin_to_settle();
        self.newest.cause = PlanCause::Object;
        let is_free = self.flights.current().is_none();
        if is_free && self.buffer.last() <= frame {
            self.hold(frame + MARGIN_FRAMES);
        }
        let wish = wish.filter(|_| is_free)?;
        let ticket = Ticket {
            still: wish.still,
            ..self.ticket(PlanCause::Object, frame, wish.splice, 0)
        };
        self.begin_flight(ticket);
        Some(ticket)
    }

    /// Repeats the last frame up to frame `to`, and drops old frames.
    pub(in crate::live) fn hold(&mut self, to: i64) {
        if self.buffer.last() < to {
            self.flights.forget_before();
            self.buffer.trim(self.frame() - HISTORY_FRAMES);
            self.buffer.hold(to);
        }
    }

    /// Replaces what comes after frame `at` by frames that no plan made. With `fades` they fade in,
    /// otherwise they follow that frame at once.
    pub(in crate::live) fn put(&mut self, at: i64, frames: Frames<'_>, fades: bool) {
        self.flights.forget_before();
        self.buffer.trim(self.frame().min(at) - HISTORY_FRAMES);
        match fades {
            true => self.buffer.splice(at, frames, Fade::USUAL),
            false => self.buffer.replace(at, frames),
        }
        self.newest.splice = Some(at);
        self.flights.recover();
    }

    /// Adds frames that no plan made after the last.
    pub(in crate::live) fn extend(&mut self, frames: Frames<'_>) {
        self.buffer.trim(self.frame() - HISTORY_FRAMES);
        let last = self.buffer.last();
        self.buffer.replace(last, frames);
        self.newest.splice = Some(last);
    }

    /// Awaits the plan in flight no longer: the character does something else.
    pub(in crate::live) fn forget_flight(&mut self) {
        self.flights.forget();
    }
}

#[cfg(test)]
#[path = "wish_tests.rs"]
mod tests;

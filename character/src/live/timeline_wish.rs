//! What a timeline does for a character that uses an object, or falls: plans that are wished for,
//! poses that are held, and frames that no plan made.

use super::super::PlanCause;
use super::super::buffer::{Fade, Frames};
use super::super::policy::MARGIN_FRAMES;
use super::{Flight, HISTORY_FRAMES, Ticket, Timeline};

/// A plan for the keyframes of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::live) struct Wish {
    /// The frame at which it is to take over.
    pub(in crate::live) splice: i64,
    /// The character stands still from that frame on until it comes.
    pub(in crate::live) still: bool,
}

impl Timeline {
    /// No plan is in flight, once the frame at the cursor is settled.
    pub(in crate::live) fn is_free(&self) -> bool {
        let ends = |flight: &Flight| flight.arrived && flight.ticket.splice <= self.frame();
        self.flight.as_ref().is_none_or(ends)
    }

    /// Frames between the cursor and where a plan takes over.
    pub(in crate::live) fn look_ahead(&self) -> i64 {
        self.look_ahead
    }

    /// The frame at which the plan that came last took over.
    pub(in crate::live) fn last_splice(&self) -> Option<i64> {
        self.last_splice
    }

    /// Frames between the cursor and where a plan that is asked for now takes over in time.
    pub(in crate::live) fn ahead(&self) -> i64 {
        self.look_ahead.max(self.lead).max(self.expected + 1)
    }

    /// The soonest frame at which a plan that is asked for at `frame` should take over: in time,
    /// but not beyond what the buffer lasts, and not within the look-ahead.
    pub(in crate::live) fn soonest(&self, frame: i64) -> i64 {
        let lasts = self.buffer.last() - MARGIN_FRAMES;
        (frame + self.ahead()).min(lasts).max(frame + self.look_ahead)
    }

    /// Decides about the frame that the cursor is at, for a character whose motion follows
    /// something else than the policy: as [`Self::settle`], but asks for the plan that is wished
    /// for, once none is in flight, and for no other. A buffer that ends here without a plan to
    /// come goes on as it ends.
    pub(in crate::live) fn settle_for(&mut self, wish: Option<Wish>) -> Option<Ticket> {
        let frame = self.begin_to_settle();
        self.last_cause = PlanCause::Object;
        if self.flight.is_none() && self.buffer.last() <= frame {
            self.hold(frame + MARGIN_FRAMES);
        }
        let wish = wish.filter(|_| self.flight.is_none())?;
        let mut ticket = self.ask(PlanCause::Object, frame, wish.splice, 0);
        ticket.still = wish.still;
        self.flight = Some(Flight::of(ticket));
        Some(ticket)
    }

    /// Has the last frame go on to frame `to`, and forgets what is behind.
    pub(in crate::live) fn hold(&mut self, to: i64) {
        if self.buffer.last() < to {
            self.forget_before();
            self.buffer.trim(self.frame() - HISTORY_FRAMES);
            self.buffer.hold(to);
        }
    }

    /// Replaces what comes behind frame `at` by frames that no plan made. They fade in, or go on
    /// from that frame at once.
    pub(in crate::live) fn put(&mut self, at: i64, frames: Frames<'_>, fades: bool) {
        self.forget_before();
        self.buffer.trim(self.frame().min(at) - HISTORY_FRAMES);
        match fades {
            true => self.buffer.splice(at, frames, Fade::USUAL),
            false => self.buffer.replace(at, frames),
        }
        self.last_splice = Some(at);
        self.failed = false;
    }

    /// Adds frames that no plan made behind the last.
    pub(in crate::live) fn extend(&mut self, frames: Frames<'_>) {
        self.buffer.trim(self.frame() - HISTORY_FRAMES);
        let last = self.buffer.last();
        self.buffer.replace(last, frames);
        self.last_splice = Some(last);
    }

    /// Where a clock that waits goes no further before words have come.
    pub(in crate::live) fn await_words(&mut self, frame: Option<i64>) {
        self.words_from = frame;
    }

    /// Waits for the plan in flight no longer, nor keeps what it would have replaced: the character
    /// does something else.
    pub(in crate::live) fn forget_flight(&mut self) {
        self.flight = None;
        self.replaced = None;
        self.failed = false;
    }
}

#[cfg(test)]
#[path = "timeline_wish_tests.rs"]
mod tests;

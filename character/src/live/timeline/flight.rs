//! The plan in flight: asked for, and not yet under the cursor.

use serde::{Deserialize, Serialize};
use troupe_motion::{Quat, Vec3};

use super::super::PlanCause;
use super::super::buffer::Frames;
use super::cursor::Cursor;

/// A plan to ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::live) struct Ticket {
    /// Counts a character's plans from 0.
    pub(in crate::live) number: u64,
    pub(in crate::live) cause: PlanCause,
    /// The frame at which the character asked for it.
    pub(in crate::live) asked_at: i64,
    /// The plan's last context frame: the plan takes over behind it.
    pub(in crate::live) splice: i64,
    /// The frame from which on the plan is missed. The scheduler orders plans by it.
    pub(in crate::live) due: i64,
    /// Frames since the splice frame of the plan before; none for the first.
    pub(in crate::live) spacing: Option<i64>,
    /// The character stands still at the splice frame: a late plan loses no frames.
    pub(super) still: bool,
}

/// The splice frame and the cause of the plan that took over last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Newest {
    /// None before the first plan.
    pub(super) splice: Option<i64>,
    pub(super) cause: PlanCause,
}

/// What a plan replaced in the buffer, so that a command can have it back.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Before {
    /// The plan replaced the frames behind this one.
    pub(super) at: i64,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    pub(super) newest: Newest,
}

impl Before {
    /// Copies `frames`, which a plan is about to replace behind frame `at`.
    pub(super) fn new(at: i64, frames: Frames<'_>, newest: Newest) -> Self {
        Self {
            at,
            roots: frames.roots.to_vec(),
            rotations: frames.rotations.to_vec(),
            contacts: frames.contacts.to_vec(),
            newest,
        }
    }

    pub(super) fn frames(&self) -> Frames<'_> {
        Frames {
            roots: &self.roots,
            rotations: &self.rotations,
            contacts: &self.contacts,
        }
    }
}

/// A plan from its request to its splice frame.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Flight {
    pub(super) ticket: Ticket,
    /// The plan is in the buffer, and the cursor before its splice frame.
    pub(super) arrived: bool,
    /// None before it arrived, and once the buffer changed in another way.
    pub(super) before: Option<Before>,
}

/// The plan in flight, and the one that it replaced.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Flights {
    current: Option<Flight>,
    /// The plan that the current one replaced. It still comes if the networks had begun with it.
    replaced: Option<Ticket>,
    /// The last plan failed or was dropped, and nothing took over since.
    failed: bool,
    /// Number of the next plan.
    next_number: u64,
}

impl Flights {
    pub(super) fn current(&self) -> Option<&Flight> {
        self.current.as_ref()
    }

    pub(super) fn next_number(&self) -> u64 {
        self.next_number
    }

    pub(super) fn has_failed(&self) -> bool {
        self.failed
    }

    /// A plan was asked for and has not arrived.
    pub(super) fn awaits_plan(&self) -> bool {
        self.current.as_ref().is_some_and(|flight| !flight.arrived)
    }

    /// No plan is in flight once frame `frame` is settled.
    pub(super) fn is_free_at(&self, frame: i64) -> bool {
        let ends = |flight: &Flight| flight.arrived && flight.ticket.splice <= frame;
        self.current.as_ref().is_none_or(ends)
    }

    /// The plan in flight should have arrived: the cursor is at its splice frame.
    pub(super) fn is_overdue(&self, cursor: &Cursor) -> bool {
        let late = |flight: &Flight| !flight.arrived && cursor.has_reached(flight.ticket.splice);
        self.current.as_ref().is_some_and(late)
    }

    /// The cursor has left the frame at which the plan in flight was asked for.
    pub(super) fn is_a_frame_old(&self, cursor: &Cursor) -> bool {
        let old = |flight: &Flight| !flight.arrived && cursor.has_reached(flight.ticket.asked_at + 1);
        self.current.as_ref().is_some_and(old)
    }

    /// Begins the flight of the plan that has [`Flights::next_number`].
    pub(super) fn begin(&mut self, ticket: Ticket) {
        self.next_number += 1;
        self.current = Some(Flight {
            ticket,
            arrived: false,
            before: None,
        });
    }

    /// A newer plan is about to replace the one of this ticket, which still counts if it arrives.
    pub(super) fn replace(&mut self, ticket: Ticket) {
        self.replaced.get_or_insert(ticket);
    }

    /// The plan in flight is in the buffer, where it replaced `before`.
    pub(super) fn arrive(&mut self, ticket: Ticket, before: Before) {
        self.current = Some(Flight {
            ticket,
            arrived: true,
            before: Some(before),
        });
    }

    /// Ends the flight of a plan that has arrived and whose splice frame is `frame` or earlier.
    pub(super) fn end_at(&mut self, frame: i64) {
        self.current
            .take_if(|flight| flight.arrived && flight.ticket.splice <= frame);
    }

    pub(super) fn end(&mut self) {
        self.current = None;
    }

    /// The ticket of plan `number`, if the character awaits it or it may still come. A replaced
    /// plan is given out once.
    pub(super) fn awaited(&mut self, number: u64) -> Option<Ticket> {
        let replaced = self.replaced.take_if(|ticket| ticket.number == number);
        let flight = self.current.as_ref().filter(|flight| !flight.arrived);
        replaced.or(flight
            .map(|flight| flight.ticket)
            .filter(|ticket| ticket.number == number))
    }

    /// Another plan than that of this ticket is in flight: it was replaced.
    pub(super) fn goes_on_without(&self, ticket: Ticket) -> bool {
        let other = |flight: &Flight| flight.ticket.number != ticket.number;
        self.current.as_ref().is_some_and(other)
    }

    /// Takes what the plan in flight replaced, if that is known.
    pub(super) fn take_before(&mut self) -> Option<(Ticket, Before)> {
        let flight = self.current.as_mut()?;
        Some((flight.ticket, flight.before.take()?))
    }

    /// The buffer changes in another way: nothing can have back what the plan in flight replaced.
    pub(super) fn forget_before(&mut self) {
        if let Some(flight) = &mut self.current {
            flight.before = None;
        }
    }

    /// The plan in flight failed, or came too late to be of use.
    pub(super) fn fail(&mut self) {
        self.current = None;
        self.failed = true;
    }

    /// The buffer has motion again: no plan is missing.
    pub(super) fn recover(&mut self) {
        self.failed = false;
    }

    /// No plan is awaited any more.
    pub(super) fn forget(&mut self) {
        self.current = None;
        self.replaced = None;
        self.failed = false;
    }

    pub(super) fn forget_replaced(&mut self) {
        self.replaced = None;
    }
}

//! What becomes of a timeline's plans: they come, late or in time, fail, or are given up for a
//! command.

use serde::{Deserialize, Serialize};
use troupe_motion::{Quat, Vec3};

use super::super::buffer::{CROSSFADE_FRAMES, Fade, Frames};
use super::super::{Arrival, CONTEXT_FRAMES, LivePlan, PlanCause, SUB_FRAMES};
use super::{Flight, HISTORY_FRAMES, SUB, Ticket, Timeline};

/// What a plan replaced.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Before {
    /// The frame behind which it did.
    at: i64,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
    contacts: Vec<u8>,
    last_splice: Option<i64>,
    last_cause: PlanCause,
}

impl Timeline {
    /// The plan of that number, where it is awaited or may still come.
    fn awaited(&mut self, number: u64) -> Option<Ticket> {
        let replaced = self.replaced.take_if(|ticket| ticket.number == number);
        let flight = self.flight.as_ref().filter(|flight| !flight.arrived);
        replaced.or(flight
            .map(|flight| flight.ticket)
            .filter(|ticket| ticket.number == number))
    }

    /// The plan in flight is another: the one of this ticket was replaced.
    pub(super) fn goes_on_without(&self, ticket: Ticket) -> bool {
        let other = |flight: &Flight| flight.ticket.number != ticket.number;
        self.flight.as_ref().is_some_and(other)
    }

    /// A plan has come.
    pub(in crate::live) fn land(&mut self, number: u64, plan: &LivePlan) -> Arrival {
        let Some(ticket) = self.awaited(number) else {
            return Arrival::Stray;
        };
        let at = ticket.splice.max(self.next_frame());
        let late = at > ticket.splice;
        self.stats.late_plans += u64::from(late);
        let missed = if ticket.still { 0 } else { at - ticket.splice };
        let used = CONTEXT_FRAMES + missed as usize;
        let usable = plan.roots.len().saturating_sub(used);
        // A keyframe at the end must lie behind the frames that it fades in over.
        if usable < CROSSFADE_FRAMES + usize::from(ticket.cause == PlanCause::Object) {
            self.give_up(ticket);
            return Arrival::Dropped;
        }
        let joints = plan.rotations.len() / plan.roots.len().max(1);
        let frames = Frames {
            roots: &plan.roots[used..],
            rotations: &plan.rotations[used * joints..],
            contacts: &plan.contacts[used..],
        };
        let in_flight = !self.goes_on_without(ticket);
        let waits = in_flight && self.cursor < ticket.splice * SUB;
        let before = waits.then(|| self.before(at));
        self.take_over(ticket, at, frames);
        if waits {
            self.flight = Some(Flight {
                ticket,
                arrived: true,
                before,
            });
        } else if in_flight {
            self.flight = None;
            // The frame at the cursor, if it is at one, is settled again, as if the plan had been
            // in time.
            self.settled = None;
        }
        match late {
            true => Arrival::Late,
            false => Arrival::InTime {
                lead_frames: (at * SUB - self.cursor) as f32 / SUB_FRAMES as f32,
            },
        }
    }

    /// Roots and rotations of the plan that came last, as they are shown, to be changed.
    pub(in crate::live) fn last_plan_mut(&mut self) -> (&[Vec3], &mut [Quat]) {
        let at = self.last_splice.unwrap_or_else(|| self.buffer.last());
        self.buffer.behind_mut(at)
    }

    /// Has a plan take over behind frame `at`.
    fn take_over(&mut self, ticket: Ticket, at: i64, frames: Frames<'_>) {
        let keep = self.frame().min(at - CONTEXT_FRAMES as i64 + 1) - HISTORY_FRAMES;
        self.buffer.trim(keep);
        let over = match ticket.cause {
            PlanCause::Command if !self.rejoined => Fade {
                // One that is late does not carry on from where the old plan has gone since.
                own_way: at == ticket.splice || ticket.still,
                ..Fade::COMMAND
            },
            _ => Fade::USUAL,
        };
        self.buffer.splice(at, frames, over);
        (self.failed, self.rejoined) = (false, false);
        self.last_splice = Some(at);
        self.last_cause = ticket.cause;
        *self.count_of(ticket.cause) += 1;
    }

    /// How many plans for this cause have taken over.
    fn count_of(&mut self, cause: PlanCause) -> &mut u64 {
        match cause {
            PlanCause::Command => &mut self.stats.plans_for_command,
            PlanCause::LowBuffer => &mut self.stats.plans_for_low_buffer,
            PlanCause::Interval => &mut self.stats.plans_for_interval,
            PlanCause::Object => &mut self.stats.plans_for_object,
        }
    }

    /// What a plan that takes over behind frame `at` replaces.
    fn before(&self, at: i64) -> Before {
        let frames = self.buffer.range(at + 1, self.buffer.last());
        Before {
            at,
            roots: frames.roots.to_vec(),
            rotations: frames.rotations.to_vec(),
            contacts: frames.contacts.to_vec(),
            last_splice: self.last_splice,
            last_cause: self.last_cause,
        }
    }

    /// Gives the buffer back what the plan in flight replaced, where that is known.
    pub(super) fn undo(&mut self) -> bool {
        let Some((ticket, before)) =
            (self.flight.as_mut()).and_then(|flight| Some((flight.ticket, flight.before.take()?)))
        else {
            return false;
        };
        let frames = Frames {
            roots: &before.roots,
            rotations: &before.rotations,
            contacts: &before.contacts,
        };
        self.buffer.replace(before.at, frames);
        (self.last_splice, self.last_cause) = (before.last_splice, before.last_cause);
        *self.count_of(ticket.cause) -= 1;
        true
    }

    /// The buffer changes in another way: what a plan replaced is no longer what was there before.
    pub(super) fn forget_before(&mut self) {
        if let Some(flight) = &mut self.flight {
            flight.before = None;
        }
    }

    /// A plan will not come.
    pub(in crate::live) fn fail(&mut self, number: u64) -> Arrival {
        let Some(ticket) = self.awaited(number) else {
            return Arrival::Stray;
        };
        if self.goes_on_without(ticket) {
            return Arrival::Stray;
        }
        self.stats.failed_plans += 1;
        self.give_up(ticket);
        Arrival::Failed
    }

    /// The next frame asks for another plan instead, for the same cause.
    pub(super) fn give_up(&mut self, ticket: Ticket) {
        if self.goes_on_without(ticket) {
            return;
        }
        self.flight = None;
        self.failed = true;
        self.command_changed |= ticket.cause == PlanCause::Command;
    }
}

//! How a timeline's plans end: they arrive in time or late, fail, or make way for a command.

use super::super::buffer::{CROSSFADE_FRAMES, Fade, Frames, FramesMut};
use super::super::{Arrival, CONTEXT_FRAMES, LivePlan, PlanCause};
use super::flight::{Before, Newest, Ticket};
use super::{HISTORY_FRAMES, Timeline};

impl Timeline {
    /// Takes a plan that has arrived.
    pub(in crate::live) fn land(&mut self, number: u64, plan: &LivePlan) -> Arrival {
        let Some(ticket) = self.flights.awaited(number) else {
            return Arrival::Stray;
        };
        let at = ticket.splice.max(self.cursor.next_frame());
        let late = at > ticket.splice;
        self.stats.late_plans += u64::from(late);
        let missed = if ticket.still { 0 } else { at - ticket.splice };
        let used = CONTEXT_FRAMES + missed as usize;
        let usable = plan.roots.len().saturating_sub(used);
        // A keyframe at the end must lie after the frames over which the plan fades in.
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
        self.place(ticket, at, frames);
        match late {
            true => Arrival::Late,
            false => Arrival::InTime {
                lead_frames: self.cursor.frames_to(at),
            },
        }
    }

    /// Puts a plan's frames after frame `at`. A command can undo that until the cursor is at the
    /// splice frame.
    fn place(&mut self, ticket: Ticket, at: i64, frames: Frames<'_>) {
        let in_flight = !self.flights.goes_on_without(ticket);
        let before = (in_flight && !self.cursor.has_reached(ticket.splice)).then(|| {
            let replaced = self.buffer.range(at + 1, self.buffer.last());
            Before::new(at, replaced, self.newest)
        });
        self.take_over(ticket, at, frames);
        if let Some(before) = before {
            self.flights.arrive(ticket, before);
        } else if in_flight {
            self.flights.end();
            // The cursor's frame, if the cursor is at one, is settled again, as if the plan had
            // been in time.
            self.settled = None;
        }
    }

    /// The newest plan as it is in the buffer, to be changed, behind the frames before it.
    pub(in crate::live) fn last_plan_mut(&mut self) -> FramesMut<'_> {
        let at = self.newest.splice.unwrap_or_else(|| self.buffer.last());
        self.buffer.behind_mut(at)
    }

    /// Has a plan take over after frame `at`.
    fn take_over(&mut self, ticket: Ticket, at: i64, frames: Frames<'_>) {
        let keep = self.frame().min(at - CONTEXT_FRAMES as i64 + 1) - HISTORY_FRAMES;
        self.buffer.trim(keep);
        let over = match ticket.cause {
            PlanCause::Command if !self.rejoined => Fade {
                // A late plan does not carry on from where the old plan has gone since.
                own_way: at == ticket.splice || ticket.still,
                ..Fade::COMMAND
            },
            _ => Fade::USUAL,
        };
        self.buffer.splice(at, frames, over);
        self.flights.recover();
        self.rejoined = false;
        self.newest = Newest {
            splice: Some(at),
            cause: ticket.cause,
        };
        *self.stats.plans_for(ticket.cause) += 1;
    }

    /// Gives the buffer back what the plan in flight replaced. Answers whether that was known.
    pub(super) fn undo(&mut self) -> bool {
        let Some((ticket, before)) = self.flights.take_before() else {
            return false;
        };
        self.buffer.replace(before.at, before.frames());
        self.newest = before.newest;
        *self.stats.plans_for(ticket.cause) -= 1;
        true
    }

    /// A plan will not arrive.
    pub(in crate::live) fn fail(&mut self, number: u64) -> Arrival {
        match self.flights.awaited(number) {
            Some(ticket) if !self.flights.goes_on_without(ticket) => {
                self.stats.failed_plans += 1;
                self.give_up(ticket);
                Arrival::Failed
            }
            _ => Arrival::Stray,
        }
    }

    /// The next frame asks for another plan instead, for the same cause.
    pub(super) fn give_up(&mut self, ticket: Ticket) {
        if self.flights.goes_on_without(ticket) {
            return;
        }
        self.flights.fail();
        self.command_changed |= ticket.cause == PlanCause::Command;
    }
}

//! A character's timeline: the cursor, when to ask for a plan, and where a plan takes over. It
//! knows neither commands nor networks: only that the command changed, and how long plans take.
//!
//! Frames are decided about one by one: [`Timeline::run`] stops at every frame for
//! [`Timeline::settle`]. A plan that is asked for at frame f takes over at its splice frame,
//! `look_ahead` frames on. It stays in flight until the cursor is there, even if it arrives early.
//! So frames do not depend on how long plans take, as long as none is late.
//!
//! A plan for a command takes over sooner ([`look_ahead`]). The character gives up a plan in flight
//! that would not take over before that. If that plan has arrived, the buffer gets back what was
//! there before, so the result is the same as if it had not.
//!
//! What is in the buffer beyond the splice frame does depend on how long plans take. Locomotion
//! never looks there. A character in a scene does, to see where an approach ends or how a fall
//! begins. A clock that waits therefore stops such a character one frame after it asked for a plan
//! ([`Barrier::plan_early`]).
//!
//! While a character uses an object or falls, the policy has no say: [`Timeline::settle_for`] asks
//! for one given plan, and [`Timeline::hold`] and [`Timeline::put`] write motion without a plan.

mod cursor;
mod flight;
mod land;
mod look_ahead;
mod wish;

use serde::{Deserialize, Serialize};

use super::buffer::{MotionBuffer, Seam};
use super::policy::{INTERVAL_GRACE, MARGIN_FRAMES, Policy};
use super::{Clock, MAX_PAST_FRAMES, PlanCause, Stats};
use crate::primitives::recipe::VELOCITY_FRAMES;

use cursor::Cursor;
pub(super) use flight::Ticket;
use flight::{Flights, Newest};
use look_ahead::LookAhead;
pub(super) use wish::Wish;

/// Frames that the first plan may take: a crowd that is set in motion asks for all its plans at
/// once.
const FIRST_PLAN_FRAMES: i64 = 24;
/// Most frames that the first plan may take, for a crowd whose plans take longer than that.
const MAX_FIRST_PLAN_FRAMES: i64 = 120;
/// Frames kept behind the cursor: what a plan's context and the velocity before it take, and the
/// past that a performance goes on from.
pub(super) const HISTORY_FRAMES: i64 = {
    let (velocity, past) = (VELOCITY_FRAMES as i64 + 2, MAX_PAST_FRAMES as i64);
    if velocity > past { velocity } else { past }
};

/// What stopped the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// It is at this frame, which is to be settled.
    AtFrame(i64),
    /// It waits for the plan in flight, or at a [`Barrier`].
    NeedsPlan,
    /// It made the whole step.
    Done,
}

/// What holds up a clock that waits, apart from a plan that is overdue.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Barrier {
    /// Wait for the plan in flight from the frame after its request on, because decisions look at
    /// frames beyond its splice frame.
    pub(super) plan_early: bool,
    /// Go no further than this frame.
    pub(super) frame: Option<i64>,
}

/// The cursor, the buffer that it moves on, and the plan in flight.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Timeline {
    buffer: MotionBuffer,
    cursor: Cursor,
    look_ahead: LookAhead,
    flights: Flights,
    /// The plan that took over last. A plan for a command that gives it up restores the one before.
    newest: Newest,
    /// The newest frame that was settled.
    settled: Option<i64>,
    /// The command changed since the last plan was asked for.
    command_changed: bool,
    /// [`Timeline::rejoin`] changed the frames that are shown, and no plan has taken over since.
    rejoined: bool,
    /// Any number. Characters with different numbers do not ask in step after a command to all of
    /// them.
    phase: u64,
    stats: Stats,
}

impl Timeline {
    /// A timeline at frame 0 whose buffer ends there or later. The buffer is drawn out, to give the
    /// first plan time. `phase` is any number, best a different one for each character.
    pub(super) fn new(mut buffer: MotionBuffer, look_ahead_frames: u32, phase: u64) -> Self {
        let look_ahead = LookAhead::new(look_ahead_frames);
        buffer.draw_out(look_ahead.least().max(FIRST_PLAN_FRAMES) + MARGIN_FRAMES);
        Self {
            buffer,
            cursor: Cursor::new(),
            look_ahead,
            flights: Flights::default(),
            newest: Newest {
                splice: None,
                cause: PlanCause::Command,
            },
            settled: None,
            command_changed: true,
            rejoined: false,
            phase,
            stats: Stats::default(),
        }
    }

    pub(super) fn buffer(&self) -> &MotionBuffer {
        &self.buffer
    }

    /// Sub-frames from frame 0.
    pub(super) fn cursor(&self) -> i64 {
        self.cursor.at()
    }

    /// The cursor's frame, rounded down.
    pub(super) fn frame(&self) -> i64 {
        self.cursor.frame()
    }

    pub(super) fn stats(&self) -> Stats {
        self.stats
    }

    /// The character slows down because a plan is missing.
    pub(super) fn slowing(&self) -> bool {
        self.cursor.is_slowing()
    }

    /// A plan was asked for and has not arrived.
    pub(super) fn awaits_plan(&self) -> bool {
        self.flights.awaits_plan()
    }

    /// No plan was asked for yet with the current command.
    pub(super) fn command_waits(&self) -> bool {
        self.command_changed
    }

    /// The command changed at the frame that is being settled.
    pub(super) fn command_changed(&mut self) {
        self.command_changed = true;
    }

    /// A plan asked for now is expected to take `frames` frames, and is to take over no sooner.
    /// Plans take `usually` frames at the moment, and are asked for that far ahead.
    pub(super) fn expect(&mut self, frames: u32, usually: u32) {
        self.look_ahead.expect(frames, usually);
    }

    /// Frames from the cursor to where a plan for a command takes over at the soonest. The motion
    /// of an object and a changed pose both fade out over the look-ahead, and a plan takes over
    /// after that.
    fn command_ahead(&self) -> i64 {
        let fades = self.rejoined || self.newest.cause == PlanCause::Object;
        self.look_ahead.command(fades)
    }

    /// The splice frame of a plan asked for at `frame`: when it should have arrived, but no further
    /// than the buffer lasts, and not within the look-ahead.
    fn splice_frame(&self, frame: i64, policy: Policy) -> i64 {
        let (least, in_time) = match self.command_changed {
            true => (self.command_ahead(), self.command_in_time(frame)),
            false => (
                self.look_ahead.least(),
                frame + self.look_ahead.reach_in_time(policy),
            ),
        };
        let lasts = self.buffer.last() - policy.margin();
        in_time.min(lasts).max(frame + least)
    }

    /// The soonest frame at which a plan for a command at `frame` takes over in time. The extra
    /// lead of a crowd under load does not count: the command would only be answered later.
    fn command_in_time(&self, frame: i64) -> i64 {
        frame + self.look_ahead.in_time(self.command_ahead())
    }

    /// Makes the current step longer by `sub_frames`.
    pub(super) fn push(&mut self, sub_frames: u32) {
        self.cursor.push(sub_frames);
    }

    /// Moves the cursor until something stops it. To be called again after [`Stop::AtFrame`].
    ///
    /// A clock that runs settles a frame when the cursor reaches it, to ask for plans early. A
    /// clock that waits settles a frame when the cursor leaves it, with all commands that came at
    /// that frame. So it never depends on when plans came.
    pub(super) fn run(&mut self, clock: Clock, barrier: Barrier) -> Stop {
        loop {
            let (frame, moving) = (self.frame(), self.cursor.is_moving());
            let stuck = moving && self.flights.current().is_none() && self.frames_left() == 0;
            let unsettled = self.settled != Some(frame) && (moving || clock == Clock::Runs);
            // Before the frame is settled: it must be settled once, with the plan.
            if moving && clock == Clock::Waits && self.is_held_up(barrier) {
                return Stop::NeedsPlan;
            }
            if self.cursor.on_frame() && (stuck || unsettled) {
                return Stop::AtFrame(frame);
            }
            if !moving {
                return Stop::Done;
            }
            let lacks_plan = self.flights.has_failed() || self.flights.is_overdue(&self.cursor);
            let underrun = self
                .cursor
                .go(self.buffer.last(), clock == Clock::Runs && lacks_plan);
            self.stats.underruns += u64::from(underrun);
        }
    }

    /// A clock that waits goes no further without the plan in flight, or at the barrier.
    fn is_held_up(&self, barrier: Barrier) -> bool {
        let overdue = self.flights.is_overdue(&self.cursor);
        let at_frame = barrier.frame.is_some_and(|frame| self.cursor.has_reached(frame));
        overdue || at_frame || barrier.plan_early && self.flights.is_a_frame_old(&self.cursor)
    }

    /// Whole frames in the buffer beyond the cursor.
    pub(super) fn frames_left(&self) -> i64 {
        self.cursor.frames_left(self.buffer.last())
    }

    /// Decides about the frame that the cursor is at: ends the flight of a plan whose splice frame
    /// it is, and asks for the next if the policy says so.
    pub(super) fn settle(&mut self, clock: Clock, policy: Policy) -> Option<Ticket> {
        let frame = self.begin_to_settle();
        if self.flights.current().is_some() {
            return self.ask_instead(frame, clock, policy);
        }
        if self.flights.next_number() == 0 {
            // The character stands or comes to rest, and may do so for longer.
            let wait = self.look_ahead.expected().min(MAX_FIRST_PLAN_FRAMES);
            self.buffer.draw_out(frame + wait + 1 + MARGIN_FRAMES);
        }
        let splice = self.splice_frame(frame, policy);
        let cause = self.cause(frame + self.look_ahead.reach(policy), policy)?;
        let slack = (self.buffer.last() - policy.margin() - splice).max(0);
        let grace = match cause {
            PlanCause::Interval => slack.min(INTERVAL_GRACE),
            PlanCause::Command | PlanCause::LowBuffer | PlanCause::Object => 0,
        };
        Some(self.ask(cause, frame, splice, grace))
    }

    /// Asks for a plan for a changed command while another plan is in flight, if the new plan need
    /// not wait for that one.
    fn ask_instead(&mut self, frame: i64, clock: Clock, policy: Policy) -> Option<Ticket> {
        let flight = self.flights.current()?;
        let (ticket, arrived) = (flight.ticket, flight.arrived);
        if !self.command_changed || ticket.asked_at == frame {
            return None;
        }
        let sooner = self.command_in_time(frame) <= ticket.splice && ticket.cause != PlanCause::Object;
        let given_up = sooner && (!arrived || self.undo());
        // A plan that was asked for further ahead than the look-ahead does not hold up a command:
        // the new plan replaces it from the new plan's splice frame on.
        let far = arrived && ticket.splice > frame + self.look_ahead.least();
        let splice = self.splice_frame(frame, policy);
        if given_up || far {
            return Some(self.ask(PlanCause::Command, frame, splice, 0));
        }
        if clock == Clock::Waits || arrived || self.look_ahead.expected() <= self.look_ahead.least() {
            return None;
        }
        // The plan in flight waits in a long queue. A newer one takes its place there, and its
        // splice frame unless that is too near.
        let at = ticket.splice.max(frame + self.look_ahead.least());
        self.flights.replace(ticket);
        Some(self.ask(PlanCause::Command, frame, splice.min(at), 0))
    }

    /// Notes that the frame at the cursor is settled now. The flight of a plan that has arrived
    /// ends where the plan takes over.
    fn begin_to_settle(&mut self) -> i64 {
        let frame = self.frame();
        self.settled = Some(frame);
        self.flights.end_at(frame);
        frame
    }

    /// What calls for a plan that would take over at `splice`. The queue for the networks makes no
    /// difference to that: a crowd would ask for more the longer it has to wait.
    fn cause(&self, splice: i64, policy: Policy) -> Option<PlanCause> {
        let is_due = |interval| {
            (self.newest.splice)
                .is_none_or(|newest| splice >= newest + self.wait(i64::from(interval), policy))
        };
        let early = self.spread(policy.early());
        if self.command_changed {
            Some(PlanCause::Command)
        } else if self.buffer.last() <= splice + policy.margin() + early {
            Some(PlanCause::LowBuffer)
        } else if policy.interval().is_some_and(is_due) {
            Some(PlanCause::Interval)
        } else {
            None
        }
    }

    /// Frames from the last plan to the next for an interval of `interval` frames. After a plan for
    /// a command it is up to half the usual interval less, by the character's phase. If many
    /// characters had a command at once, it is up to half of this interval less.
    fn wait(&self, interval: i64, policy: Policy) -> i64 {
        let usual = i64::from(policy.interval_frames.unwrap_or_default());
        match self.newest.cause {
            PlanCause::Command => {
                let most = self.look_ahead.last_expected().min(interval / 2).max(usual / 2);
                interval - self.spread(most as u32 + 1)
            }
            PlanCause::LowBuffer | PlanCause::Interval | PlanCause::Object => interval,
        }
    }

    /// A number below `count` that differs from character to character and from plan to plan.
    fn spread(&self, count: u32) -> i64 {
        (self.phase.wrapping_add(self.flights.next_number()) % u64::from(count.max(1))) as i64
    }

    /// Asks for the very first plan at once, to take over at frame 0.
    pub(super) fn ask_first(&mut self) -> Ticket {
        self.ask(PlanCause::Command, 0, 0, 0)
    }

    fn ask(&mut self, cause: PlanCause, frame: i64, splice: i64, grace: i64) -> Ticket {
        let ticket = self.ticket(cause, frame, splice, grace);
        self.begin_flight(ticket);
        ticket
    }

    fn ticket(&self, cause: PlanCause, frame: i64, splice: i64, grace: i64) -> Ticket {
        let splice = splice.min(self.buffer.last());
        Ticket {
            number: self.flights.next_number(),
            cause,
            asked_at: frame,
            splice,
            due: splice + grace,
            spacing: self.newest.splice.map(|newest| splice - newest),
            still: false,
        }
    }

    fn begin_flight(&mut self, ticket: Ticket) {
        self.look_ahead.note_asked();
        self.command_changed = false;
        self.flights.begin(ticket);
    }

    /// Goes on after the timeline was saved without the plans that were asked for: they will not
    /// arrive. The next frame asks for another instead. Answers the number of the plan in flight.
    ///
    /// # Errors
    /// What of the saved timeline makes no sense.
    pub(super) fn wake(&mut self, joints: usize) -> Result<Option<u64>, String> {
        self.buffer.check(joints)?;
        let (first, last) = (self.buffer.first(), self.buffer.last());
        if !self.cursor.is_within(first, last) {
            return Err(format!(
                "its cursor is at frame {}; allowed: frames {first} to {last} of its buffer",
                self.frame()
            ));
        }
        self.flights.forget_replaced();
        let flight = self.flights.current().filter(|flight| !flight.arrived);
        let Some(ticket) = flight.map(|flight| flight.ticket) else {
            return Ok(None);
        };
        self.give_up(ticket);
        Ok(Some(ticket.number))
    }

    /// Draws the buffer out to `frame` and beyond, with time for a plan. Answers the sub-frames
    /// from the cursor to there.
    pub(super) fn reach_for(&mut self, frame: i64) -> u32 {
        self.flights.forget_before();
        self.buffer
            .draw_out(frame + self.look_ahead.least() + MARGIN_FRAMES);
        self.cursor.hurry_to(frame)
    }

    /// Changes what is shown at the cursor's frame and after it.
    pub(super) fn rejoin(&mut self, seam: &Seam) {
        self.flights.forget_before();
        self.buffer.rejoin(self.frame(), seam);
        self.rejoined = true;
        self.command_changed = true;
    }
}

#[cfg(test)]
mod tests;

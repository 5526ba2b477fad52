//! A character's timeline: the cursor, when to ask for a plan, and where a plan takes over. It
//! knows neither commands nor networks, only that the command changed and that a plan is so many
//! frames.
//!
//! Frames are decided about one by one: [`Timeline::run`] stops at every frame for
//! [`Timeline::settle`]. A plan that is asked for at frame f takes over at its splice frame,
//! `look_ahead` frames on, and stays in flight until the cursor is there, however early it comes.
//! So frames do not depend on how long plans take, as long as none is late.
//!
//! A command has its plan take over sooner, [`COMMAND_AHEAD_FRAMES`] on. A plan in flight that
//! would take over no sooner than that is given up for it. If it has come, the buffer has back what
//! was there before, so that this makes no difference either.
//!
//! What is in the buffer beyond the splice frame does depend on it. Locomotion never looks there,
//! but whoever acts in a scene does: where an approach will be, how a fall begins. A clock that
//! waits therefore waits for such a character's plans at the frame after the one at which they were
//! asked for ([`Timeline::looks_ahead`]).
//!
//! While a character uses an object, or falls, what it does next is not the policy's:
//! [`Timeline::settle_for`] asks for the plan that is wished for and no other, [`Timeline::hold`]
//! and [`Timeline::put`] write motion that no plan made.

use super::buffer::{MotionBuffer, Seam};
use super::policy::{INTERVAL_GRACE, MARGIN_FRAMES, Policy};
use super::{Clock, MAX_PAST_FRAMES, PlanCause, SUB_FRAMES, Stats};
use crate::primitives::recipe::VELOCITY_FRAMES;
use serde::{Deserialize, Serialize};

#[path = "timeline_land.rs"]
mod land;
#[path = "timeline_wish.rs"]
mod wish;

use land::Before;

pub(super) use wish::Wish;

/// Sub-frames of a frame, as the cursor counts.
const SUB: i64 = SUB_FRAMES as i64;
/// Pace of a character that is not slowed down: as many parts of it as the margin has sub-frames.
const FULL_PACE: i64 = MARGIN_FRAMES * SUB;
/// Frames that the first plan may take: a crowd that is set in motion asks for all of its plans at
/// once.
const FIRST_PLAN_FRAMES: i64 = 24;
/// And that it may at most, where they are so many that those will not do.
const MAX_FIRST_PLAN_FRAMES: i64 = 120;
/// Frames from the cursor to where a plan for a command takes over, where it is not less anyway.
/// With the look-ahead's four, half of the time that a character takes to start would be spent
/// waiting; with one, a plan that is made within a tick would be late.
const COMMAND_AHEAD_FRAMES: i64 = 2;
/// Frames kept behind the cursor: what a plan's context and the velocity before it take, and the
/// past that words go on from.
pub(super) const HISTORY_FRAMES: i64 = {
    let (velocity, past) = (VELOCITY_FRAMES as i64 + 2, MAX_PAST_FRAMES as i64);
    if velocity > past { velocity } else { past }
};

/// What stopped the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// It is at this frame, which is to be settled.
    AtFrame(i64),
    /// It waits for the plan in flight.
    NeedsPlan,
    /// The step is done.
    Done,
}

/// A plan to ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Ticket {
    /// Counts the plans from 0.
    pub(super) number: u64,
    /// What called for it.
    pub(super) cause: PlanCause,
    /// The frame at which it was asked for.
    pub(super) asked_at: i64,
    /// The frame of its last context frame.
    pub(super) splice: i64,
    /// The frame from which on it is missed: by it the scheduler orders plans.
    pub(super) due: i64,
    /// Frames since the splice frame of the plan before; none for the first.
    pub(super) spacing: Option<i64>,
    /// The character stands still there: should the plan be late, nothing of it is lost.
    still: bool,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct Flight {
    ticket: Ticket,
    /// It is in the buffer, and the cursor not yet at its splice frame.
    arrived: bool,
    /// What it replaced in the buffer, as long as a command may have it back.
    before: Option<Before>,
}

impl Flight {
    fn of(ticket: Ticket) -> Self {
        Self {
            ticket,
            arrived: false,
            before: None,
        }
    }
}

/// The cursor, the buffer that it moves on, and the plan in flight.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Timeline {
    buffer: MotionBuffer,
    look_ahead: i64,
    /// Frames that a plan asked for now is expected to take.
    expected: i64,
    /// Frames by which plans are asked for ahead of the cursor, where not as the look-ahead.
    lead: i64,
    /// Frames that the plan that was asked for last was expected to take.
    last_expected: i64,
    /// Sub-frames from frame 0.
    cursor: i64,
    /// Sub-frames of the current step that the cursor has not made yet.
    pending: i64,
    /// The newest frame that was settled.
    settled: Option<i64>,
    /// Of [`FULL_PACE`].
    pace: i64,
    /// The pace is down for want of a plan.
    slowing: bool,
    /// The last plan failed or was dropped.
    failed: bool,
    /// The command changed since the last plan was asked for.
    command_changed: bool,
    /// What is shown was changed, and no plan has taken over since.
    rejoined: bool,
    flight: Option<Flight>,
    /// Decisions look at frames beyond the splice frame of a plan in flight.
    looks_ahead: bool,
    /// A clock that waits goes no further than this frame before words have come.
    words_from: Option<i64>,
    /// The plan that the one in flight replaced. It still comes if the networks had begun it.
    replaced: Option<Ticket>,
    last_splice: Option<i64>,
    /// What called for the plan that took over last.
    last_cause: PlanCause,
    /// Any number; characters of different numbers do not ask in step after a command to all of
    /// them.
    phase: u64,
    next_number: u64,
    stats: Stats,
}

impl Timeline {
    /// A timeline at frame 0 whose buffer ends there or later. The buffer is drawn out so that the
    /// first plan has time. `phase` is any number, best a different one for each character.
    pub(super) fn new(mut buffer: MotionBuffer, look_ahead_frames: u32, phase: u64) -> Self {
        let look_ahead = i64::from(look_ahead_frames.max(1));
        buffer.draw_out(look_ahead.max(FIRST_PLAN_FRAMES) + MARGIN_FRAMES);
        Self {
            buffer,
            look_ahead,
            expected: 0,
            lead: 0,
            last_expected: 0,
            cursor: 0,
            pending: 0,
            settled: None,
            pace: FULL_PACE,
            slowing: false,
            failed: false,
            command_changed: true,
            rejoined: false,
            flight: None,
            looks_ahead: false,
            words_from: None,
            replaced: None,
            last_splice: None,
            last_cause: PlanCause::Command,
            phase,
            next_number: 0,
            stats: Stats::default(),
        }
    }

    /// The same for a character whose decisions look at frames that a plan in flight may replace.
    pub(super) fn looks_ahead(self) -> Self {
        let looks_ahead = true;
        Self { looks_ahead, ..self }
    }

    /// [`Timeline::looks_ahead`] for one that is under way.
    pub(super) fn look_ahead_from_now(&mut self) {
        self.looks_ahead = true;
    }

    pub(super) fn buffer(&self) -> &MotionBuffer {
        &self.buffer
    }

    /// Sub-frames from frame 0.
    pub(super) fn cursor(&self) -> i64 {
        self.cursor
    }

    /// The cursor's frame, rounded down.
    pub(super) fn frame(&self) -> i64 {
        self.cursor / SUB
    }

    /// The first frame that the cursor has not left.
    fn next_frame(&self) -> i64 {
        (self.cursor + SUB - 1) / SUB
    }

    fn on_frame(&self) -> bool {
        self.cursor % SUB == 0
    }

    pub(super) fn stats(&self) -> Stats {
        self.stats
    }

    /// The character is slowed down for want of a plan.
    pub(super) fn slowing(&self) -> bool {
        self.slowing
    }

    /// A plan was asked for and has not come.
    pub(super) fn awaits_plan(&self) -> bool {
        self.flight.as_ref().is_some_and(|flight| !flight.arrived)
    }

    /// The current command's change waits for the next plan.
    pub(super) fn command_waits(&self) -> bool {
        self.command_changed
    }

    /// The command changed at the frame that is being settled.
    pub(super) fn command_changed(&mut self) {
        self.command_changed = true;
    }

    /// A plan asked for now is expected to take `frames` frames, and is to take over no sooner.
    /// Plans take `usually` frames at the moment, and are asked for as much ahead.
    pub(super) fn expect(&mut self, frames: u32, usually: u32) {
        self.expected = i64::from(frames);
        self.lead = i64::from(usually);
    }

    /// Frames from the cursor to where a plan for a command takes over at the soonest. Who used an
    /// object, or fell, is handed over the look-ahead before the end of that; and what was changed
    /// fades for as long.
    fn command_ahead(&self) -> i64 {
        match self.rejoined || self.last_cause == PlanCause::Object {
            true => self.look_ahead,
            false => self.look_ahead.min(COMMAND_AHEAD_FRAMES),
        }
    }

    /// Frames from the cursor to where a plan takes over, where nothing holds it up.
    fn reach(&self, policy: Policy) -> i64 {
        let paced = policy.pace.map_or(0, |pace| i64::from(pace.lead_frames));
        (self.look_ahead + paced).max(self.lead)
    }

    /// The splice frame of a plan asked for now at `frame`: where it should have come, but no
    /// further than the buffer lasts, and not within the look-ahead.
    fn splice_frame(&self, frame: i64, policy: Policy) -> i64 {
        let (least, in_time) = match self.command_changed {
            true => (self.command_ahead(), self.command_in_time(frame)),
            false => {
                let reach = self.reach(policy).max(self.expected + 1);
                (self.look_ahead, frame + reach)
            }
        };
        let lasts = self.buffer.last() - policy.margin();
        in_time.min(lasts).max(frame + least)
    }

    /// The soonest frame at which a plan for a command at `frame` takes over in time. What others'
    /// plans may be asked for ahead does not count: it would only be answered later.
    fn command_in_time(&self, frame: i64) -> i64 {
        frame + self.command_ahead().max(self.lead).max(self.expected + 1)
    }

    /// Adds to the way that the cursor is to go.
    pub(super) fn push(&mut self, sub_frames: u32) {
        self.pending += i64::from(sub_frames);
    }

    /// Moves the cursor until something stops it. To be called again after [`Stop::AtFrame`].
    ///
    /// A clock that runs settles a frame when the cursor reaches it, so that plans are asked for
    /// early. One that waits settles it when the cursor leaves it, with all commands that came at
    /// that frame, and so never depends on when plans came.
    pub(super) fn run(&mut self, clock: Clock) -> Stop {
        loop {
            let (frame, moving) = (self.frame(), self.pending > 0);
            let stuck = moving && self.flight.is_none() && self.frames_left() == 0;
            let unsettled = self.settled != Some(frame) && (moving || clock == Clock::Runs);
            // Before the frame is settled: it must be settled once, with the plan.
            if moving && clock == Clock::Waits && self.is_waited_for() {
                return Stop::NeedsPlan;
            }
            if self.on_frame() && (stuck || unsettled) {
                return Stop::AtFrame(frame);
            }
            if !moving {
                return Stop::Done;
            }
            self.go(clock);
        }
    }

    /// Moves the cursor along the current step, at most to the next frame.
    fn go(&mut self, clock: Clock) {
        self.slow_down(clock);
        let step = self.pending.min(SUB);
        let way = (step * self.pace / FULL_PACE).max(1);
        let next = (self.frame() + 1) * SUB - self.cursor;
        let spent = match way <= next {
            true => step,
            false => (next * FULL_PACE / self.pace).clamp(1, step),
        };
        self.pending -= spent;
        self.cursor = (self.cursor + way.min(next)).min(self.buffer.last() * SUB);
        if !self.slowing {
            // From a standstill it takes as many frames to be back at full pace as the margin has.
            self.pace = (self.pace + spent).min(FULL_PACE);
        }
    }

    /// With a plan overdue, the pace falls with what remains of the buffer.
    fn slow_down(&mut self, clock: Clock) {
        let remain = self.buffer.last() * SUB - self.cursor;
        let slow = clock == Clock::Runs && (self.failed || self.overdue()) && remain < FULL_PACE;
        if slow {
            self.stats.underruns += u64::from(!self.slowing);
            self.pace = self.pace.min(remain).max(1);
        }
        self.slowing = slow;
    }

    /// The plan in flight should have come.
    fn overdue(&self) -> bool {
        let late = |flight: &Flight| !flight.arrived && flight.ticket.splice * SUB <= self.cursor;
        self.flight.as_ref().is_some_and(late)
    }

    /// A clock that waits goes no further without the plan in flight, or without words.
    fn is_waited_for(&self) -> bool {
        let early = |flight: &Flight| !flight.arrived && (flight.ticket.asked_at + 1) * SUB <= self.cursor;
        let words = self.words_from.is_some_and(|frame| frame * SUB <= self.cursor);
        self.overdue() || words || self.looks_ahead && self.flight.as_ref().is_some_and(early)
    }

    /// Whole frames in the buffer beyond the cursor.
    pub(super) fn frames_left(&self) -> i64 {
        (self.buffer.last() * SUB - self.cursor) / SUB
    }

    /// Decides about the frame that the cursor is at: ends the flight of a plan whose splice frame
    /// it is, and asks for the next where the policy says so.
    pub(super) fn settle(&mut self, clock: Clock, policy: Policy) -> Option<Ticket> {
        let frame = self.begin_to_settle();
        if let Some(flight) = &self.flight {
            let (ticket, arrived) = (flight.ticket, flight.arrived);
            if !self.command_changed || ticket.asked_at == frame {
                return None;
            }
            let sooner = self.command_in_time(frame) <= ticket.splice && ticket.cause != PlanCause::Object;
            let given_up = sooner && (!arrived || self.undo());
            // One that was asked for further ahead than the look-ahead is no reason for a command
            // to wait: what it brought is replaced from the new plan's splice frame on.
            let far = arrived && ticket.splice > frame + self.look_ahead;
            let splice = self.splice_frame(frame, policy);
            if given_up || far {
                return Some(self.ask(PlanCause::Command, frame, splice, 0));
            }
            if clock == Clock::Waits || arrived || self.expected <= self.look_ahead {
                return None;
            }
            // The plan in flight waits in a long queue: a newer one takes its place there, and its
            // splice frame where that is not too near.
            let at = ticket.splice.max(frame + self.look_ahead);
            self.replaced.get_or_insert(ticket);
            return Some(self.ask(PlanCause::Command, frame, splice.min(at), 0));
        }
        if self.next_number == 0 {
            // It stands or comes to rest, so that it may do so for longer.
            let wait = self.expected.min(MAX_FIRST_PLAN_FRAMES);
            self.buffer.draw_out(frame + wait + 1 + MARGIN_FRAMES);
        }
        let splice = self.splice_frame(frame, policy);
        let cause = self.cause(frame + self.reach(policy), policy)?;
        let slack = (self.buffer.last() - policy.margin() - splice).max(0);
        let grace = match cause {
            PlanCause::Interval => slack.min(INTERVAL_GRACE),
            PlanCause::Command | PlanCause::LowBuffer | PlanCause::Object => 0,
        };
        Some(self.ask(cause, frame, splice, grace))
    }

    /// The frame at the cursor, which is settled now; the flight of a plan that has come ends where
    /// the plan takes over.
    fn begin_to_settle(&mut self) -> i64 {
        let frame = self.frame();
        self.settled = Some(frame);
        self.flight
            .take_if(|flight| flight.arrived && flight.ticket.splice <= frame);
        frame
    }

    /// What calls for a plan that would take over at `splice`. What waits at the moment makes no
    /// difference to that, or a crowd would ask for more the longer it has to wait.
    fn cause(&self, splice: i64, policy: Policy) -> Option<PlanCause> {
        let is_due = |interval| {
            self.last_splice
                .is_none_or(|last| splice >= last + self.wait(i64::from(interval), policy))
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
    /// a command it is less by up to half the usual interval, by the character's phase, or by up to
    /// half of this one where many had one at once.
    fn wait(&self, interval: i64, policy: Policy) -> i64 {
        let usual = i64::from(policy.interval_frames.unwrap_or_default());
        match self.last_cause {
            PlanCause::Command => {
                let most = self.last_expected.min(interval / 2).max(usual / 2);
                interval - self.spread(most as u32 + 1)
            }
            PlanCause::LowBuffer | PlanCause::Interval | PlanCause::Object => interval,
        }
    }

    /// A number below `count` that differs from character to character and from plan to plan.
    fn spread(&self, count: u32) -> i64 {
        (self.phase.wrapping_add(self.next_number) % u64::from(count.max(1))) as i64
    }

    /// Asks for the very first plan at once, to take over at frame 0.
    pub(super) fn ask_first(&mut self) -> Ticket {
        self.ask(PlanCause::Command, 0, 0, 0)
    }

    fn ask(&mut self, cause: PlanCause, frame: i64, splice: i64, grace: i64) -> Ticket {
        let splice = splice.min(self.buffer.last());
        let ticket = Ticket {
            number: self.next_number,
            cause,
            asked_at: frame,
            splice,
            due: splice + grace,
            spacing: self.last_splice.map(|last| splice - last),
            still: false,
        };
        self.next_number += 1;
        self.last_expected = self.expected;
        self.command_changed = false;
        self.flight = Some(Flight::of(ticket));
        ticket
    }

    /// The plans that were asked for will not come: the timeline was saved without them. The next
    /// frame asks for another instead. Answers the numbers of those plans.
    ///
    /// # Errors
    /// What of the timeline makes no sense.
    pub(super) fn wake(&mut self, joints: usize) -> Result<Option<u64>, String> {
        self.buffer.check(joints)?;
        let cursor = self.buffer.first() * SUB..=self.buffer.last() * SUB;
        if !cursor.contains(&self.cursor) {
            return Err(format!("its cursor is at {}, outside of {cursor:?}", self.cursor));
        }
        self.replaced = None;
        let Some(Flight {
            ticket,
            arrived: false,
            ..
        }) = self.flight
        else {
            return Ok(None);
        };
        self.give_up(ticket);
        Ok(Some(ticket.number))
    }

    /// Moves the cursor on to `frame`, for which the buffer is drawn out, with time for a plan
    /// behind it, where it is not so long.
    pub(super) fn reach_for(&mut self, frame: i64) -> u32 {
        self.forget_before();
        self.buffer.draw_out(frame + self.look_ahead + MARGIN_FRAMES);
        self.pace = FULL_PACE;
        (frame * SUB - self.cursor).max(0) as u32
    }

    /// What is to be shown at the cursor's frame and behind it changes.
    pub(super) fn rejoin(&mut self, seam: &Seam) {
        self.forget_before();
        self.buffer.rejoin(self.cursor / SUB, seam);
        self.rejoined = true;
        self.command_changed = true;
    }
}

#[cfg(test)]
#[path = "timeline_tests.rs"]
mod tests;

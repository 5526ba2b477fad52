//! The cursor: how far a character has come on its timeline, and how fast it goes on.
//!
//! It counts in sub-frames ([`SUB_FRAMES`] a frame). It moves at full pace unless the character
//! lacks a plan: then it slows down with what is left of the buffer, so that motion comes to rest
//! instead of stopping short.

use serde::{Deserialize, Serialize};

use super::super::SUB_FRAMES;
use super::super::policy::MARGIN_FRAMES;

/// Sub-frames a frame, as the cursor counts.
pub(super) const SUB: i64 = SUB_FRAMES as i64;
/// Pace of a character that is not slowed down. The unit makes the pace equal to the number of
/// sub-frames that are left when the character begins to slow down.
const FULL_PACE: i64 = MARGIN_FRAMES * SUB;

/// A place on the timeline, and the step that leads away from it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Cursor {
    /// Sub-frames from frame 0.
    at: i64,
    /// Sub-frames of the current step that are still to go.
    pending: i64,
    /// 1 to [`FULL_PACE`].
    pace: i64,
    /// The pace falls because a plan is missing.
    slowing: bool,
}

impl Cursor {
    /// The cursor at frame 0.
    pub(super) fn new() -> Self {
        Self {
            at: 0,
            pending: 0,
            pace: FULL_PACE,
            slowing: false,
        }
    }

    /// Sub-frames from frame 0.
    pub(super) fn at(&self) -> i64 {
        self.at
    }

    /// The frame that the cursor has reached: rounded down.
    pub(super) fn frame(&self) -> i64 {
        self.at / SUB
    }

    /// The first frame that the cursor has not left: rounded up.
    pub(super) fn next_frame(&self) -> i64 {
        (self.at + SUB - 1) / SUB
    }

    pub(super) fn on_frame(&self) -> bool {
        self.at % SUB == 0
    }

    pub(super) fn has_reached(&self, frame: i64) -> bool {
        frame * SUB <= self.at
    }

    /// Frames from the cursor to `frame`, in fractions; negative if the cursor is beyond.
    pub(super) fn frames_to(&self, frame: i64) -> f32 {
        (frame * SUB - self.at) as f32 / SUB_FRAMES as f32
    }

    /// Whole frames from the cursor to the buffer's `last`.
    pub(super) fn frames_left(&self, last: i64) -> i64 {
        (last * SUB - self.at) / SUB
    }

    pub(super) fn is_slowing(&self) -> bool {
        self.slowing
    }

    /// Whether some of the current step is still to go.
    pub(super) fn is_moving(&self) -> bool {
        self.pending > 0
    }

    /// Makes the current step longer by `sub_frames`.
    pub(super) fn push(&mut self, sub_frames: u32) {
        self.pending += i64::from(sub_frames);
    }

    /// Moves along the current step, at most to the next frame and not beyond the buffer's `last`.
    /// With `lacks_plan` the pace falls once less than the margin is left. Answers whether slowing
    /// down began here.
    pub(super) fn go(&mut self, last: i64, lacks_plan: bool) -> bool {
        let begins = self.slow_down(last, lacks_plan);
        let step = self.pending.min(SUB);
        let way = (step * self.pace / FULL_PACE).max(1);
        let to_next = (self.frame() + 1) * SUB - self.at;
        let spent = match way <= to_next {
            true => step,
            false => (to_next * FULL_PACE / self.pace).clamp(1, step),
        };
        self.pending -= spent;
        self.at = (self.at + way.min(to_next)).min(last * SUB);
        if !self.slowing {
            // From a standstill, full pace comes back within as many frames as the margin has.
            self.pace = (self.pace + spent).min(FULL_PACE);
        }
        begins
    }

    fn slow_down(&mut self, last: i64, lacks_plan: bool) -> bool {
        let remain = last * SUB - self.at;
        let slow = lacks_plan && remain < FULL_PACE;
        let begins = slow && !self.slowing;
        if slow {
            self.pace = self.pace.min(remain).max(1);
        }
        self.slowing = slow;
        begins
    }

    /// Goes at full pace again. Answers the sub-frames from here to `frame`, at least 0.
    pub(super) fn hurry_to(&mut self, frame: i64) -> u32 {
        self.pace = FULL_PACE;
        (frame * SUB - self.at).max(0) as u32
    }

    /// Whether the cursor lies between two frames, both included.
    pub(super) fn is_within(&self, first: i64, last: i64) -> bool {
        (first * SUB..=last * SUB).contains(&self.at)
    }
}

//! How far ahead of the cursor plans take over: the session's look-ahead, and what the load adds.

use serde::{Deserialize, Serialize};

use super::super::policy::Policy;

/// Frames from the cursor to where a plan for a command takes over, unless the look-ahead is
/// shorter. With the look-ahead's usual four, waiting would be half of the time that a character
/// takes to start. With one, a plan that is made within a tick would be late.
const COMMAND_AHEAD_FRAMES: i64 = 2;

/// Frames from the cursor to a splice frame. All fields are frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct LookAhead {
    /// At least 1. No plan but one for a command takes over sooner.
    least: i64,
    /// A plan asked for now is expected to take this long.
    expected: i64,
    /// Plans take this long at the moment, so they are asked for this far ahead.
    lead: i64,
    /// What `expected` was when the last plan was asked for.
    last_expected: i64,
}

impl LookAhead {
    pub(super) fn new(frames: u32) -> Self {
        Self {
            least: i64::from(frames.max(1)),
            expected: 0,
            lead: 0,
            last_expected: 0,
        }
    }

    pub(super) fn least(&self) -> i64 {
        self.least
    }

    pub(super) fn expected(&self) -> i64 {
        self.expected
    }

    pub(super) fn last_expected(&self) -> i64 {
        self.last_expected
    }

    /// Takes the load of the networks: see [`super::Timeline::expect`].
    pub(super) fn expect(&mut self, frames: u32, usually: u32) {
        self.expected = i64::from(frames);
        self.lead = i64::from(usually);
    }

    /// A plan is asked for now.
    pub(super) fn note_asked(&mut self) {
        self.last_expected = self.expected;
    }

    /// Frames to where a plan for a command takes over at the soonest. `fades`: other motion still
    /// fades out, for as long as the look-ahead.
    pub(super) fn command(&self, fades: bool) -> i64 {
        match fades {
            true => self.least,
            false => self.least.min(COMMAND_AHEAD_FRAMES),
        }
    }

    /// `frames`, or as many as a plan asked for now takes.
    pub(super) fn in_time(&self, frames: i64) -> i64 {
        frames.max(self.lead).max(self.expected + 1)
    }

    /// Frames to where a plan takes over if the queue for the networks is empty.
    pub(super) fn reach(&self, policy: Policy) -> i64 {
        let paced = policy.pace.map_or(0, |pace| i64::from(pace.lead_frames));
        (self.least + paced).max(self.lead)
    }

    /// [`LookAhead::reach`], or as many frames as a plan asked for now takes.
    pub(super) fn reach_in_time(&self, policy: Policy) -> i64 {
        self.reach(policy).max(self.expected + 1)
    }
}

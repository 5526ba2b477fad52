//! Commands by sequence number, and those that wait for their frames.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

use super::{CommandOutcome, Intent, Refusal, WaitingCommand};

/// Most commands of a session that wait for their frames, plus one to move over the ground.
pub const MAX_WAITING_COMMANDS: usize = 8;

/// Takes every command once and in order. Only the newest command to move over the ground counts.
/// All others are carried out once each, so a newer one does not replace them.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Inbox {
    last_sequence: u64,
    locomote: Option<WaitingCommand>,
    /// All but the one to move over the ground: at most [`MAX_WAITING_COMMANDS`], in the order of
    /// their numbers.
    others: Vec<WaitingCommand>,
    /// Sequence number and first frame of the command that locomotion goes by; none before the
    /// first.
    current: Option<(u64, u64)>,
}

impl Inbox {
    /// Highest sequence number of a command so far; 0 before the first.
    pub(super) fn last_sequence(&self) -> u64 {
        self.last_sequence
    }

    /// Sequence number and first frame of the command that locomotion goes by.
    pub(super) fn current(&self) -> Option<(u64, u64)> {
        self.current
    }

    /// Notes that locomotion goes by a command from `frame` on.
    pub(super) fn set_current(&mut self, sequence: u64, frame: u64) {
        self.current = Some((sequence, frame));
    }

    /// The waiting command that holds first.
    pub(super) fn waiting(&self) -> Option<&WaitingCommand> {
        let all = self.locomote.iter().chain(&self.others);
        all.min_by_key(|waiting| (waiting.frame, waiting.sequence))
    }

    /// Checks that there is room for a command.
    ///
    /// # Errors
    /// [`Refusal::TooManyCommands`] if not.
    pub(super) fn check(&self, intent: &Intent) -> Result<(), Refusal> {
        let stay = self.others.iter().filter(|waiting| !replaces(intent, waiting));
        match intent {
            intent if intent.moves() => Ok(()),
            _ if stay.count() < MAX_WAITING_COMMANDS => Ok(()),
            _ => Err(Refusal::TooManyCommands),
        }
    }

    /// Takes a command, for which there must be room, to hold from `frame` on.
    pub(super) fn offer(&mut self, sequence: u64, frame: u64, intent: Intent) -> CommandOutcome {
        let outcome = self.note(sequence);
        if outcome == CommandOutcome::Accepted {
            self.others.retain(|waiting| !replaces(&intent, waiting));
            let is_locomotion = intent.moves();
            let waiting = WaitingCommand {
                sequence,
                frame,
                intent,
            };
            match is_locomotion {
                true => self.locomote = Some(waiting),
                false => self.others.push(waiting),
            }
        }
        outcome
    }

    /// Takes the number of a command that asks for no motion. Waiting commands go on waiting.
    pub(super) fn note(&mut self, sequence: u64) -> CommandOutcome {
        match sequence.cmp(&self.last_sequence) {
            Ordering::Equal => CommandOutcome::Repeated,
            Ordering::Less => CommandOutcome::Late,
            Ordering::Greater => {
                self.last_sequence = sequence;
                CommandOutcome::Accepted
            }
        }
    }

    /// Hands over the next waiting command that holds at `frame`, in the order of their numbers.
    pub(super) fn take_due(&mut self, frame: u64) -> Option<WaitingCommand> {
        let other = (self.others.iter()).position(|waiting| waiting.frame <= frame);
        let before = other.map_or(u64::MAX, |index| self.others[index].sequence);
        let is_next = |waiting: &mut WaitingCommand| waiting.frame <= frame && waiting.sequence < before;
        let locomote = self.locomote.take_if(is_next);
        locomote.or_else(|| other.map(|index| self.others.remove(index)))
    }
}

/// Whether a waiting command to use an object or to perform gives way to `intent`: another such
/// command, or a cancel.
fn replaces(intent: &Intent, waiting: &WaitingCommand) -> bool {
    let is_done_instead = |intent: &Intent| {
        matches!(
            intent,
            Intent::Interact { .. } | Intent::Skill { .. } | Intent::Perform(_)
        )
    };
    (is_done_instead(intent) || *intent == Intent::Cancel) && is_done_instead(&waiting.intent)
}

#[cfg(test)]
#[path = "inbox_tests.rs"]
mod tests;

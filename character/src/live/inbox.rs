//! Commands by their sequence numbers, and those that wait for their frames.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

use super::{CommandOutcome, Intent, Refusal, WaitingCommand};

/// Most commands of a session that wait for their frames, beside the one to move over the ground.
pub const MAX_WAITING_COMMANDS: usize = 8;

/// Takes every command once and in order. The newest to move over the ground is all there is to say
/// about that; everything else is done once each, so none of it takes the place of another.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Inbox {
    last_sequence: u64,
    locomote: Option<WaitingCommand>,
    /// All but locomotion, at most [`MAX_WAITING_COMMANDS`], in order of their numbers.
    others: Vec<WaitingCommand>,
}

impl Inbox {
    /// Highest sequence number of a command so far.
    pub(super) fn last_sequence(&self) -> u64 {
        self.last_sequence
    }

    /// Of the commands that wait for their frames, the one that holds first.
    pub(super) fn waiting(&self) -> Option<&WaitingCommand> {
        let all = self.locomote.iter().chain(&self.others);
        all.min_by_key(|waiting| (waiting.frame, waiting.sequence))
    }

    /// Whether there is a place for a command.
    ///
    /// # Errors
    /// [`Refusal::TooManyCommands`].
    pub(super) fn check(&self, intent: &Intent) -> Result<(), Refusal> {
        let stay = self.others.iter().filter(|waiting| !replaces(intent, waiting));
        match intent {
            intent if intent.moves() => Ok(()),
            _ if stay.count() < MAX_WAITING_COMMANDS => Ok(()),
            _ => Err(Refusal::TooManyCommands),
        }
    }

    /// Takes a command that is to hold from `frame` on, for which there is a place.
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

    /// Takes the number of a command that asks for no motion. Those that wait go on waiting.
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

    /// Hands over, one a call, the commands that wait and whose frames are not after `frame`, in
    /// order of their numbers.
    pub(super) fn take_due(&mut self, frame: u64) -> Option<WaitingCommand> {
        let other = (self.others.iter()).position(|waiting| waiting.frame <= frame);
        let before = other.map_or(u64::MAX, |index| self.others[index].sequence);
        let is_next = |waiting: &mut WaitingCommand| waiting.frame <= frame && waiting.sequence < before;
        let locomote = self.locomote.take_if(is_next);
        locomote.or_else(|| other.map(|index| self.others.remove(index)))
    }
}

/// What is to be used or acted out gives way to what is to be instead, and to a cancel.
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

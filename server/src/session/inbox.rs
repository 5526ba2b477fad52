//! Commands by their sequence numbers, and the one that waits for its frame.

use std::cmp::Ordering;

use super::{CommandOutcome, Intent, WaitingCommand};

/// Takes every command once and in order; holds at most one.
#[derive(Debug, Clone, Default)]
pub(super) struct Inbox {
    last_sequence: u64,
    waiting: Option<WaitingCommand>,
}

impl Inbox {
    /// Highest sequence number of a command so far.
    pub(super) fn last_sequence(&self) -> u64 {
        self.last_sequence
    }

    /// The command that waits for its frame.
    pub(super) fn waiting(&self) -> Option<&WaitingCommand> {
        self.waiting.as_ref()
    }

    /// Takes a command that is to hold from `frame` on. It replaces one that still waits.
    pub(super) fn offer(&mut self, sequence: u64, frame: u64, intent: Intent) -> CommandOutcome {
        let outcome = self.note(sequence);
        if outcome == CommandOutcome::Accepted {
            self.waiting = Some(WaitingCommand {
                sequence,
                frame,
                intent,
            });
        }
        outcome
    }

    /// Takes the number of a command that asks for no motion. One that waits goes on waiting.
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

    /// Hands over the command that waits, if its frame is not after `frame`.
    pub(super) fn take_due(&mut self, frame: u64) -> Option<WaitingCommand> {
        self.waiting.take_if(|waiting| waiting.frame <= frame)
    }
}

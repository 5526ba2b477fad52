//! Counts of live characters, apart from those of their ticks.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use super::latencies::Latencies;

/// The server's counts of plans, summed over sessions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PlanStats {
    /// Plans for new commands.
    pub for_command: u64,
    /// Plans because a buffer ran low.
    pub for_low_buffer: u64,
    /// Plans because the interval had passed.
    pub for_interval: u64,
    /// Plans that came after the frame at which they should have taken over.
    pub late: u64,
    /// Plans that failed.
    pub failed: u64,
    /// Times that a character had to slow down because its plan was late.
    pub underruns: u64,
}

impl PlanStats {
    /// Adds the counts of one session.
    pub fn add(&mut self, of: &v1::SessionStats) {
        self.for_command += of.plans_for_command;
        self.for_low_buffer += of.plans_for_low_buffer;
        self.for_interval += of.plans_for_interval;
        self.late += of.late_plans;
        self.failed += of.failed_plans;
        self.underruns += of.underruns;
    }

    /// The difference to earlier counts.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            for_command: self.for_command.saturating_sub(before.for_command),
            for_low_buffer: self.for_low_buffer.saturating_sub(before.for_low_buffer),
            for_interval: self.for_interval.saturating_sub(before.for_interval),
            late: self.late.saturating_sub(before.late),
            failed: self.failed.saturating_sub(before.failed),
            underruns: self.underruns.saturating_sub(before.underruns),
        }
    }

    /// The number of all plans.
    pub fn plans(&self) -> u64 {
        self.for_command + self.for_low_buffer + self.for_interval
    }

    fn merge(&mut self, other: &Self) {
        self.for_command += other.for_command;
        self.for_low_buffer += other.for_low_buffer;
        self.for_interval += other.for_interval;
        self.late += other.late;
        self.failed += other.failed;
        self.underruns += other.underruns;
    }
}

/// Sentences that characters acted out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Performances {
    /// Sentences that began.
    pub started: u64,
    /// Sentences that were acted out to their end.
    pub done: u64,
    /// Sentences whose frames did not come in time.
    pub late: u64,
    /// Sentences that failed.
    pub failed: u64,
}

impl Performances {
    /// Counts an event of a session.
    pub fn note(&mut self, kind: &Kind) {
        match kind {
            Kind::Performing(_) => self.started += 1,
            Kind::Performed(end) => match end.reason.as_str() {
                "DONE" => self.done += 1,
                "LATE" => self.late += 1,
                "FAILED" => self.failed += 1,
                _ => {}
            },
            _ => {}
        }
    }

    fn merge(&mut self, other: &Self) {
        self.started += other.started;
        self.done += other.done;
        self.late += other.late;
        self.failed += other.failed;
    }
}

/// Counts of live characters in the measured time.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LiveHarvest {
    /// Number of characters.
    pub characters: u64,
    /// Number of streams, or of groups that are stepped together.
    pub streams: u64,
    /// Ticks that came more than a period late, or steps that took more than a period.
    pub late_ticks: u64,
    /// Ticks that never came.
    pub missed_ticks: u64,
    /// Frames of characters that were missing in ticks.
    pub missing_frames: u64,
    /// Frames of characters that the server had to slow down because a plan was late.
    pub slowed_frames: u64,
    /// Commands that were sent.
    pub commands: u64,
    /// Sessions that left, or commands that were refused.
    pub faults: u64,
    /// Difference between the interval of two ticks and the period.
    pub jitter: Latencies,
    /// Time in which a standing character reaches a quarter of the commanded speed, counted from
    /// the command.
    pub command_to_motion: Latencies,
    /// The server's counts of plans in the measured time.
    pub plans: PlanStats,
    /// Sentences of performers.
    #[serde(default)]
    pub performances: Performances,
}

impl LiveHarvest {
    /// Adds the characters of another process.
    pub fn merge(&mut self, other: &Self) {
        self.characters += other.characters;
        self.streams += other.streams;
        self.late_ticks += other.late_ticks;
        self.missed_ticks += other.missed_ticks;
        self.missing_frames += other.missing_frames;
        self.slowed_frames += other.slowed_frames;
        self.commands += other.commands;
        self.faults += other.faults;
        self.jitter.add(&other.jitter);
        self.command_to_motion.add(&other.command_to_motion);
        self.plans.merge(&other.plans);
        self.performances.merge(&other.performances);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn performances_are_counted_by_their_ends() {
        let end = |reason: &str| {
            Kind::Performed(v1::PerformanceEnded {
                reason: reason.to_owned(),
                ..v1::PerformanceEnded::default()
            })
        };
        let mut all = Performances::default();
        all.note(&Kind::Performing(v1::PerformanceStarted::default()));
        for reason in ["DONE", "DONE", "LATE", "FAILED", "INTERRUPTED"] {
            all.note(&end(reason));
        }
        all.note(&Kind::Done(v1::InteractionDone::default()));
        let mut sum = all;
        sum.merge(&all);
        let Performances {
            started,
            done,
            late,
            failed,
        } = sum;
        assert_eq!((started, done, late, failed), (2, 4, 2, 2));
    }
}

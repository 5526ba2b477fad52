//! Sums over what sessions have done.

use std::iter::Sum;
use std::ops::AddAssign;

use crate::v1::SessionStats;

impl SessionStats {
    /// All plans that took over.
    pub fn plans(&self) -> u64 {
        self.plans_for_command + self.plans_for_low_buffer + self.plans_for_interval + self.plans_for_object
    }
}

impl AddAssign<&SessionStats> for SessionStats {
    fn add_assign(&mut self, other: &SessionStats) {
        // All fields by name, so that the compiler finds a missing one.
        let &SessionStats {
            plans_for_command,
            plans_for_low_buffer,
            plans_for_interval,
            late_plans,
            underruns,
            failed_plans,
            events_dropped,
            plans_for_object,
        } = other;
        self.plans_for_command += plans_for_command;
        self.plans_for_low_buffer += plans_for_low_buffer;
        self.plans_for_interval += plans_for_interval;
        self.late_plans += late_plans;
        self.underruns += underruns;
        self.failed_plans += failed_plans;
        self.events_dropped += events_dropped;
        self.plans_for_object += plans_for_object;
    }
}

impl<'a> Sum<&'a SessionStats> for SessionStats {
    fn sum<I: Iterator<Item = &'a Self>>(stats: I) -> Self {
        stats.fold(Self::default(), |mut sum, stats| {
            sum += stats;
            sum
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_has_every_field() {
        let stats = SessionStats {
            plans_for_command: 1,
            plans_for_low_buffer: 2,
            plans_for_interval: 3,
            late_plans: 4,
            underruns: 5,
            failed_plans: 6,
            events_dropped: 7,
            plans_for_object: 8,
        };
        let twice = SessionStats {
            plans_for_command: 2,
            plans_for_low_buffer: 4,
            plans_for_interval: 6,
            late_plans: 8,
            underruns: 10,
            failed_plans: 12,
            events_dropped: 14,
            plans_for_object: 16,
        };
        assert_eq!([stats, stats].iter().sum::<SessionStats>(), twice);
        assert_eq!(stats.plans(), 1 + 2 + 3 + 8);
    }
}

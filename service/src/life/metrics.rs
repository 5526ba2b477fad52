//! Metrics of packs that come and go.

use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Telemetry};

const CHANGES: Metric = Metric::new(
    "troupe_pack_changes_total",
    "Calls to load, unload or swap a pack, by change and by result: done, unchanged (it was so already) or \
     refused",
);
const LEAVING: Metric = Metric::new(
    "troupe_packs_leaving",
    "Packs that are no longer served and whose networks are still in memory, for calls under way or for \
     sessions of a pack that was unloaded",
);

/// A change of the packs that a server has loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PackChange {
    /// A pack of a new name is served.
    Load,
    /// A pack is served no more.
    Unload,
    /// Another version takes the place of one.
    Swap,
}

impl PackChange {
    const ALL: [Self; 3] = [Self::Load, Self::Unload, Self::Swap];

    /// The name in metrics and in the log.
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Unload => "unload",
            Self::Swap => "swap",
        }
    }
}

/// What became of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    Done,
    Unchanged,
    Refused,
}

impl Outcome {
    const ALL: [Self; 3] = [Self::Done, Self::Unchanged, Self::Refused];

    fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Unchanged => "unchanged",
            Self::Refused => "refused",
        }
    }
}

#[derive(Debug)]
pub(super) struct LifeMetrics {
    /// By change and outcome, in the order of their discriminants.
    changes: [[Counter; Outcome::ALL.len()]; PackChange::ALL.len()],
    leaving: Gauge,
}

impl LifeMetrics {
    pub(super) fn new(telemetry: &Telemetry) -> Self {
        let none = Labels::default();
        let counter = |change: PackChange, outcome: Outcome| {
            let labels = none.with("change", change.name()).with("result", outcome.name());
            telemetry.counter(&CHANGES, &labels)
        };
        Self {
            changes: PackChange::ALL.map(|change| Outcome::ALL.map(|outcome| counter(change, outcome))),
            leaving: telemetry.gauge(&LEAVING, &none),
        }
    }

    pub(super) fn count(&self, change: PackChange, outcome: Outcome) {
        self.changes[change as usize][outcome as usize].increment(1);
    }

    /// Sets how many packs have not left the memory.
    pub(super) fn leaving(&self, packs: usize) {
        self.leaving.set(packs as f64);
    }
}

//! The figures of a run, their medians over repetitions, and bounds on them.

mod bounds;
mod build;
mod median;
#[cfg(test)]
pub(crate) mod testing;
mod types;

pub use bounds::{BoundResult, Bounds, underruns};
pub use build::{Ingredients, run};
pub use median::median;
pub use types::{
    ByPriority, ClientFigures, Counts, Figures, LiveFigures, Percentiles, Run, SecondRow, ServerFigures,
    ServerRow, Split, StageResult, StageTimes, Throughput,
};

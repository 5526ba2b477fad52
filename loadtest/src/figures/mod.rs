//! What a run comes to: its figures, their median over repetitions, and the bounds that they are to
//! keep.

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

//! Searches for the most that a server can do within bounds: characters without an underrun, or the
//! highest rate.

mod goal;
mod probe;
mod report;
mod steps;

pub use goal::{Aim, Goal};
pub use probe::search;
pub use report::{SearchReport, SearchStep};
pub use steps::{Next, Search, SearchLimits};

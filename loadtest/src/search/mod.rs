//! Searches for the highest load at which a server keeps its bounds: the number of characters
//! without an underrun, or the rate of requests.

mod goal;
mod probe;
mod report;
mod steps;

pub use goal::{Aim, Goal};
pub use probe::search;
pub use report::{SearchReport, SearchStep};
pub use steps::{Next, Search, SearchLimits};

//! Measurements of a running server and the pack that it serves.

mod crowd;
pub(crate) mod feasibility;
pub(crate) mod gaps;
pub(crate) mod live;
mod patience;
pub(crate) mod steps;
pub(crate) mod wander;
mod windows;

use std::path::Path;

use serde::Serialize;
use troupe_cli::{Failure, print};

/// Requests in flight at the same time.
const IN_FLIGHT: usize = 32;

/// Prints a report, and writes it as JSON if a file is named.
fn publish(text: &str, report: &impl Serialize, json: Option<&Path>) -> Result<(), Failure> {
    if let Some(path) = json {
        let json = serde_json::to_string_pretty(report).map_err(|e| Failure::Other(e.to_string()))?;
        std::fs::write(path, json + "\n").map_err(|e| Failure::output(path, e))?;
    }
    print(text)
}

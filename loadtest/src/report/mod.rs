//! The report of a load test: versioned JSON, a table, a page with plots, and comparisons.
//!
//! The JSON form of [`Report`] is a contract: within a [`VERSION`] fields may be added, but never
//! renamed or changed in meaning. `troupe-loadtest schema` prints its JSON Schema.

pub mod compare;
pub mod html;
mod plots;
pub mod table;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::figures::{BoundResult, Figures, Run, median};
use crate::overload::OverloadReport;
use crate::plan::{LatencyOf, Plan};
use crate::search::SearchReport;

/// Version of the report's form.
pub const VERSION: u32 = 1;

/// A load test and its results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of this form.
    pub version: u32,
    /// Label for comparisons, such as the change that is tested.
    pub label: String,
    /// Version of the load tester.
    pub tool: String,
    /// Start of the test by the clock of the load tester's machine, RFC 3339.
    pub began: String,
    /// The machine of the load tester.
    pub machine: Machine,
    /// The plan. For a search or an overload, it is the plan of a single run.
    pub plan: Plan,
    /// Start and end of a latency.
    pub latency_of: LatencyOf,
    /// The repetitions, in order.
    pub runs: Vec<Run>,
    /// The median of every figure over the repetitions.
    pub median: Figures,
    /// Steps and result of a search.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<SearchReport>,
    /// Figures of an overload.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overload: Option<OverloadReport>,
    /// Stated bounds, and whether they were kept.
    #[serde(default)]
    pub bounds: Vec<BoundResult>,
}

/// The machine of the load tester.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Machine {
    /// Number of processors that this process may use.
    pub cpus: u32,
    /// Name of the processor. Empty if the system does not report it.
    pub cpu: String,
    /// The operating system.
    pub os: String,
}

impl Report {
    /// Makes a report of the repetitions of a plan.
    pub fn new(label: String, began: std::time::SystemTime, plan: Plan, runs: Vec<Run>) -> Self {
        let figures = runs.iter().map(|run| &run.figures).collect::<Vec<_>>();
        Self {
            version: VERSION,
            label,
            tool: env!("CARGO_PKG_VERSION").to_owned(),
            began: humantime::format_rfc3339_seconds(began).to_string(),
            machine: Machine::this(),
            latency_of: plan.workload.latency_of(),
            median: median(&figures),
            plan,
            runs,
            search: None,
            overload: None,
            bounds: Vec::new(),
        }
    }

    /// Reads a report.
    ///
    /// # Errors
    /// [`Failure::Input`] if the file is not a report, or has another version.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        #[derive(Deserialize)]
        struct Head {
            version: u32,
        }
        let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
        let no_report = |e| Failure::file(path, format_args!("this is not a report of troupe-loadtest: {e}"));
        let head: Head = serde_json::from_str(&text).map_err(no_report)?;
        if head.version != VERSION {
            let version = head.version;
            return Err(Failure::file(
                path,
                format_args!("the report has version {version}; allowed: {VERSION}"),
            ));
        }
        serde_json::from_str(&text).map_err(no_report)
    }

    /// Writes the report as JSON.
    ///
    /// # Errors
    /// [`Failure::Other`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self).map_err(|e| Failure::output(path, e))?;
        std::fs::write(path, text + "\n").map_err(|e| Failure::output(path, e))
    }
}

impl Machine {
    /// The machine of this process.
    pub fn this() -> Self {
        let system = sysinfo::System::new_with_specifics(
            sysinfo::RefreshKind::nothing().with_cpu(sysinfo::CpuRefreshKind::nothing()),
        );
        let cpus = std::thread::available_parallelism().map_or(1, |n| u32::try_from(n.get()).unwrap_or(1));
        Self {
            cpus,
            cpu: system
                .cpus()
                .first()
                .map(|cpu| cpu.brand().trim().to_owned())
                .unwrap_or_default(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}

#[cfg(test)]
mod tests;

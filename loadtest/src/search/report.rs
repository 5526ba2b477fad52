//! The report of a search.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::goal::{Aim, Goal};

/// A search and its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchReport {
    /// The level that was raised.
    pub aim: Aim,
    /// The bounds that every step must meet.
    pub goal: Goal,
    /// All steps, in order.
    pub steps: Vec<SearchStep>,
    /// The highest level that met the goal every time. None: the lowest level missed it too.
    pub found: Option<f64>,
    /// Whether the search ended at its upper limit. The server may then be able to do more.
    pub at_limit: bool,
}

/// A step of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchStep {
    /// Characters, or requests a second.
    pub level: f64,
    /// Whether the step met the goal.
    pub kept: bool,
    /// Why the step missed the goal.
    pub why: Vec<String>,
    /// Whether the step was to confirm a result.
    pub confirms: bool,
    /// 99th percentile of latencies, milliseconds.
    pub p99_ms: f64,
    /// Characters slowed and frames missed.
    pub underruns: f64,
    /// Right answers a second.
    pub right_per_s: f64,
}

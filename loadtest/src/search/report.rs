//! The report of a search.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::goal::{Aim, Goal};

/// A search and its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchReport {
    /// The level that was raised.
    pub aim: Aim,
    /// Bounds of each step.
    pub goal: Goal,
    /// Each step, in order.
    pub steps: Vec<SearchStep>,
    /// The highest level that met the goal every time. None: not even the lowest did.
    pub found: Option<f64>,
    /// Whether the search ended at its upper limit, so that the server may do more.
    pub at_limit: bool,
}

/// A step of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchStep {
    /// Characters, or requests a second.
    pub level: f64,
    /// Whether it met the goal.
    pub kept: bool,
    /// Why it missed the goal.
    pub why: Vec<String>,
    /// Whether it confirmed a result.
    pub confirms: bool,
    /// 99th percentile of latencies, milliseconds.
    pub p99_ms: f64,
    /// Characters slowed and frames missed.
    pub underruns: f64,
    /// Right answers a second.
    pub right_per_s: f64,
}

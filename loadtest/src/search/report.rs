//! What a search found.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::goal::{Aim, Goal};

/// A search and what it found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchReport {
    /// What was looked for.
    pub aim: Aim,
    /// What each step had to keep.
    pub goal: Goal,
    /// Each step, in order.
    pub steps: Vec<SearchStep>,
    /// The most that kept the goal every time. None: not even the least did.
    pub found: Option<f64>,
    /// The search ended at its upper limit and did not find what the server cannot do.
    pub at_limit: bool,
}

/// A step of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchStep {
    /// Characters, or requests a second.
    pub level: f64,
    /// Whether it kept the goal.
    pub kept: bool,
    /// Why not, where it did not.
    pub why: Vec<String>,
    /// It was there to confirm what had been found.
    pub confirms: bool,
    /// 99 % of latencies were below, milliseconds.
    pub p99_ms: f64,
    /// Characters slowed and frames missed.
    pub underruns: f64,
    /// Right answers a second.
    pub right_per_s: f64,
}

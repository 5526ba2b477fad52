//! Counts of answers.

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tokio::time::Instant;

use super::latencies::Latencies;
use super::live::LiveHarvest;
use super::process::OwnUse;
use super::split::{ServerTiming, TimingSums};

/// Outcome of a request.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A right answer.
    Right(Answer),
    /// The server had no room: `RESOURCE_EXHAUSTED`, 429, 503.
    Refused(Cow<'static, str>),
    /// An error of the server or the connection, or a wrong answer.
    Failed {
        /// A word for it, such as `INTERNAL` or `WRONG_FRAMES`.
        code: Cow<'static, str>,
        /// The reason as a sentence.
        message: String,
    },
}

/// A right answer.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Answer {
    /// Number of characters.
    pub characters: u32,
    /// Number of frames of all characters together.
    pub frames: u64,
    /// Size of the body, bytes.
    pub bytes: u64,
    /// The parts of the time in the server, if the answer has them.
    pub timing: Option<ServerTiming>,
}

/// A request, from the time at which it was due to its answer.
#[derive(Debug, Clone)]
pub struct Call {
    /// When the request should have been sent.
    pub due: Instant,
    /// When the request was sent.
    pub sent: Instant,
    /// When the answer was complete.
    pub done: Instant,
    /// Outcome of the request.
    pub outcome: Outcome,
}

/// Requests that were due within a certain time.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Right answers.
    pub right: u64,
    /// Refusals.
    pub refused: u64,
    /// Failures.
    pub failed: u64,
    /// Requests that this client dropped, because too many were in flight.
    pub dropped: u64,
    /// Latencies of the right answers.
    pub latency: Latencies,
}

/// Answers of one second, by the time of the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Second {
    /// Right answers, or ticks.
    pub right: u64,
    /// Refusals.
    pub refused: u64,
    /// Failures.
    pub failed: u64,
    /// Requests that this client dropped.
    pub dropped: u64,
    /// Characters in right answers.
    pub characters: u64,
    /// Frames in right answers.
    pub frames: u64,
    /// Frames of characters that slowed down because a plan was late.
    pub underruns: u64,
    /// Maximum number of requests in flight.
    pub in_flight: u64,
    /// Latencies of right answers, with an error of at most 1 %.
    pub latency: Latencies,
}

/// Outcomes of requests that were due in a tenth of a second.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FineBin {
    /// Latencies of right answers, microseconds.
    pub latencies_us: Vec<u32>,
    /// Refusals, failures and drops.
    pub other: u32,
}

impl FineBin {
    /// A quantile of the latencies, such as 0.99, in milliseconds. 0 without an answer.
    pub fn quantile_ms(&self, quantile: f64) -> f64 {
        let mut sorted = self.latencies_us.clone();
        sorted.sort_unstable();
        let place = (sorted.len() as f64 * quantile).ceil() as usize;
        sorted
            .get(place.saturating_sub(1))
            .map_or(0.0, |&us| f64::from(us) / 1e3)
    }

    fn merge(&mut self, other: &Self) {
        self.latencies_us.extend(&other.latencies_us);
        self.other += other.other;
    }
}

/// Sums over the right answers that came within the measured time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Done {
    /// Answers, or ticks.
    pub requests: u64,
    /// Characters in the answers.
    pub characters: u64,
    /// Frames in the answers.
    pub frames: u64,
    /// Size of the answers' bodies, bytes.
    pub bytes: u64,
}

/// All counts of a run in one process. Those of several processes are merged.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Harvest {
    /// Requests that were due within the measured time.
    pub total: Tally,
    /// Requests that were due within each stage of the load.
    pub stages: Vec<Tally>,
    /// Right answers that came within the measured time.
    pub done: Done,
    /// Each second from the start of the load, warm-up included.
    pub seconds: Vec<Second>,
    /// Outcomes by tenths of a second from the start of the load, if the plan asks for them.
    pub fine: Vec<FineBin>,
    /// Refusals and failures by their codes.
    pub codes: BTreeMap<String, u64>,
    /// One message for each code.
    pub examples: BTreeMap<String, String>,
    /// Times from when a request was due to its sending.
    pub send_lag: Latencies,
    /// Requests that were sent more than a millisecond after they were due.
    pub late_sends: u64,
    /// Sum over right answers of the time from sending to the answer, microseconds.
    pub on_the_way_us: u64,
    /// The parts of the time in the server.
    pub timing: TimingSums,
    /// Answers that were fully decoded and checked.
    pub verified: u64,
    /// Counts of live characters, if the load has any.
    pub live: Option<LiveHarvest>,
    /// Resources of the client.
    pub own: OwnUse,
}

impl Default for Second {
    fn default() -> Self {
        Self {
            right: 0,
            refused: 0,
            failed: 0,
            dropped: 0,
            characters: 0,
            frames: 0,
            underruns: 0,
            in_flight: 0,
            latency: Latencies::coarse(),
        }
    }
}

impl Tally {
    /// Counts the outcome of a request.
    pub fn note(&mut self, call: &Call) {
        match &call.outcome {
            Outcome::Right(_) => {
                self.right += 1;
                self.latency.record(call.done.saturating_duration_since(call.due));
            }
            Outcome::Refused(_) => self.refused += 1,
            Outcome::Failed { .. } => self.failed += 1,
        }
    }

    /// Number of requests that were due.
    pub fn due(&self) -> u64 {
        self.right + self.refused + self.failed + self.dropped
    }

    fn merge(&mut self, other: &Self) {
        self.right += other.right;
        self.refused += other.refused;
        self.failed += other.failed;
        self.dropped += other.dropped;
        self.latency.add(&other.latency);
    }
}

impl Second {
    /// Counts the outcome of a request.
    pub fn note(&mut self, call: &Call) {
        match &call.outcome {
            Outcome::Right(answer) => {
                self.right += 1;
                self.characters += u64::from(answer.characters);
                self.frames += answer.frames;
                self.latency.record(call.done.saturating_duration_since(call.due));
            }
            Outcome::Refused(_) => self.refused += 1,
            Outcome::Failed { .. } => self.failed += 1,
        }
    }

    /// Adds the same second of another process, or another second.
    pub fn merge(&mut self, other: &Self) {
        self.right += other.right;
        self.refused += other.refused;
        self.failed += other.failed;
        self.dropped += other.dropped;
        self.characters += other.characters;
        self.frames += other.frames;
        self.underruns += other.underruns;
        self.in_flight += other.in_flight;
        self.latency.add(&other.latency);
    }
}

impl Harvest {
    /// Adds the counts of another process of the same load.
    pub fn merge(&mut self, other: &Self) {
        self.total.merge(&other.total);
        if self.stages.len() < other.stages.len() {
            self.stages.resize_with(other.stages.len(), Tally::default);
        }
        self.stages
            .iter_mut()
            .zip(&other.stages)
            .for_each(|(a, b)| a.merge(b));
        if self.seconds.len() < other.seconds.len() {
            self.seconds.resize_with(other.seconds.len(), Second::default);
        }
        self.seconds
            .iter_mut()
            .zip(&other.seconds)
            .for_each(|(a, b)| a.merge(b));
        if self.fine.len() < other.fine.len() {
            self.fine.resize_with(other.fine.len(), FineBin::default);
        }
        self.fine
            .iter_mut()
            .zip(&other.fine)
            .for_each(|(a, b)| a.merge(b));
        self.done.requests += other.done.requests;
        self.done.characters += other.done.characters;
        self.done.frames += other.done.frames;
        self.done.bytes += other.done.bytes;
        for (code, count) in &other.codes {
            *self.codes.entry(code.clone()).or_default() += count;
        }
        for (code, message) in &other.examples {
            self.examples
                .entry(code.clone())
                .or_insert_with(|| message.clone());
        }
        self.send_lag.add(&other.send_lag);
        self.late_sends += other.late_sends;
        self.on_the_way_us += other.on_the_way_us;
        self.timing.merge(&other.timing);
        self.verified += other.verified;
        match (&mut self.live, &other.live) {
            (Some(live), Some(other)) => live.merge(other),
            (live @ None, Some(other)) => *live = Some(other.clone()),
            _ => {}
        }
        self.own.merge(&other.own);
    }
}

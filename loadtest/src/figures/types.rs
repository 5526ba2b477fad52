//! The figures of a run. Their JSON form is part of the report's contract.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::measure::{FineBin, Latencies, Performances, PlanStats};

/// One repetition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Figures over the measured time.
    #[serde(flatten)]
    pub figures: Figures,
    /// The server's engine, if it reports it.
    #[serde(default)]
    pub engine: String,
    /// Refusals and failures by their codes.
    pub codes: BTreeMap<String, u64>,
    /// A message of each code.
    pub examples: BTreeMap<String, String>,
    /// The stages of the load, if it has several.
    pub stages: Vec<StageResult>,
    /// Second by second, warm-up included.
    pub series: Vec<SecondRow>,
    /// The server's own figures, scrape by scrape.
    pub server_series: Vec<ServerRow>,
    /// Batches by their size: upper bounds of buckets, and how many batches.
    pub batch_sizes: Vec<(u32, u64)>,
    /// All latencies of the measured time.
    pub latencies: Latencies,
    /// Counts by tenths of a second, which other figures come from.
    #[serde(skip)]
    pub fine: Vec<FineBin>,
}

/// The figures of a repetition. They cover the measured time, unless they say otherwise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// The measured time, seconds.
    pub measured_s: f64,
    /// Requests that were due in it: ticks of live characters, or steps of a step workload.
    pub counts: Counts,
    /// Right answers that came in it.
    pub throughput: Throughput,
    /// Latencies of right answers, milliseconds.
    pub latency_ms: Percentiles,
    /// Time from when a request was due to its sending, milliseconds: the backlog at the client. If
    /// it is not small, the client was too slow.
    pub send_lag_ms: Percentiles,
    /// Requests that were sent more than a millisecond after they were due.
    pub late_sends: u64,
    /// Most requests in flight.
    pub in_flight_max: u64,
    /// Answers that were decoded and checked whole.
    pub verified: u64,
    /// Resources of the load tester.
    pub client: ClientFigures,
    /// The mean latency by its parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_ms: Option<Split>,
    /// Figures from the server's metrics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub server: Option<ServerFigures>,
    /// Figures of live characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub live: Option<LiveFigures>,
}

/// Requests by their outcome.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Counts {
    /// Right answers.
    pub right: u64,
    /// Refused, because the server had no room.
    pub refused: u64,
    /// Failed in another way.
    pub failed: u64,
    /// Never sent, because too many were in flight.
    pub dropped: u64,
}

/// Right answers in time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Throughput {
    /// Answers, ticks or steps a second.
    pub requests_per_s: f64,
    /// Characters a second.
    pub characters_per_s: f64,
    /// Frames of characters a second.
    pub frames_per_s: f64,
    /// Bytes of answers a second.
    pub bytes_per_s: f64,
}

/// A distribution of times, milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[allow(missing_docs)]
pub struct Percentiles {
    pub mean: f64,
    pub p50: f64,
    pub p90: f64,
    pub p95: f64,
    pub p99: f64,
    pub p99_9: f64,
    pub p99_99: f64,
    pub max: f64,
}

/// The mean latency of a request by its parts, milliseconds. They add up to it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Split {
    /// Waited at this client to be sent.
    pub client: f64,
    /// Network and transport: encoding and decoding at both ends included.
    pub transport: f64,
    /// In the server, apart from the parts below: checking, preparing and finishing.
    pub server_other: f64,
    /// In the server's queue.
    pub queue: f64,
    /// Filling the batch's tensors.
    pub assemble: f64,
    /// In the networks.
    pub inference: f64,
    /// Making frames from the batch's tensors.
    pub scatter: f64,
}

/// Resources of the load tester, all of its processes together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClientFigures {
    /// Processor time, seconds.
    pub cpu_s: f64,
    /// Processor time a second: the number of processors that it kept busy.
    pub cpus_busy: f64,
    /// Most memory, bytes.
    pub peak_rss_bytes: u64,
    /// Processes.
    pub processes: u32,
}

/// Figures from the server's metrics over the measured time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ServerFigures {
    /// Processor time, seconds. The server counts whole seconds.
    pub cpu_s: f64,
    /// Processor time a second: the number of processors that it kept busy.
    pub cpus_busy: f64,
    /// Resident memory before the load, bytes.
    pub rss_before_bytes: u64,
    /// Resident memory at the end, bytes.
    pub rss_end_bytes: u64,
    /// Most resident memory at a scrape, bytes.
    pub rss_peak_bytes: u64,
    /// Growth of memory for each live or idle character since before they were opened, bytes.
    pub rss_per_session_bytes: f64,
    /// Time from a request's arrival to its answer in the server, milliseconds.
    pub request_ms: f64,
    /// Mean wait in the queue, milliseconds.
    pub queue_ms: f64,
    /// Batches.
    pub batches: f64,
    /// Mean characters of a batch.
    pub batch_mean: f64,
    /// Mean share of padding in a batch.
    pub padding: f64,
    /// Mean time of a batch in each stage, milliseconds.
    pub stage_ms: StageTimes,
    /// Workers of the engine, each of which runs one batch at a time; 0 if the server does not
    /// report it.
    pub workers: f64,
    /// Mean number of busy workers: time in networks, of filling and of reading tensors, over time.
    pub busy_workers: f64,
    /// Requests refused or dropped before they ran.
    pub rejections: f64,
    /// Frames generated a second, those of plans included.
    pub frames_generated_per_s: f64,
    /// Plans asked for a second.
    pub replans_per_s: f64,
    /// Times that a character had to slow down because its plan was late.
    pub underruns: f64,
    /// Plans that came late.
    pub late_plans: f64,
    /// Highest pressure on the crowd's budget, if the server reports it.
    pub pressure_max: f64,
    /// Mean frames between plans, by the priority of characters.
    #[serde(default)]
    pub plan_interval_frames: ByPriority,
}

/// A figure by the priority of characters; 0 without characters of that priority.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ByPriority {
    /// Below a third.
    pub low: f64,
    /// Between.
    pub middle: f64,
    /// Above two thirds.
    pub high: f64,
}

/// Mean times of a batch, milliseconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageTimes {
    /// Filling tensors.
    pub assemble: f64,
    /// The root module.
    pub root: f64,
    /// The pose module.
    pub pose: f64,
    /// The decoder network.
    pub decoder: f64,
    /// Copying out of tensors.
    pub scatter: f64,
}

/// Counts of live characters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LiveFigures {
    /// Characters.
    pub characters: u64,
    /// Streams, or groups that are stepped together.
    pub streams: u64,
    /// Ticks later than a period, or steps that took longer.
    pub late_ticks: u64,
    /// Ticks that the server did not send, or that never came.
    pub missed_ticks: u64,
    /// Frames of characters that ticks did not hold.
    pub missing_frames: u64,
    /// Frames of characters that the server had to slow down because a plan was late.
    pub slowed_frames: u64,
    /// Commands that were sent.
    pub commands: u64,
    /// Sessions that were lost, and commands that were refused.
    pub faults: u64,
    /// Difference between the time from tick to tick and a period, milliseconds.
    pub jitter_ms: Percentiles,
    /// Time from a command to go, for a standing character, until it reaches a quarter of the
    /// commanded speed, milliseconds.
    pub command_to_motion_ms: Percentiles,
    /// Number of such starts.
    pub command_to_motion_count: u64,
    /// The server's counts of the sessions.
    pub plans: PlanStats,
    /// Sentences of performers.
    #[serde(default)]
    pub performances: Performances,
    /// Plans a second and character.
    pub plans_per_s_and_character: f64,
}

/// A stage of the load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageResult {
    /// The stage as in the options.
    pub stage: String,
    /// Length, seconds.
    pub seconds: f64,
    /// Outcomes of the requests that were due in it.
    pub counts: Counts,
    /// Right answers to them, a second.
    pub right_per_s: f64,
    /// Their latencies, milliseconds.
    pub latency_ms: Percentiles,
}

/// A second of the load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SecondRow {
    /// Start of this second, in seconds from the end of the warm-up. It is below 0 before that.
    pub t: f64,
    /// Right answers that came in it.
    pub right: u64,
    /// Refusals.
    pub refused: u64,
    /// Failures.
    pub failed: u64,
    /// Client-side drops.
    pub dropped: u64,
    /// Characters in right answers.
    pub characters: u64,
    /// Frames in right answers.
    pub frames: u64,
    /// Frames of characters that were slowed because a plan was late.
    pub slowed: u64,
    /// Most requests in flight.
    pub in_flight: u64,
    /// Latencies, milliseconds.
    pub p50_ms: f64,
    /// Latencies, milliseconds.
    pub p99_ms: f64,
    /// Latencies, milliseconds.
    pub max_ms: f64,
}

/// The server at a scrape.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ServerRow {
    /// Seconds from the end of the warm-up; below 0 before that.
    pub t: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
    /// Processors that it kept busy in the last 5 s. It counts processor time in whole seconds.
    pub cpus: f64,
    /// Characters that wait for a batch.
    pub pending_characters: f64,
    /// Mean size of a batch in the last 5 s.
    pub batch_mean: f64,
    /// Open sessions.
    pub sessions: f64,
    /// Resident memory of this client, bytes.
    pub client_rss_bytes: u64,
    /// Processors that this client kept busy in the last 5 s.
    pub client_cpus: f64,
}

impl From<&Latencies> for Percentiles {
    fn from(of: &Latencies) -> Self {
        Self {
            mean: of.mean_ms(),
            p50: of.quantile_ms(0.5),
            p90: of.quantile_ms(0.9),
            p95: of.quantile_ms(0.95),
            p99: of.quantile_ms(0.99),
            p99_9: of.quantile_ms(0.999),
            p99_99: of.quantile_ms(0.9999),
            max: of.max_ms(),
        }
    }
}

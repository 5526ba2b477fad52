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
    /// One message for each code.
    pub examples: BTreeMap<String, String>,
    /// The stages of the load, if it has several.
    pub stages: Vec<StageResult>,
    /// Second by second, warm-up included.
    pub series: Vec<SecondRow>,
    /// Figures from the server's metrics, scrape by scrape.
    pub server_series: Vec<ServerRow>,
    /// Batches by size: pairs of a bucket's upper bound and its number of batches.
    pub batch_sizes: Vec<(u32, u64)>,
    /// All latencies of the measured time.
    pub latencies: Latencies,
    /// Outcomes by tenths of a second, from which the recovery time is computed.
    #[serde(skip)]
    pub fine: Vec<FineBin>,
}

/// The figures of a repetition. They cover the measured time, unless they say otherwise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// The measured time, seconds.
    pub measured_s: f64,
    /// Requests that were due in the measured time. For live characters, these are ticks or steps.
    pub counts: Counts,
    /// Right answers that came in the measured time.
    pub throughput: Throughput,
    /// Latencies of right answers, milliseconds.
    pub latency_ms: Percentiles,
    /// Time from when a request was due to its sending, milliseconds. Large values mean that the
    /// client was too slow.
    pub send_lag_ms: Percentiles,
    /// Requests that were sent more than a millisecond after they were due.
    pub late_sends: u64,
    /// Maximum number of requests in flight.
    pub in_flight_max: u64,
    /// Answers that were fully decoded and checked.
    pub verified: u64,
    /// Resources of the load tester.
    pub client: ClientFigures,
    /// The parts of the mean latency.
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

/// Rates of right answers.
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

/// The parts of the mean latency of a request, milliseconds. Their sum is the mean latency.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Split {
    /// Wait at this client before sending.
    pub client: f64,
    /// Network and transport, including encoding and decoding at both ends.
    pub transport: f64,
    /// In the server, apart from the parts below: checks, preparation and completion.
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
    /// Processor time per second, which is the number of busy processors.
    pub cpus_busy: f64,
    /// Peak resident memory, bytes.
    pub peak_rss_bytes: u64,
    /// Number of processes.
    pub processes: u32,
}

/// Figures from the server's metrics over the measured time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ServerFigures {
    /// Processor time, seconds. The server counts whole seconds.
    pub cpu_s: f64,
    /// Processor time per second, which is the number of busy processors.
    pub cpus_busy: f64,
    /// Resident memory before the load, bytes.
    pub rss_before_bytes: u64,
    /// Resident memory at the end, bytes.
    pub rss_end_bytes: u64,
    /// Peak of resident memory over all scrapes, bytes.
    pub rss_peak_bytes: u64,
    /// Growth of resident memory per session, from before the sessions were opened, bytes.
    pub rss_per_session_bytes: f64,
    /// Time from a request's arrival to its answer in the server, milliseconds.
    pub request_ms: f64,
    /// Mean wait in the queue, milliseconds.
    pub queue_ms: f64,
    /// Number of batches.
    pub batches: f64,
    /// Mean number of characters in a batch.
    pub batch_mean: f64,
    /// Mean share of padding in a batch.
    pub padding: f64,
    /// Mean time of a batch in each stage, milliseconds.
    pub stage_ms: StageTimes,
    /// Number of the engine's workers. A worker runs one batch at a time. 0 if the server does not
    /// report it.
    pub workers: f64,
    /// Mean number of busy workers: the time of assembling, inference and scatter, divided by the
    /// measured time.
    pub busy_workers: f64,
    /// Requests refused or dropped before they ran.
    pub rejections: f64,
    /// Frames generated a second, including those of plans.
    pub frames_generated_per_s: f64,
    /// Plans requested a second.
    pub replans_per_s: f64,
    /// Times that a character had to slow down because its plan was late.
    pub underruns: f64,
    /// Plans that came late.
    pub late_plans: f64,
    /// Maximum stretch of plan intervals under load, 0 to 2. 0 if the server does not report it.
    pub pressure_max: f64,
    /// Mean number of frames between plans, by the priority of characters.
    #[serde(default)]
    pub plan_interval_frames: ByPriority,
}

/// A figure by the priority of characters. 0 without characters of that priority.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ByPriority {
    /// Priority below 1/3.
    pub low: f64,
    /// Priority from 1/3 to 2/3.
    pub middle: f64,
    /// Priority of 2/3 and above.
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
    /// Number of characters.
    pub characters: u64,
    /// Number of streams, or of groups that are stepped together.
    pub streams: u64,
    /// Ticks that came more than a period late, or steps that took more than a period.
    pub late_ticks: u64,
    /// Ticks that never came.
    pub missed_ticks: u64,
    /// Frames of characters that were missing in ticks.
    pub missing_frames: u64,
    /// Frames of characters that the server had to slow down because a plan was late.
    pub slowed_frames: u64,
    /// Commands that were sent.
    pub commands: u64,
    /// Sessions that were lost, and commands that were refused.
    pub faults: u64,
    /// Difference between the interval of two ticks and the period, milliseconds.
    pub jitter_ms: Percentiles,
    /// Time in which a standing character reaches a quarter of the commanded speed, counted from
    /// the command, milliseconds.
    pub command_to_motion_ms: Percentiles,
    /// Number of times in `command_to_motion_ms`.
    pub command_to_motion_count: u64,
    /// Counts of plans from the server's sessions.
    pub plans: PlanStats,
    /// Sentences of performers.
    #[serde(default)]
    pub performances: Performances,
    /// Plans per second and character.
    pub plans_per_s_and_character: f64,
}

/// A stage of the load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageResult {
    /// The stage, in the form of the options.
    pub stage: String,
    /// Length, seconds.
    pub seconds: f64,
    /// Outcomes of the requests that were due in the stage.
    pub counts: Counts,
    /// Right answers to these requests, a second.
    pub right_per_s: f64,
    /// Latencies of these answers, milliseconds.
    pub latency_ms: Percentiles,
}

/// A second of the load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SecondRow {
    /// Start of this second, in seconds from the end of the warm-up. It is negative during the
    /// warm-up.
    pub t: f64,
    /// Right answers that came in this second.
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
    /// Frames of characters that were slowed because a plan was late.
    pub slowed: u64,
    /// Maximum number of requests in flight.
    pub in_flight: u64,
    /// Median of latencies, milliseconds.
    pub p50_ms: f64,
    /// 99th percentile of latencies, milliseconds.
    pub p99_ms: f64,
    /// Maximum of latencies, milliseconds.
    pub max_ms: f64,
}

/// The server at a scrape.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ServerRow {
    /// Seconds from the end of the warm-up. It is negative during the warm-up.
    pub t: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
    /// Processors that the server kept busy in the last 5 s. It counts processor time in whole
    /// seconds.
    pub cpus: f64,
    /// Characters that wait for a batch.
    pub pending_characters: f64,
    /// Mean number of characters in a batch in the last 5 s.
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

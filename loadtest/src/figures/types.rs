//! The figures of a run. Their JSON form is part of the report's contract.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::measure::{FineBin, Latencies, Performances, PlanStats};

/// One repetition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// What it comes to.
    #[serde(flatten)]
    pub figures: Figures,
    /// The server's engine, where it tells it.
    #[serde(default)]
    pub engine: String,
    /// Refusals and failures by their codes.
    pub codes: BTreeMap<String, u64>,
    /// A message of each code.
    pub examples: BTreeMap<String, String>,
    /// The stages of the load, where it has several.
    pub stages: Vec<StageResult>,
    /// Second by second, warm-up included.
    pub series: Vec<SecondRow>,
    /// The server's own figures, scrape by scrape.
    pub server_series: Vec<ServerRow>,
    /// Batches by their size: upper bounds of buckets, and how many batches.
    pub batch_sizes: Vec<(u32, u64)>,
    /// All latencies of the measured time.
    pub latencies: Latencies,
    /// By tenths of a second, for what is worked out before the report is written.
    #[serde(skip)]
    pub fine: Vec<FineBin>,
}

/// What a repetition comes to. Where nothing else is said, of the measured time alone.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// The measured time, seconds.
    pub measured_s: f64,
    /// Requests that were due in it; of live characters ticks, of a step workload steps.
    pub counts: Counts,
    /// Right answers that came in it.
    pub throughput: Throughput,
    /// Latencies of right answers, milliseconds.
    pub latency_ms: Percentiles,
    /// From when requests were due to their sending, milliseconds: the backlog at the client. Where
    /// this is not small, the client was what was slow.
    pub send_lag_ms: Percentiles,
    /// Requests that were sent more than a millisecond after they were due.
    pub late_sends: u64,
    /// Most requests on their way at once.
    pub in_flight_max: u64,
    /// Answers that were decoded and checked whole.
    pub verified: u64,
    /// What the load tester itself used.
    pub client: ClientFigures,
    /// Where the mean latency went.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_ms: Option<Split>,
    /// What the server's metrics say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub server: Option<ServerFigures>,
    /// Of live characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub live: Option<LiveFigures>,
}

/// What came of requests.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Counts {
    /// Right answers.
    pub right: u64,
    /// The server said that it has no room.
    pub refused: u64,
    /// Anything else.
    pub failed: u64,
    /// Never sent: too many were on their way.
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

/// Where the mean latency of a request went, milliseconds; the parts add up to it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Split {
    /// Waited at this client to be sent.
    pub client: f64,
    /// Network and transport: encoding and decoding at both ends included.
    pub transport: f64,
    /// In the server, outside of all that follows: checking, preparing and finishing.
    pub server_other: f64,
    /// In the server's queue.
    pub queue: f64,
    /// Filling the batch's tensors.
    pub assemble: f64,
    /// In the networks.
    pub inference: f64,
    /// Making frames of the batch's tensors.
    pub scatter: f64,
}

/// What the load tester itself used, all of its processes together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClientFigures {
    /// Processor time, seconds.
    pub cpu_s: f64,
    /// Of that, a second: how many processors it kept busy.
    pub cpus_busy: f64,
    /// Most memory, bytes.
    pub peak_rss_bytes: u64,
    /// Processes.
    pub processes: u32,
}

/// What the server's metrics say of the measured time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ServerFigures {
    /// Processor time, seconds; the server counts whole ones.
    pub cpu_s: f64,
    /// Of that, a second: how many processors it kept busy.
    pub cpus_busy: f64,
    /// Resident memory before this load tester did anything, bytes.
    pub rss_before_bytes: u64,
    /// At the end.
    pub rss_end_bytes: u64,
    /// The most at a scrape.
    pub rss_peak_bytes: u64,
    /// Of live and idle characters: what memory has grown since before they were opened, for each.
    pub rss_per_session_bytes: f64,
    /// From a request's arrival to its answer, by the server's count, milliseconds.
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
    /// Workers of the engine, each of which runs one batch at a time; 0 where the server does not
    /// tell it.
    pub workers: f64,
    /// How many of them were busy in the mean: time in the networks, in tensors and out of them,
    /// over time.
    pub busy_workers: f64,
    /// Requests turned away or dropped before they ran.
    pub rejections: f64,
    /// Frames generated a second, those of plans included.
    pub frames_generated_per_s: f64,
    /// Plans asked for a second.
    pub replans_per_s: f64,
    /// Times that a character had to slow down because its plan was late.
    pub underruns: f64,
    /// Plans that came late.
    pub late_plans: f64,
    /// Highest pressure on the crowd's budget, where the server tells it.
    pub pressure_max: f64,
    /// Mean frames between plans, by the priority of characters.
    #[serde(default)]
    pub plan_interval_frames: ByPriority,
}

/// A figure by the priority of characters; 0 where there are none.
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
    /// The decoder.
    pub decoder: f64,
    /// Copying out of tensors.
    pub scatter: f64,
}

/// What is counted of live characters.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LiveFigures {
    /// Characters.
    pub characters: u64,
    /// Streams, or groups that are stepped together.
    pub streams: u64,
    /// Ticks later than a period; steps that took longer than one.
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
    /// How far the time between two ticks is from a period, milliseconds.
    pub jitter_ms: Percentiles,
    /// From a command to go, given to one who stands, until a quarter of the commanded speed is
    /// reached, milliseconds.
    pub command_to_motion_ms: Percentiles,
    /// How many times that was seen.
    pub command_to_motion_count: u64,
    /// What the sessions did, by the server's count.
    pub plans: PlanStats,
    /// Sentences that they acted out.
    #[serde(default)]
    pub performances: Performances,
    /// Plans a second and character.
    pub plans_per_s_and_character: f64,
}

/// A stage of the load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageResult {
    /// The stage, as it was given.
    pub stage: String,
    /// How long it was, seconds.
    pub seconds: f64,
    /// What came of the requests that were due in it.
    pub counts: Counts,
    /// Right answers of those, a second.
    pub right_per_s: f64,
    /// Their latencies, milliseconds.
    pub latency_ms: Percentiles,
}

/// A second of the load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SecondRow {
    /// Seconds from the end of the warm-up to the begin of this one; below 0 while it warms up.
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
    /// Most requests on their way at once.
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
    /// Seconds from the end of the warm-up; below 0 while it warms up.
    pub t: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
    /// Processors that it kept busy in the last 5 s; it counts its processor time in whole seconds.
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

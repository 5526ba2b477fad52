//! Metrics, behind names of our own: the rest of the server speaks to [`Telemetry`] and [`PackMetrics`], never to a
//! metrics library. Every server has its own registry, so several can live in one process.

mod sessions;

use std::sync::Arc;
use std::time::Duration;

use metrics::{Counter, Gauge, Histogram, Key, Label, Level, Metadata, Recorder as _};
use metrics_exporter_prometheus::{BuildError, Matcher, PrometheusBuilder, PrometheusRecorder};

use crate::batch::Class;
use crate::batch::scheduler::BatchReason;
use troupe_engine::Decision;
use troupe_engine::generator::StepReport;
use troupe_engine::pack::Stage;

pub use sessions::{Eviction, SessionMetrics};

/// Upper bounds of the latency buckets, in seconds: they end on frame budgets (90, 60, 30 and 15 Hz among them).
const LATENCY_BUCKETS: [f64; 17] = [
    0.000_25, 0.000_5, 0.001, 0.002, 0.004, 0.008, 0.011_1, 0.016_7, 0.025, 0.033_3, 0.05, 0.066_7, 0.1, 0.2,
    0.5, 1.0, 2.5,
];
/// Upper bounds of the batch size buckets, in characters.
const BATCH_BUCKETS: [f64; 9] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0];
/// Upper bounds of the padding buckets: the share of padding rows in a batch.
const RATIO_BUCKETS: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];

const REQUESTS: &str = "troupe_requests_total";
const REQUEST_DURATION: &str = "troupe_request_duration_seconds";
const QUEUE_DURATION: &str = "troupe_queue_duration_seconds";
const ASSEMBLE_DURATION: &str = "troupe_assemble_duration_seconds";
const INFERENCE_DURATION: &str = "troupe_inference_duration_seconds";
const SCATTER_DURATION: &str = "troupe_scatter_duration_seconds";
const BATCH_SIZE: &str = "troupe_batch_size";
const PADDING_RATIO: &str = "troupe_batch_padding_ratio";
const DISPATCHES: &str = "troupe_dispatch_total";
const PENDING_REQUESTS: &str = "troupe_pending_requests";
const PENDING_CHARACTERS: &str = "troupe_pending_characters";
const REJECTIONS: &str = "troupe_rejections_total";
const FRAMES: &str = "troupe_frames_generated_total";
const LANES: &str = "troupe_engine_lanes";
const LANE_GAP: &str = "troupe_lane_gap_duration_seconds";
const LOAD_SECONDS: &str = "troupe_model_load_seconds";
const ENGINE_INFO: &str = "troupe_engine_info";
const ENGINE_DIFFERENCE: &str = "troupe_engine_difference";

const DESCRIPTIONS: [(&str, &str); 18] = [
    (REQUESTS, "Requests answered, by remote procedure and status code"),
    (REQUEST_DURATION, "From a request's arrival to its answer"),
    (
        QUEUE_DURATION,
        "From a request's arrival at the batcher to the cut of its first batch, by class: plans of live characters, or \
         InBetween calls",
    ),
    (
        ASSEMBLE_DURATION,
        "Filling a batch's input tensors, the choice of tokens included",
    ),
    (INFERENCE_DURATION, "One stage over one batch, all its passes"),
    (
        SCATTER_DURATION,
        "Copying a batch out of its tensors, and making a request's frames from that: a sample each",
    ),
    (BATCH_SIZE, "Characters in a batch, without padding"),
    (PADDING_RATIO, "Share of padding rows in a batch"),
    (
        DISPATCHES,
        "Batches formed, by reason: the worker was idle, it took what had waited, or more waited than fits",
    ),
    (PENDING_REQUESTS, "Requests that wait for a batch"),
    (PENDING_CHARACTERS, "Characters that wait for a batch"),
    (
        REJECTIONS,
        "Requests turned away or dropped before they ran, by reason: the queue was full or too slow, the caller had \
         gone, a newer plan of the character took the place, it had waited until nobody wanted the answer, or its reader \
         was too slow",
    ),
    (LANES, "Lanes of the engine that serve"),
    (
        LANE_GAP,
        "From a batch's end to the start of the next on the same lane, where work waited",
    ),
    (FRAMES, "Frames generated"),
    (LOAD_SECONDS, "Time to load a pack, its first runs included"),
    (ENGINE_INFO, "1; the labels say what runs a pack's networks"),
    (
        ENGINE_DIFFERENCE,
        "How far a checked engine is from f32 on the CPU, by figure: units are in the figure's name, shares go up to 1",
    ),
];

static METADATA: Metadata<'static> = Metadata::new(module_path!(), Level::INFO, Some(module_path!()));

/// A server's metrics registry. Clones share it.
#[derive(Clone)]
pub struct Telemetry {
    recorder: Arc<PrometheusRecorder>,
    process: Arc<metrics_process::Collector>,
}

impl Telemetry {
    /// An empty registry.
    ///
    /// # Errors
    /// Never for the buckets above; the library cannot know that.
    pub fn new() -> Result<Self, BuildError> {
        let full = |name: &str| Matcher::Full(name.to_owned());
        let recorder = PrometheusBuilder::new()
            .set_buckets_for_metric(Matcher::Suffix("_duration_seconds".to_owned()), &LATENCY_BUCKETS)?
            .set_buckets_for_metric(full(sessions::LEAD_TIME), &LATENCY_BUCKETS)?
            .set_buckets_for_metric(full(BATCH_SIZE), &BATCH_BUCKETS)?
            .set_buckets_for_metric(full(sessions::PLAN_INTERVAL), &sessions::FRAME_BUCKETS)?
            .set_buckets_for_metric(full(sessions::PLAN_LENGTH), &sessions::FRAME_BUCKETS)?
            .set_buckets_for_metric(full(PADDING_RATIO), &RATIO_BUCKETS)?
            .build_recorder();
        for (name, text) in DESCRIPTIONS.into_iter().chain(sessions::DESCRIPTIONS) {
            match name {
                _ if name.ends_with("_total") => recorder.describe_counter(name.into(), None, text.into()),
                PENDING_REQUESTS
                | PENDING_CHARACTERS
                | LANES
                | LOAD_SECONDS
                | ENGINE_INFO
                | ENGINE_DIFFERENCE
                | sessions::ACTIVE
                | sessions::STREAMS => {
                    recorder.describe_gauge(name.into(), None, text.into());
                }
                _ => recorder.describe_histogram(name.into(), None, text.into()),
            }
        }
        let process = metrics_process::Collector::default();
        metrics::with_local_recorder(&recorder, || process.describe());
        let telemetry = Self {
            recorder: Arc::new(recorder),
            process: Arc::new(process),
        };
        // The others are made with their packs; this one would be missing until the first stream.
        telemetry.streams(0);
        Ok(telemetry)
    }

    /// The registry in Prometheus' text format.
    pub fn render(&self) -> String {
        metrics::with_local_recorder(&*self.recorder, || self.process.collect());
        self.recorder.handle().render()
    }

    /// Folds recorded samples into their buckets; to be called every few seconds, or samples pile up where nobody
    /// scrapes.
    pub fn run_upkeep(&self) {
        self.recorder.handle().run_upkeep();
    }

    /// Notes an answered request.
    pub fn answered(&self, rpc: &'static str, code: &'static str, took: Duration) {
        let labels = vec![Label::new("rpc", rpc), Label::new("code", code)];
        self.recorder
            .register_counter(&Key::from_parts(REQUESTS, labels), &METADATA)
            .increment(1);
        let labels = vec![Label::new("rpc", rpc)];
        self.recorder
            .register_histogram(&Key::from_parts(REQUEST_DURATION, labels), &METADATA)
            .record(took);
    }

    /// The metrics of one pack.
    pub fn pack(&self, model: &str, version: &str) -> PackMetrics {
        let labels = |extra: Option<(&'static str, &'static str)>| -> Vec<Label> {
            let pack = [
                Label::new("model", model.to_owned()),
                Label::new("version", version.to_owned()),
            ];
            pack.into_iter()
                .chain(extra.map(|(key, value)| Label::new(key, value)))
                .collect()
        };
        let histogram = |name: &'static str, extra| {
            self.recorder
                .register_histogram(&Key::from_parts(name, labels(extra)), &METADATA)
        };
        let gauge = |name: &'static str| {
            self.recorder
                .register_gauge(&Key::from_parts(name, labels(None)), &METADATA)
        };
        PackMetrics {
            queue: Class::ALL.map(|class| histogram(QUEUE_DURATION, Some(("class", class.label())))),
            lane_gap: histogram(LANE_GAP, None),
            lanes: gauge(LANES),
            assemble: histogram(ASSEMBLE_DURATION, None),
            inference: Stage::ALL.map(|stage| {
                let name = stage.name();
                (name, histogram(INFERENCE_DURATION, Some(("stage", name))))
            }),
            scatter: histogram(SCATTER_DURATION, None),
            batch_size: histogram(BATCH_SIZE, None),
            padding_ratio: histogram(PADDING_RATIO, None),
            pending_requests: gauge(PENDING_REQUESTS),
            pending_characters: gauge(PENDING_CHARACTERS),
            load_seconds: gauge(LOAD_SECONDS),
            frames: self.counter(FRAMES, labels(None)),
            dispatches: BatchReason::ALL
                .map(|reason| self.counter(DISPATCHES, labels(Some(("reason", reason.label()))))),
            rejections: Rejection::ALL
                .map(|reason| self.counter(REJECTIONS, labels(Some(("reason", reason.label()))))),
            labels: labels(None),
            telemetry: self.clone(),
        }
    }

    fn counter(&self, name: &'static str, labels: Vec<Label>) -> Counter {
        self.recorder
            .register_counter(&Key::from_parts(name, labels), &METADATA)
    }
}

impl std::fmt::Debug for Telemetry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Telemetry")
    }
}

/// Why a request was turned away, or dropped before it ran.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rejection {
    /// The queue had no room.
    QueueFull,
    /// The queue was so slow that the request would have waited for too long.
    QueueSlow,
    /// Its caller had gone.
    ClientGone,
    /// A newer plan of the same character took its place.
    Superseded,
    /// It had waited until nobody wanted the answer.
    Expired,
    /// Its reader left too many parts of the answer waiting.
    ReaderSlow,
}

impl Rejection {
    /// All of them, in the order of their numbers.
    const ALL: [Self; 6] = [
        Self::QueueFull,
        Self::QueueSlow,
        Self::ClientGone,
        Self::Superseded,
        Self::Expired,
        Self::ReaderSlow,
    ];

    fn label(self) -> &'static str {
        match self {
            Self::QueueFull => "queue_full",
            Self::QueueSlow => "queue_slow",
            Self::ClientGone => "client_gone",
            Self::Superseded => "superseded",
            Self::Expired => "expired",
            Self::ReaderSlow => "reader_slow",
        }
    }
}

/// The metrics of one pack, labelled with its name and version.
#[derive(Clone, Debug)]
pub struct PackMetrics {
    queue: [Histogram; Class::ALL.len()],
    lane_gap: Histogram,
    lanes: Gauge,
    assemble: Histogram,
    inference: [(&'static str, Histogram); 3],
    scatter: Histogram,
    batch_size: Histogram,
    padding_ratio: Histogram,
    pending_requests: Gauge,
    pending_characters: Gauge,
    load_seconds: Gauge,
    frames: Counter,
    dispatches: [Counter; BatchReason::ALL.len()],
    rejections: [Counter; Rejection::ALL.len()],
    labels: Vec<Label>,
    telemetry: Telemetry,
}

impl PackMetrics {
    /// A request waited this long for its first batch.
    pub fn queued(&self, class: Class, waited: Duration) {
        self.queue[class as usize].record(waited);
    }

    /// A lane stood idle for so long between two batches, though work waited.
    pub fn lane_gap(&self, gap: Duration) {
        self.lane_gap.record(gap);
    }

    /// So many lanes serve.
    pub fn lanes(&self, lanes: usize) {
        self.lanes.set(lanes as f64);
    }

    /// What waits now.
    pub fn pending(&self, requests: usize, characters: usize) {
        self.pending_requests.set(requests as f64);
        self.pending_characters.set(characters as f64);
    }

    /// A batch went to the engine.
    pub fn dispatched(&self, reason: BatchReason, characters: usize) {
        self.dispatches[reason as usize].increment(1);
        self.batch_size.record(characters as f64);
    }

    /// A worker did a step.
    pub fn ran(&self, step: &StepReport) {
        self.assemble.record(step.assemble);
        self.scatter.record(step.scatter);
        for (name, took) in &step.networks {
            self.network(name).record(*took);
        }
        if step.rows > 0 {
            let padding = step.rows.saturating_sub(step.jobs);
            self.padding_ratio.record(padding as f64 / step.rows as f64);
        }
    }

    /// The histogram of a network of any family.
    fn network(&self, name: &'static str) -> Histogram {
        if let Some((_, histogram)) = self.inference.iter().find(|(known, _)| *known == name) {
            return histogram.clone();
        }
        let labels = self.labels.iter().cloned().chain([Label::new("stage", name)]);
        let key = Key::from_parts(INFERENCE_DURATION, labels.collect::<Vec<_>>());
        self.telemetry.recorder.register_histogram(&key, &METADATA)
    }

    /// A request's frames were made from what was copied out of the tensors.
    pub fn scattered(&self, took: Duration, frames: usize) {
        self.scatter.record(took);
        self.frames.increment(frames as u64);
    }

    /// Frames of a live character's plan were made.
    pub fn planned(&self, frames: usize) {
        self.frames.increment(frames as u64);
    }

    /// A request was turned away, or dropped before it ran.
    pub fn rejected(&self, reason: Rejection) {
        self.rejections[reason as usize].increment(1);
    }

    /// A worker's networks were loaded and warmed up.
    pub fn loaded(&self, took: Duration) {
        self.load_seconds.set(took.as_secs_f64());
    }

    /// The engine of the pack was chosen.
    pub fn engine_chosen(&self, decision: &Decision) {
        let gauge = |name: &'static str, extra: Vec<Label>| {
            let labels = self.labels.iter().cloned().chain(extra).collect::<Vec<_>>();
            let key = Key::from_parts(name, labels);
            self.telemetry.recorder.register_gauge(&key, &METADATA)
        };
        let Decision {
            engine, lanes, check, ..
        } = decision;
        gauge(
            ENGINE_INFO,
            vec![
                Label::new("engine", engine.name()),
                Label::new("lanes", lanes.count.to_string()),
                Label::new("threads", lanes.threads.to_string()),
            ],
        )
        .set(1.0);
        if let Some(check) = check {
            for bar in check.accuracy.bars() {
                let labels = vec![
                    Label::new("engine", check.engine.name()),
                    Label::new("figure", bar.figure),
                ];
                gauge(ENGINE_DIFFERENCE, labels).set(bar.found);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use troupe_engine::accuracy::Accuracy;
    use troupe_engine::onnx::Batching;
    use troupe_engine::{Check, EngineKind, Lanes};

    #[test]
    fn metrics_carry_names_labels_and_buckets() {
        let telemetry = Telemetry::new().unwrap();
        telemetry.answered("InBetween", "OK", Duration::from_millis(3));
        let pack = telemetry.pack("human", "1.0");
        pack.dispatched(BatchReason::Idle, 6);
        pack.ran(&StepReport {
            jobs: 6,
            rows: 8,
            networks: vec![("pose", Duration::from_millis(7))],
            scatter: Duration::from_micros(300),
            ..StepReport::default()
        });
        pack.scattered(Duration::from_micros(100), 64);
        pack.rejected(Rejection::QueueFull);
        pack.queued(Class::Live, Duration::from_millis(3));
        pack.lanes(2);
        pack.engine_chosen(&decision());
        let text = telemetry.render();
        for line in [
            r#"troupe_requests_total{rpc="InBetween",code="OK"} 1"#,
            r#"troupe_request_duration_seconds_bucket{rpc="InBetween",le="0.004"} 1"#,
            r#"troupe_inference_duration_seconds_bucket{model="human",version="1.0",stage="pose",le="0.008"} 1"#,
            r#"troupe_batch_size_sum{model="human",version="1.0"} 6"#,
            r#"troupe_batch_padding_ratio_bucket{model="human",version="1.0",le="0.3"} 1"#,
            r#"troupe_scatter_duration_seconds_bucket{model="human",version="1.0",le="0.00025"} 1"#,
            r#"troupe_scatter_duration_seconds_count{model="human",version="1.0"} 2"#,
            r#"troupe_dispatch_total{model="human",version="1.0",reason="idle"} 1"#,
            r#"troupe_rejections_total{model="human",version="1.0",reason="queue_full"} 1"#,
            r#"troupe_frames_generated_total{model="human",version="1.0"} 64"#,
            r#"troupe_rejections_total{model="human",version="1.0",reason="superseded"} 0"#,
            r#"troupe_queue_duration_seconds_bucket{model="human",version="1.0",class="live",le="0.004"} 1"#,
            r#"troupe_engine_lanes{model="human",version="1.0"} 2"#,
            r#"troupe_engine_info{model="human",version="1.0",engine="openvino-bf16",lanes="2",threads="1"} 1"#,
            r#"troupe_engine_difference{model="human",version="1.0",engine="openvino-bf16",figure="joint_mean_m"} 0.0005"#,
            "# TYPE troupe_pending_requests gauge",
            "process_resident_memory_bytes",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }

    fn decision() -> Decision {
        let accuracy = Accuracy {
            joint_mean_m: 0.0005,
            ..Accuracy::default()
        };
        let check = Check {
            engine: EngineKind::OpenvinoBf16,
            accuracy,
            passed: true,
            took: Duration::from_secs(1),
        };
        Decision {
            engine: EngineKind::OpenvinoBf16,
            lanes: Lanes { count: 2, threads: 1 },
            batching: Batching::UNKNOWN,
            why: "it is fast".into(),
            check: Some(check),
        }
    }

    #[test]
    fn registries_are_separate() {
        let (one, two) = (Telemetry::new().unwrap(), Telemetry::new().unwrap());
        one.answered("GetPack", "OK", Duration::ZERO);
        assert!(one.render().contains("GetPack") && !two.render().contains("GetPack"));
        assert!(two.render().contains("troupe_streams_active 0"));
    }
}

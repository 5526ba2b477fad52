//! Metrics of queues, batches and engines.

use std::time::{Duration, Instant};

use super::order::Class;
use super::scheduler::BatchReason;
use super::served::Served;
use super::trace::trace_served;
use troupe_base::telemetry::{Counter, Gauge, Histogram, Labels, Metric, Telemetry};
use troupe_engine::Decision;
use troupe_engine::generator::StepReport;
use troupe_engine::pack::Stage;

const QUEUE_DURATION: Metric = Metric::new(
    "troupe_queue_duration_seconds",
    "Time from a request's arrival at the batcher until its first batch is formed, by class: plans shown \
     by the clock (live), plans of Step calls (step), or other calls (request)",
);
const ASSEMBLE_DURATION: Metric = Metric::new(
    "troupe_assemble_duration_seconds",
    "Time to fill a batch's input tensors, including the choice of tokens",
);
const INFERENCE_DURATION: Metric = Metric::new(
    "troupe_inference_duration_seconds",
    "Time of all passes of one network over one batch, by stage",
);
const SCATTER_DURATION: Metric = Metric::new(
    "troupe_scatter_duration_seconds",
    "Time to copy a batch out of its tensors, and time to make a request's frames from it: one sample for \
     each",
);
const BATCH_SIZE: Metric = Metric::new("troupe_batch_size", "Characters in a batch, without padding");
const PADDING_RATIO: Metric = Metric::new("troupe_batch_padding_ratio", "Share of padding rows in a batch");
const DISPATCHES: Metric = Metric::new(
    "troupe_dispatch_total",
    "Batches formed, by reason: the worker was idle (idle), it took all waiting work after a step \
     (backlog), or more work waited than fits (full)",
);
const PENDING_REQUESTS: Metric = Metric::new("troupe_pending_requests", "Requests that wait for a batch");
const PENDING_CHARACTERS: Metric =
    Metric::new("troupe_pending_characters", "Characters that wait for a batch");
const REJECTIONS: Metric = Metric::new(
    "troupe_rejections_total",
    "Requests refused or dropped, by reason: the queue was full (queue_full) or too slow (queue_slow), it \
     left a full queue for another client (pushed_out), the caller was gone (client_gone), a newer plan \
     replaced it (superseded), it waited for too long (expired), or its reader was too slow (reader_slow)",
);
const WORKERS: Metric = Metric::new("troupe_engine_workers", "Workers of the engine that are alive");
const WORKER_GAP: Metric = Metric::new(
    "troupe_worker_gap_duration_seconds",
    "Time from the end of a batch to the start of the next on the same worker, if work was waiting",
);
const FRAMES: Metric = Metric::new("troupe_frames_generated_total", "Frames generated");
const LOAD_SECONDS: Metric = Metric::new(
    "troupe_model_load_seconds",
    "Time to load a pack, including its first runs",
);
const ENGINE_INFO: Metric = Metric::new(
    "troupe_engine_info",
    "Always 1; the labels name the engine that runs a pack's networks, and its workers and threads",
);
const ENGINE_DIFFERENCE: Metric = Metric::new(
    "troupe_engine_difference",
    "Difference between a checked engine and f32 on the CPU, by figure. Each figure's name ends in its \
     unit; shares are from 0 to 1",
);

/// Why a request was refused or dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rejection {
    /// The queue had no room.
    QueueFull,
    /// The request would have waited for longer than allowed.
    QueueSlow,
    /// The queue was full, and a client with less waiting work needed the room.
    PushedOut,
    /// The caller no longer waited for the answer.
    ClientGone,
    /// A newer plan of the same character replaced it.
    Superseded,
    /// It had not started in time.
    Expired,
    /// Too many pieces of the answer waited for their reader.
    ReaderSlow,
}

impl Rejection {
    /// In the order of the discriminants.
    const ALL: [Self; 7] = [
        Self::QueueFull,
        Self::QueueSlow,
        Self::PushedOut,
        Self::ClientGone,
        Self::Superseded,
        Self::Expired,
        Self::ReaderSlow,
    ];

    fn label(self) -> &'static str {
        match self {
            Self::QueueFull => "queue_full",
            Self::QueueSlow => "queue_slow",
            Self::PushedOut => "pushed_out",
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
    worker_gap: Histogram,
    workers: Gauge,
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
    labels: Labels,
    telemetry: Telemetry,
}

impl PackMetrics {
    /// The metrics of the pack with this name and version.
    pub fn new(telemetry: &Telemetry, model: &str, version: &str) -> Self {
        let labels = Labels::of_pack(model, version);
        let counter = |metric, reason| telemetry.counter(metric, &labels.with("reason", reason));
        let histogram = |metric| telemetry.histogram(metric, &labels);
        let gauge = |metric| telemetry.gauge(metric, &labels);
        Self {
            queue: Class::ALL
                .map(|class| telemetry.histogram(&QUEUE_DURATION, &labels.with("class", class.label()))),
            worker_gap: histogram(&WORKER_GAP),
            workers: gauge(&WORKERS),
            assemble: histogram(&ASSEMBLE_DURATION),
            inference: Stage::ALL.map(|stage| {
                let labels = labels.with("stage", stage.name());
                (stage.name(), telemetry.histogram(&INFERENCE_DURATION, &labels))
            }),
            scatter: histogram(&SCATTER_DURATION),
            batch_size: histogram(&BATCH_SIZE),
            padding_ratio: histogram(&PADDING_RATIO),
            pending_requests: gauge(&PENDING_REQUESTS),
            pending_characters: gauge(&PENDING_CHARACTERS),
            load_seconds: gauge(&LOAD_SECONDS),
            frames: telemetry.counter(&FRAMES, &labels),
            dispatches: BatchReason::ALL.map(|reason| counter(&DISPATCHES, reason.label())),
            rejections: Rejection::ALL.map(|reason| counter(&REJECTIONS, reason.label())),
            labels,
            telemetry: telemetry.clone(),
        }
    }

    /// A request waited this long for its first batch.
    pub fn queued(&self, class: Class, waited: Duration) {
        self.queue[class as usize].record(waited);
    }

    /// A worker was idle for `gap` between two batches although work was waiting.
    pub fn worker_gap(&self, gap: Duration) {
        self.worker_gap.record(gap);
    }

    /// Sets how many workers are alive.
    pub fn workers(&self, workers: usize) {
        self.workers.set(workers as f64);
    }

    /// Sets how much waits in the queue.
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
            match self.inference.iter().find(|(known, _)| known == name) {
                Some((_, histogram)) => histogram.record(*took),
                // A network that is no stage of this family.
                None => {
                    let labels = self.labels.with("stage", *name);
                    self.telemetry
                        .histogram(&INFERENCE_DURATION, &labels)
                        .record(*took);
                }
            }
        }
        if step.rows > 0 {
            let padding = step.rows.saturating_sub(step.jobs);
            self.padding_ratio.record(padding as f64 / step.rows as f64);
        }
    }

    /// A request's frames were made from the network's output.
    pub fn scattered(&self, took: Duration, frames: usize) {
        self.scatter.record(took);
        self.frames.increment(frames as u64);
    }

    /// Frames of a live character's plan were made.
    pub fn planned(&self, frames: usize) {
        self.frames.increment(frames as u64);
    }

    /// Traces a plan that was asked for at `asked`, if it is sampled.
    pub fn trace_plan(&self, asked: Instant, served: &Served) {
        let trace = (self.telemetry.traces()).and_then(|traces| traces.root("plan", asked));
        if let Some(trace) = trace {
            trace_served(&trace, asked, served);
        }
    }

    /// Counts a refused or dropped request.
    pub fn rejected(&self, reason: Rejection) {
        self.rejections[reason as usize].increment(1);
    }

    /// A worker's networks were loaded and warmed up.
    pub fn loaded(&self, took: Duration) {
        self.load_seconds.set(took.as_secs_f64());
    }

    /// The engine of the pack was chosen.
    pub fn engine_chosen(&self, decision: &Decision) {
        let Decision {
            engine,
            workers,
            check,
            ..
        } = decision;
        let info = (self.labels)
            .with("engine", engine.name())
            .with("workers", workers.count.to_string())
            .with("threads", workers.threads.to_string());
        self.telemetry.gauge(&ENGINE_INFO, &info).set(1.0);
        if let Some(check) = check {
            let checked = self.labels.with("engine", check.engine.name());
            for bar in check.accuracy.bars() {
                let labels = checked.with("figure", bar.figure);
                self.telemetry.gauge(&ENGINE_DIFFERENCE, &labels).set(bar.found);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use troupe_engine::accuracy::Accuracy;
    use troupe_engine::onnx::Batching;
    use troupe_engine::{Check, EngineKind, Workers};

    #[test]
    fn metrics_carry_names_labels_and_buckets() {
        let telemetry = Telemetry::new().unwrap();
        let pack = PackMetrics::new(&telemetry, "human", "1.0");
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
        pack.workers(2);
        pack.engine_chosen(&decision());
        let text = telemetry.render();
        for line in [
            r#"troupe_inference_duration_seconds_bucket{model="human",version="1.0",stage="pose",le="0.008"} 1"#,
            r#"troupe_batch_size_sum{model="human",version="1.0"} 6"#,
            r#"troupe_batch_padding_ratio_bucket{model="human",version="1.0",le="0.3"} 1"#,
            r#"troupe_scatter_duration_seconds_bucket{model="human",version="1.0",le="0.00025"} 1"#,
            r#"troupe_scatter_duration_seconds_count{model="human",version="1.0"} 2"#,
            r#"troupe_dispatch_total{model="human",version="1.0",reason="idle"} 1"#,
            r#"troupe_rejections_total{model="human",version="1.0",reason="queue_full"} 1"#,
            r#"troupe_frames_generated_total{model="human",version="1.0"} 64"#,
            r#"troupe_rejections_total{model="human",version="1.0",reason="superseded"} 0"#,
            r#"troupe_rejections_total{model="human",version="1.0",reason="pushed_out"} 0"#,
            r#"troupe_queue_duration_seconds_bucket{model="human",version="1.0",class="live",le="0.004"} 1"#,
            r#"troupe_engine_workers{model="human",version="1.0"} 2"#,
            r#"troupe_engine_info{model="human",version="1.0",engine="openvino-bf16",workers="2",threads="1"} 1"#,
            r#"troupe_engine_difference{model="human",version="1.0",engine="openvino-bf16",figure="joint_mean_m"} 0.0005"#,
            "# TYPE troupe_pending_requests gauge",
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
            workers: Workers { count: 2, threads: 1 },
            batching: Batching::UNKNOWN,
            why: "it is fast".into(),
            check: Some(check),
        }
    }
}

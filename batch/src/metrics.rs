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
    "From a request's arrival at the batcher to the cut of its first batch, by class: plans of live characters, or \
         InBetween calls",
);
const ASSEMBLE_DURATION: Metric = Metric::new(
    "troupe_assemble_duration_seconds",
    "Filling a batch's input tensors, the choice of tokens included",
);
const INFERENCE_DURATION: Metric = Metric::new(
    "troupe_inference_duration_seconds",
    "One stage over one batch, all its passes",
);
const SCATTER_DURATION: Metric = Metric::new(
    "troupe_scatter_duration_seconds",
    "Copying a batch out of its tensors, and making a request's frames from that: a sample each",
);
const BATCH_SIZE: Metric = Metric::new("troupe_batch_size", "Characters in a batch, without padding");
const PADDING_RATIO: Metric = Metric::new("troupe_batch_padding_ratio", "Share of padding rows in a batch");
const DISPATCHES: Metric = Metric::new(
    "troupe_dispatch_total",
    "Batches formed, by reason: the worker was idle, it took what had waited, or more waited than fits",
);
const PENDING_REQUESTS: Metric = Metric::new("troupe_pending_requests", "Requests that wait for a batch");
const PENDING_CHARACTERS: Metric =
    Metric::new("troupe_pending_characters", "Characters that wait for a batch");
const REJECTIONS: Metric = Metric::new(
    "troupe_rejections_total",
    "Requests turned away or dropped before they ran, by reason: the queue was full or too slow, the caller had \
         gone, a newer plan of the character took the place, it had waited until nobody wanted the answer, or its reader \
         was too slow",
);
const WORKERS: Metric = Metric::new("troupe_engine_workers", "Workers of the engine that serve");
const WORKER_GAP: Metric = Metric::new(
    "troupe_worker_gap_duration_seconds",
    "From a batch's end to the start of the next on the same worker, where work waited",
);
const FRAMES: Metric = Metric::new("troupe_frames_generated_total", "Frames generated");
const LOAD_SECONDS: Metric = Metric::new(
    "troupe_model_load_seconds",
    "Time to load a pack, its first runs included",
);
const ENGINE_INFO: Metric = Metric::new(
    "troupe_engine_info",
    "1; the labels say what runs a pack's networks",
);
const ENGINE_DIFFERENCE: Metric = Metric::new(
    "troupe_engine_difference",
    "How far a checked engine is from f32 on the CPU, by figure: units are in the figure's name, shares go up to 1",
);

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
    /// The metrics of that pack.
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

    /// A worker stood idle for so long between two batches, though work waited.
    pub fn worker_gap(&self, gap: Duration) {
        self.worker_gap.record(gap);
    }

    /// So many workers serve.
    pub fn workers(&self, workers: usize) {
        self.workers.set(workers as f64);
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
            match self.inference.iter().find(|(known, _)| known == name) {
                Some((_, histogram)) => histogram.record(*took),
                // A network of another family.
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

    /// A request's frames were made from what was copied out of the tensors.
    pub fn scattered(&self, took: Duration, frames: usize) {
        self.scatter.record(took);
        self.frames.increment(frames as u64);
    }

    /// Frames of a live character's plan were made.
    pub fn planned(&self, frames: usize) {
        self.frames.increment(frames as u64);
    }

    /// A plan that was asked for at `asked` is there. A share of plans has a trace each.
    pub fn trace_plan(&self, asked: Instant, served: &Served) {
        let trace = (self.telemetry.traces()).and_then(|traces| traces.root("plan", asked));
        if let Some(trace) = trace {
            trace_served(&trace, asked, served);
        }
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

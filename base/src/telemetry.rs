//! The registry of metrics. Only this module uses the metrics library. Every server has its own
//! registry, so one process can run several servers.
//!
//! Each crate defines its metrics ([`Metric`]) and owns their handles.

mod request;
mod traces;

use std::sync::Arc;
use std::time::{Duration, Instant};

use metrics::{Key, Label, Level, Metadata, Recorder as _};
use metrics_exporter_prometheus::{BuildError, Matcher, PrometheusBuilder, PrometheusRecorder};
use opentelemetry_sdk::trace::SpanExporter;

pub use metrics::{Counter, Gauge, Histogram};
pub use opentelemetry::KeyValue;
pub use request::{RequestContext, RequestId};
pub use traces::{EXPORT_TIMEOUT, Trace, Traces};

/// Upper bounds of a histogram's buckets, by the suffix of its name.
const BUCKETS: [(&str, &[f64]); 4] = [
    // Frame budgets are among the bounds: 90, 60, 30 and 15 Hz.
    (
        "_seconds",
        &[
            0.000_25, 0.000_5, 0.001, 0.002, 0.004, 0.008, 0.011_1, 0.016_7, 0.025, 0.033_3, 0.05, 0.066_7,
            0.1, 0.2, 0.5, 1.0, 2.5,
        ],
    ),
    // Characters of a batch.
    ("_size", &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0]),
    // Shares, such as that of padding rows in a batch.
    ("_ratio", &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5]),
    // Intervals and lengths of plans.
    (
        "_frames",
        &[
            4.0, 9.0, 12.0, 16.0, 20.0, 24.0, 26.0, 30.0, 34.0, 40.0, 46.0, 50.0, 54.0, 64.0,
        ],
    ),
];

static METADATA: Metadata<'static> = Metadata::new(module_path!(), Level::INFO, Some(module_path!()));

/// Shortest time between two log lines of one kind.
const LOG_INTERVAL: Duration = Duration::from_secs(60);

/// Limits log lines of one kind to one a minute.
#[derive(Debug, Default)]
pub struct Seldom {
    last: Option<Instant>,
    held_back: u64,
}

impl Seldom {
    /// If the next line is due: how many were held back since the last one. Otherwise counts one
    /// more as held back.
    pub fn next(&mut self, now: Instant) -> Option<u64> {
        let early = self.last.is_some_and(|last| now < last + LOG_INTERVAL);
        if early {
            self.held_back += 1;
            return None;
        }
        self.last = Some(now);
        Some(std::mem::take(&mut self.held_back))
    }
}

/// A metric of one or more labelled series.
#[derive(Debug, Clone, Copy)]
pub struct Metric {
    /// A histogram's name ends in a unit that has buckets: `_seconds`, `_size`, `_ratio` or
    /// `_frames`.
    pub name: &'static str,
    /// The description that `/metrics` shows.
    pub help: &'static str,
}

impl Metric {
    /// Usable in constants.
    pub const fn new(name: &'static str, help: &'static str) -> Self {
        Self { name, help }
    }
}

/// The labels of a series.
#[derive(Debug, Clone, Default)]
pub struct Labels(Vec<Label>);

impl Labels {
    /// The labels of one pack's series: its name and version.
    pub fn of_pack(model: &str, version: &str) -> Self {
        Self::default()
            .with("model", model.to_owned())
            .with("version", version.to_owned())
    }

    /// These labels and one more.
    pub fn with(&self, key: &'static str, value: impl Into<metrics::SharedString>) -> Self {
        let mut labels = self.0.clone();
        labels.push(Label::new(key, value));
        Self(labels)
    }

    fn key(&self, metric: &Metric) -> Key {
        Key::from_parts(metric.name, self.0.clone())
    }
}

/// A server's metrics registry. Clones share it.
#[derive(Clone)]
pub struct Telemetry {
    recorder: Arc<PrometheusRecorder>,
    process: Arc<metrics_process::Collector>,
    traces: Option<Traces>,
}

impl Telemetry {
    /// A registry that only has the metrics of the process.
    ///
    /// # Errors
    /// None in practice: the library only rejects empty bucket lists, and `BUCKETS` has none.
    pub fn new() -> Result<Self, BuildError> {
        let mut builder = PrometheusBuilder::new();
        for (unit, bounds) in BUCKETS {
            builder = builder.set_buckets_for_metric(Matcher::Suffix(unit.to_owned()), bounds)?;
        }
        let recorder = builder.build_recorder();
        let process = metrics_process::Collector::default();
        metrics::with_local_recorder(&recorder, || process.describe());
        Ok(Self {
            recorder: Arc::new(recorder),
            process: Arc::new(process),
            traces: None,
        })
    }

    /// Turns on traces: see [`Traces::new`]. Call it on a tokio runtime.
    pub fn traced(mut self, exporter: impl SpanExporter + 'static, sample_ratio: f64) -> Self {
        self.traces = Some(Traces::new(exporter, sample_ratio, &self));
        self
    }

    /// Makes traces; none if they are off.
    pub fn traces(&self) -> Option<&Traces> {
        self.traces.as_ref()
    }

    /// The registry in Prometheus' text format.
    pub fn render(&self) -> String {
        metrics::with_local_recorder(&*self.recorder, || self.process.collect());
        self.recorder.handle().render()
    }

    /// Folds recorded samples into their buckets. Call it every few seconds: otherwise samples pile
    /// up if no scraper reads the metrics.
    pub fn run_upkeep(&self) {
        self.recorder.handle().run_upkeep();
    }

    /// The handle of a series. Keep it, because each call registers the metric's description again.
    pub fn counter(&self, metric: &Metric, labels: &Labels) -> Counter {
        self.recorder
            .describe_counter(metric.name.into(), None, metric.help.into());
        self.recorder.register_counter(&labels.key(metric), &METADATA)
    }

    /// As [`counter`](Self::counter), for a gauge.
    pub fn gauge(&self, metric: &Metric, labels: &Labels) -> Gauge {
        self.recorder
            .describe_gauge(metric.name.into(), None, metric.help.into());
        self.recorder.register_gauge(&labels.key(metric), &METADATA)
    }

    /// As [`counter`](Self::counter), for a histogram.
    pub fn histogram(&self, metric: &Metric, labels: &Labels) -> Histogram {
        self.recorder
            .describe_histogram(metric.name.into(), None, metric.help.into());
        self.recorder.register_histogram(&labels.key(metric), &METADATA)
    }
}

impl std::fmt::Debug for Telemetry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Telemetry")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CALLS: Metric = Metric::new("calls_total", "Calls");

    #[test]
    fn series_carry_their_description_labels_and_buckets() {
        let telemetry = Telemetry::new().unwrap();
        let labels = Labels::of_pack("human", "1.0");
        telemetry.counter(&CALLS, &labels.with("code", "OK")).increment(2);
        for (unit, bounds) in BUCKETS {
            let name: &'static str = format!("some{unit}").leak();
            let histogram = telemetry.histogram(&Metric::new(name, "Some"), &labels);
            histogram.record(bounds[1]);
        }
        let text = telemetry.render();
        for line in [
            "# HELP calls_total Calls",
            r#"calls_total{model="human",version="1.0",code="OK"} 2"#,
            r#"some_seconds_bucket{model="human",version="1.0",le="0.0005"} 1"#,
            r#"some_size_bucket{model="human",version="1.0",le="2"} 1"#,
            r#"some_ratio_bucket{model="human",version="1.0",le="0.1"} 1"#,
            r#"some_frames_bucket{model="human",version="1.0",le="9"} 1"#,
            "process_resident_memory_bytes",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }

    #[test]
    fn registries_are_separate() {
        let (one, two) = (Telemetry::new().unwrap(), Telemetry::new().unwrap());
        one.counter(&CALLS, &Labels::default()).increment(1);
        assert!(one.render().contains("calls_total") && !two.render().contains("calls_total"));
    }

    #[test]
    fn log_lines_come_once_a_minute() {
        let (mut seldom, begun) = (Seldom::default(), Instant::now());
        assert_eq!(seldom.next(begun), Some(0));
        for second in 1..60 {
            assert_eq!(seldom.next(begun + Duration::from_secs(second)), None);
        }
        assert_eq!(seldom.next(begun + LOG_INTERVAL), Some(59));
    }
}

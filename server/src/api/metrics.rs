//! Metrics of answers.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use troupe_base::telemetry::{Counter, Histogram, Labels, Metric, Telemetry};

const REQUESTS: Metric = Metric::new(
    "troupe_requests_total",
    "Requests answered, by remote procedure and status code",
);
const REQUEST_DURATION: Metric = Metric::new(
    "troupe_request_duration_seconds",
    "From a request's arrival to its answer",
);

/// The metrics of one remote procedure with one status code.
#[derive(Debug, Clone)]
struct Answers {
    count: Counter,
    duration: Histogram,
}

/// The metrics of a server's answers. Clones share them.
#[derive(Debug, Clone)]
pub(super) struct RequestMetrics {
    telemetry: Telemetry,
    /// By remote procedure and code. A series is made when its first answer is sent.
    series: Arc<Mutex<HashMap<(&'static str, &'static str), Answers>>>,
}

impl RequestMetrics {
    pub(super) fn new(telemetry: &Telemetry) -> Self {
        Self {
            telemetry: telemetry.clone(),
            series: Arc::default(),
        }
    }

    /// Counts an answered request and its time.
    pub(super) fn answered(&self, rpc: &'static str, code: &'static str, took: Duration) {
        let Answers { count, duration } = self.series(rpc, code);
        count.increment(1);
        duration.record(took);
    }

    fn series(&self, rpc: &'static str, code: &'static str) -> Answers {
        let mut series = self.series.lock().unwrap_or_else(PoisonError::into_inner);
        let answers = series.entry((rpc, code)).or_insert_with(|| {
            let labels = Labels::default().with("rpc", rpc);
            Answers {
                count: self.telemetry.counter(&REQUESTS, &labels.with("code", code)),
                duration: self.telemetry.histogram(&REQUEST_DURATION, &labels),
            }
        });
        answers.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_counted_by_procedure_and_code() {
        let telemetry = Telemetry::new().unwrap();
        let metrics = RequestMetrics::new(&telemetry);
        metrics.answered("InBetween", "OK", Duration::from_millis(3));
        metrics.answered("InBetween", "NOT_FOUND", Duration::from_millis(1));
        let text = telemetry.render();
        for line in [
            r#"troupe_requests_total{rpc="InBetween",code="OK"} 1"#,
            r#"troupe_requests_total{rpc="InBetween",code="NOT_FOUND"} 1"#,
            r#"troupe_request_duration_seconds_bucket{rpc="InBetween",le="0.004"} 2"#,
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }
}
